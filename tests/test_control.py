"""The displacement loop: valve linearisation, force balance, following, and settings files."""

from dataclasses import replace

import numpy as np
import pytest

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.control.loop import control_step
from lhpost6_pin.equilibrium import hydraulic_rows, unloaded_speeds
from lhpost6_pin.errors import ParameterError
from lhpost6_pin.laws.orifice import opening, spool_for_opening
from lhpost6_pin.machine import load_machine
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.pose import leg_displacements, platen_motion
from lhpost6_pin.rehearse import rehearse
from lhpost6_pin.signals import align, delay, rrmse
from lhpost6_pin.simulate import SAMPLE_RATE, OpenLoop, simulate


@pytest.fixture(scope="module")
def loop(plant, rest):
    return make_controller(plant, rest, load_controller("lhpost6"))


def step(plant, loop, pose, force, reference, memory=None):
    """Command of one sample for a platen at rest in a pose."""
    memory = loop.fresh_memory() if memory is None else memory
    memory[0, :6] = pose
    displacement = np.zeros(len(plant.ports))
    legs, _ = leg_displacements(plant, pose)
    displacement[: plant.legs.size] = legs[0]
    command = np.zeros(plant.spools)
    control_step(
        0, reference, displacement, force, plant.legs, plant.body, plant.axes,
        loop.axis, loop.actuator, loop.balance, memory, command,
    )  # fmt: skip
    return command


def test_at_rest_the_command_is_the_spool_that_feeds_the_leak(plant, rest, loop):
    command = step(plant, loop, np.zeros(6), rest.force, np.zeros((1, 12)))
    assert np.allclose(command, rest.spool, rtol=0.0, atol=1e-12)  # rounding of the pose estimate times the gain


def test_valve_linearisation_gives_the_asked_piston_speed_in_the_steady_state(plant, rest, loop):
    """Spools commanded for a slow vertical speed move the platen at that speed, up and down."""
    for speed in (0.05, -0.05):
        reference = np.zeros((1, 12))
        reference[0, 8] = speed
        spool = step(plant, loop, np.zeros(6), rest.force, reference)
        run = simulate(plant, OpenLoop(np.tile(spool, (1024, 1)), rest.state), samples=1024, engine="fused")
        moved = platen_motion(plant, run.q, run.v, run.a).displacement[:, 2]
        mean = (moved[-1] - moved[512]) / (511 / SAMPLE_RATE)  # over several periods of the oil column
        assert mean == pytest.approx(speed, rel=0.06)  # friction and the hold-down's slope change the pressure drop


def test_unloaded_speed_is_where_both_chambers_take_the_same_stroke(plant, rest):
    """The closed form against the flow equations: pressures at that speed balance the rest force."""
    row = plant.rows[hydraulic_rows(plant)][0]
    area_a, area_b, k_pa, k_bt = row["p"][:4]
    speed, _ = unloaded_speeds(row, float(rest.force[0]), plant.supply)
    pressure_a = plant.supply[0] - (area_a * speed / k_pa) ** 2
    pressure_b = plant.supply[1] + (area_b * speed / k_bt) ** 2
    assert pressure_a * area_a == pytest.approx(pressure_b * area_b, rel=1e-9)


def test_spool_for_opening_undoes_the_flow_curve():
    for x in (-1.0, -0.3, -1e-6, 0.0, 1e-6, 0.5, 1.0):
        assert spool_for_opening(opening(x, 1.3), 1.3) == pytest.approx(x, abs=1e-12)
    assert spool_for_opening(1.5, 1.3) > 1.0  # more than the valve has asks for more than full stroke


def test_balance_acts_only_where_the_platen_does_not_move(plant, loop):
    """Leg rates of the force balance lie in the null space of the motion: J^+ times them is zero."""
    _, rates = leg_displacements(plant, np.zeros((6, 6)), np.eye(6))
    jacobian = rates.T[: plant.spools]
    assert np.abs(np.linalg.pinv(jacobian) @ loop.balance).max() < 1e-12 * np.abs(loop.balance).max()
    assert np.linalg.matrix_rank(loop.balance) == 4


def test_command_beyond_full_stroke_is_clipped(plant, rest, loop):
    reference = np.zeros((1, 12))
    reference[0, 6] = 5.0
    command = step(plant, loop, np.zeros(6), rest.force, reference)
    assert np.all(np.abs(command[:4]) == 1.0)
    # H1 and H2 shorten when the platen moves to +X
    assert np.all(np.sign(command[:4]) == [-1, -1, 1, 1])


