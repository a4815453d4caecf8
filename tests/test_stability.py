"""Stability of the controlled table: eigenvalues of its sampled closed loop against simulation and against margins."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from machine_cases import machine_named
from scipy.linalg import eigvalsh

from lhpost6_pin.cli.loop_check import loop_facts
from lhpost6_pin.control import Notch, controlled, load_controller
from lhpost6_pin.core.names import AXES, SAMPLE_RATE
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate
from lhpost6_pin.tuning.interaction import BARE, MOUNTED, find_interaction
from lhpost6_pin.tuning.margins import linear_table, loop_gain, make_loop_model, margins, without_dry_friction
from lhpost6_pin.tuning.stability import check_loop, closed_loop_rates

MACHINE = machine_named("lhpost6")
SHIPPED = load_controller("lhpost6")


def block(folder, mass, height):
    """A rigid specimen of `mass` [kg] whose centre is `height` [m] above the platen."""
    path = folder / f"block_{mass:g}_{height:g}.urdf"
    inertia = f'ixx="{mass}" iyy="{mass}" izz="{mass}" ixy="0" ixz="0" iyz="0"'
    path.write_text(
        f'<robot name="b"><link name="block"><inertial><origin xyz="0 0 {height}"/><mass value="{mass}"/>'
        f"<inertia {inertia}/></inertial></link></robot>"
    )
    return path


def growth(machine, settings, seconds=6.0, axis="y", size=1e-4):
    """Growth rate [1/s] of an axis's speed after a burst of noise, without dry friction, over the last 4 s."""
    plant, rest, controller = controlled(without_dry_friction(machine), settings)
    drive = np.zeros((round(seconds * SAMPLE_RATE), 6))
    drive[:1024] = size * np.random.default_rng(0).standard_normal((1024, 6)) * [1, 1, 1, 0.2, 0.2, 0.2]
    run = simulate(plant, ClosedLoop(controller, drive, rest), samples=len(drive), engine="fused")
    speed, n = run.v[:, AXES.index(axis)], 2 * SAMPLE_RATE
    early, late = (np.sqrt(np.mean(part**2)) for part in (speed[-2 * n : -n], speed[-n:]))
    return np.log(late / early) / 2.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "mass", "axis", "verdict"), [("cautious", None, "y", "unstable"), ("lhpost6", 400e3, "z", "unstable")]
)
def test_an_unstable_loop_grows_in_simulation_at_the_rate_of_its_eigenvalue(tmp_path, name, mass, axis, verdict):
    machine = MACHINE if mass is None else MACHINE.with_specimen(block(tmp_path, mass, 3.0))
    settings = load_controller(name)
    found = check_loop(controlled(machine, settings)[2])
    assert (found.verdict, found.growth_axis) == (verdict, axis)
    # other motions still decay beside it: a tenth of the rate's own order, 0.1 to 0.5 1/s
    assert growth(machine, settings, axis=axis) == pytest.approx(found.growth, abs=0.02)
    assert "unstable" in found.summary and f"{found.growth_frequency:.3g} Hz" in found.summary and not found.thin


@pytest.mark.long
def test_the_shipped_loop_is_stable_bare_and_thin_under_a_tall_specimen(tmp_path):
    bare = check_loop(controlled(MACHINE, SHIPPED)[2])
    assert bare.verdict == "stable" and not bare.thin and growth(MACHINE, SHIPPED) < 0.0
    tall = check_loop(controlled(MACHINE.with_specimen(block(tmp_path, 40e3, 6.0)), SHIPPED)[2])
    assert tall.verdict == "thin" and "roll" in tall.thin
    roll = tall.margins[tall.axes.index("roll")]
    assert roll.gain < tall.limits.gain_margin and roll.phase < tall.limits.phase_margin
    assert "roll" in tall.summary and "thin" in tall.summary


def test_a_loop_turns_unstable_where_its_margin_says():
    """With a master gain just below and above its gain margin; the model of margins is not sampled: 2 %."""
    machine = machine_named("uniaxial")
    settings = load_controller(machine.controller)
    _, _, controller = controlled(machine, settings)
    (margin,) = margins(make_loop_model(controller), controller)
    for factor, stable in ((0.98, True), (1.02, False)):
        gain = tuple(factor * margin.gain * g for g in settings.master_gain)
        found = check_loop(controlled(machine, replace(settings, master_gain=gain))[2])
        assert found.stable == stable
    assert found.growth_frequency == pytest.approx(margin.gain_frequency, rel=0.02)


def test_margins_of_the_adapted_grid_are_those_of_the_dense_one():
    _, _, controller = controlled(MACHINE, SHIPPED)
    dense = margins(make_loop_model(controller), controller)
    for one, other in zip(check_loop(controller).margins, dense, strict=True):
        assert one.gain == pytest.approx(other.gain, rel=0.02)
        assert one.phase == pytest.approx(other.phase, abs=0.02)