def test_force_feedback_passes_no_static_force(plant, rest, loop):
    """A steady load changes the command at first, then not at all: the feedback is high-passed."""
    memory = loop.fresh_memory()
    loaded = rest.force + 1e5
    reference = np.zeros((1, 12))
    first = step(plant, loop, np.zeros(6), loaded, reference, memory)
    for _ in range(8 * SAMPLE_RATE):
        last = step(plant, loop, np.zeros(6), loaded, reference, memory)
    balance = step(plant, loop._replace(axis=no_feedback(loop.axis)), np.zeros(6), loaded, reference)
    assert np.abs(last - balance).max() < 1e-3 * np.abs(first - balance).max()


def no_feedback(axis):
    out = axis.copy()
    out["force_gain"] = 0.0
    return out


def test_an_earthquake_is_reproduced_tri_axially(plant):
    """Ridgecrest's strongest seconds: displacement within 3 %, acceleration within 30 % with the delay removed.

    Required of a first loop is that it reproduces an earthquake; the figures it reaches are in the report.
    """
    target = make_target(find_motion("ridgecrest"), window=(8.0, 22.0), rate=float(SAMPLE_RATE))
    test = rehearse(load_machine(), target, load_controller("lhpost6"), attrs={"test": "ridgecrest"}, engine="fused")
    assert test.run.trouble is None and test.run.clipped == 0
    for name, allowed in (("displacement", 0.03), ("acceleration", 0.30)):
        asked = getattr(target, name)[:, :3]
        achieved = test.record[f"platen_{name}"].values[:, :3]
        late = delay(asked, achieved, 1 / SAMPLE_RATE)
        assert np.all(rrmse(asked, align(achieved, late, 1 / SAMPLE_RATE)) < allowed)
        assert np.all(late > 0.0) and np.all(late < 0.04)  # the real table: 25 to 30 ms
    rotations = np.abs(test.record["platen_displacement"].values[:, 3:]).max()
    assert rotations < 1e-3  # nobody asked for any


def test_loop_works_on_another_machine_and_with_two_valves():
    target = make_target(find_motion("sine", axis="x", amplitude=0.05, period=1.0), rate=float(SAMPLE_RATE))
    small = rehearse(
        load_machine("uniaxial"), target, load_controller("uniaxial"), attrs={"test": "sine"}, engine="fused"
    )
    both = load_machine().with_params({"horizontal.valves": 2})
    large = rehearse(both, target, load_controller("lhpost6"), attrs={"test": "sine"}, engine="fused")
    for test in (small, large):
        assert test.run.trouble is None
        error = rrmse(target.displacement[:, 0], test.record["platen_displacement"].values[:, 0])
        assert error < 0.10  # a lag of 16 ms at 1 Hz, not removed


def test_oil_column_would_ring_without_force_feedback(plant, rest):
    settings = load_controller("lhpost6")
    target = make_target(find_motion("ridgecrest"), window=(10.0, 16.0), axes="x", rate=float(SAMPLE_RATE))

    def roughness(damping):
        changed = replace(settings, force_damping=damping)
        test = rehearse(plant.machine, target, changed, attrs={"test": "x"}, engine="fused")
        late = delay(target.acceleration[:, 0], test.record["platen_acceleration"].values[:, 0], 1 / SAMPLE_RATE)
        return rrmse(
            target.acceleration[:, 0],
            align(test.record["platen_acceleration"].values[:, 0], late, 1 / SAMPLE_RATE),
        )

    assert roughness(settings.force_damping) < 0.5 * roughness((0.0,) * 6)


def test_settings_that_cannot_be_are_refused_by_key(tmp_path):
    with pytest.raises(ParameterError, match="no controller settings named 'nobody'; valid names: lhpost6, uniaxial"):
        load_controller("nobody")
    from lhpost6_pin.files import models_folder

    text = (models_folder() / "controllers" / "lhpost6.toml").read_text(encoding="utf-8")
    path = tmp_path / "loop.toml"
    path.write_text(text.replace("balance_gain = { value = 3.0", "balance_gain = { value = -3.0"), encoding="utf-8")
    with pytest.raises(ParameterError, match=r"loop.toml: loop.balance_gain: -3.0 is impossible"):
        load_controller(path)
    path.write_text(text.replace("reset_gain", "rest_gain"), encoding="utf-8")
    with pytest.raises(ParameterError, match=r"loop.reset_gain is missing"):
        load_controller(path)