def test_rates_of_the_closed_loop_are_zeros_of_the_loop_in_frequency_with_a_notch_and_an_integrator():
    """1 + L(s) = 0 at every rate s; L takes samples for continuous but for their hold, which errs by f / 2048 Hz."""
    machine = machine_named("uniaxial")
    settings = load_controller(machine.controller)
    table = linear_table(controlled(machine, settings)[2])
    notch = Notch((20.0,) * 6, (5.0,) * 6, (-0.9,) * 6)
    _, _, controller = controlled(machine, replace(settings, notches=(notch,)))
    rates, _ = closed_loop_rates(controller, table)
    swinging = [s for s in rates if 1.0 < s.imag / (2 * np.pi) < 60.0 and s.real > -100.0]
    assert len(swinging) >= 2
    for s in swinging:
        model = make_loop_model(controller, np.array([s / (2j * np.pi)]), table)
        assert abs(1.0 + loop_gain(model, controller)[0, 0, 0]) < 0.05
    still = replace(settings, master_gain=(0.0,) * 6, balance_gain=0.0)
    free, _ = closed_loop_rates(controlled(machine, still)[2], table)
    open_rates = np.linalg.eigvals(table.a)
    for s in open_rates:  # without gain the closed loop has the table's own rates
        assert np.abs(free - s).min() < 1e-6 * max(1.0, abs(s))


def test_a_tuned_loop_and_a_heavier_specimen_differ_in_the_interaction(tmp_path):
    machine = MACHINE.with_specimen(block(tmp_path, 20e3, 6.0))
    found = find_interaction(machine, SHIPPED, load_controller("untuned"))
    assert list(found.responses)[:2] == [BARE, MOUNTED] and len(found.responses) == 3 and not found.modes
    roll = found.cuts[MOUNTED][found.axes.index("roll")]
    assert roll.peak > 1.4 and 25.0 < roll.peak_frequency <= 33.0  # the margin above is 1.8 dB at 33 Hz
    assert found.responses[BARE].shape == (len(found.frequency), 6)
    assert found.rigid


UPRIGHT = """<robot name="upright"><link name="foot"><inertial><mass value="10"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="foot"/><child link="rod"/><axis xyz="0 1 0"/></joint>
<link name="rod"><inertial><origin xyz="0 0 2"/><mass value="100"/>
<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def test_a_specimen_that_falls_over_is_called_so_and_not_the_loop(tmp_path):
    """An upright point mass at 2 m grows by (g / l)^1/2; hanging, or locked, it does not."""
    (tmp_path / "upright.urdf").write_text(UPRIGHT)
    machine = MACHINE.with_specimen(tmp_path / "upright.urdf")
    found = check_loop(controlled(machine, SHIPPED)[2])
    assert found.specimen_growth == pytest.approx(np.sqrt(9.80665 / 2.0), rel=1e-4)  # differences; 5e-6 of inertia
    assert found.verdict == "unstable" and found.summary.startswith("The specimen is unstable in this pose")
    assert "--locked" in found.summary and "control loop" not in found.summary
    assert "loop_remedy" not in loop_facts(found, None)
    locked = check_loop(controlled(MACHINE.with_specimen(tmp_path / "upright.urdf", locked=True), SHIPPED)[2])
    assert not locked.falls and locked.verdict == "stable"
    (tmp_path / "hanging.urdf").write_text(UPRIGHT.replace('xyz="0 0 2"', 'xyz="0 0 -2"'))
    assert not check_loop(controlled(MACHINE.with_specimen(tmp_path / "hanging.urdf"), SHIPPED)[2]).falls


def test_modes_that_a_specimen_states_by_its_matrices_are_those_of_the_interaction():
    """Frequencies by an eigenvalue problem of the file's own matrices; masses of all modes add up to what moves."""
    machine = MACHINE.with_specimen("tall_column")
    found = find_interaction(machine, SHIPPED)
    entries = tomllib.loads(Path(machine.specimen.file).read_text())["matrices"]
    mass, stiffness = entries["mass"]["value"], entries["stiffness"]["value"]
    expected = np.sqrt(eigvalsh(stiffness, mass)) / (2 * np.pi)
    np.testing.assert_allclose([mode.frequency for mode in found.modes], expected, rtol=1e-9)  # rounding
    np.testing.assert_allclose([mode.damping for mode in found.modes], 0.03, rtol=1e-9)
    total = sum(mode.mass for mode in found.modes)
    np.testing.assert_allclose(total[:3], [44e3, 44e3, 0.0], rtol=1e-9, atol=1e-6)  # its matrices move no mass in z
    assert not found.rigid


def test_a_joint_about_the_vertical_is_neutral_and_its_specimen_stands(tmp_path):
    """Nothing turns it either way; what derivatives by differences leave of that is no growth."""
    text = UPRIGHT.replace('xyz="0 1 0"', 'xyz="0 0 1"').replace('xyz="0 0 2"', 'xyz="1 0 2"')
    (tmp_path / "turning.urdf").write_text(text)
    assert not check_loop(controlled(MACHINE.with_specimen(tmp_path / "turning.urdf"), SHIPPED)[2]).falls
