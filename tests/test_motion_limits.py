"""Limits of a motion with what is mounted: forces, strengths, ends of strokes, and what a run says of them."""

import logging
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import plant_named

from lhpost6_pin.cli.options import Valves
from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import OutOfRangeError, SimulationError
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.core.rounding import rounded_down
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.machine.machine import build_machine, load_machine
from lhpost6_pin.machine.strength import stated_strength
from lhpost6_pin.mechanics.actuator_forces import axis_capacity, force_range, required_forces, rest_forces
from lhpost6_pin.mechanics.capacity import ALL_VALVES
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.instant import platen_pose_at, required_wrench_at, wrench_at
from lhpost6_pin.mechanics.motion_demands import MotionDemands
from lhpost6_pin.mechanics.payload import lock_joints, with_payload
from lhpost6_pin.mechanics.performance import table_performance
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.port_path import ports_along
from lhpost6_pin.mechanics.pose import PlatenMotion, leg_displacements, plant_motion
from lhpost6_pin.mechanics.strokes import stroke_ends
from lhpost6_pin.motions import find_motion, make_target, with_scale
from lhpost6_pin.simulation.ledger import force_ledger
from lhpost6_pin.simulation.motion_limits import check_motion_limits, fitting_scale, judge_motion, judge_record
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.simulation.simulate import OpenLoop, simulate
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign
from lhpost6_pin.simulation.trouble import run_doubts, with_pressure_trouble

G = 9.80665
BLOCK = """<robot name="block"><link name="block"><inertial><origin xyz="{x} {y} {z}"/><mass value="{mass}"/>
<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def block(folder, weight: float = 4.9e6, x: float = 0.0, y: float = 0.0, z: float = 0.0):
    """URDF of a rigid block with its centre at (x, y, z) from C."""
    path = folder / "block.urdf"
    path.write_text(BLOCK.format(x=x, y=y, z=z, mass=weight / G, i=1e-3 * weight))
    return path


def sine(axis: str, peak: float, frequency: float = 2.0):
    """A sine with a peak acceleration [m/s2]."""
    amplitude = peak / (2.0 * np.pi * frequency) ** 2
    return make_target(find_motion("sine", axis=axis, amplitude=amplitude, period=1.0 / frequency), rate=2048.0)


def test_a_2_g_motion_with_4_9_mn_is_refused_by_the_limit_and_with_the_scale_that_fits(tmp_path):
    """X: the reaction mass bears 6.8 MN, 1.038 g with the payload; the actuators give 1.604 g."""
    machine = load_machine().with_params({"horizontal.valves": 2}).with_specimen(block(tmp_path))
    plant, target = make_plant(machine), sine("x", 2.0 * G)
    with pytest.raises(
        OutOfRangeError,
        match=r"x reaction mass strength .*; H[1-4] actuator pull|actuator pull.*x reaction mass strength",
    ) as caught:
        check_motion_limits(plant, target)
    mass = 168100.0 + 4.9e6 / G
    peak = float(np.abs(target.acceleration[:, 0]).max())
    assert caught.value.largest_scale == pytest.approx(6.8e6 / mass / peak, rel=0.01)  # three digits, rounded down
    assert check_motion_limits(plant, with_scale(target, caught.value.largest_scale)).highest[2] <= 1.0 + 1e-6
    assert "also" not in str(caught.value).split("reaction mass strength")[0]
    check_motion_limits(make_plant(load_machine().with_valves(2)), target)  # the bare table can


def test_required_forces_balance_the_motion_in_the_report_s_equations():
    """Independent route: wrenches in the notation of Chapters 3 and 4 at one tilted, moving pose."""
    plant = plant_named("lhpost6")
    pose = np.array([[0.2, -0.1, 0.03, 0.006, -0.008, 0.02]])
    motion = PlatenMotion(
        pose, np.array([[0.5, 0.3, 0.1, 0.01, 0.02, 0.03]]), np.array([[4.0, -3.0, 2.0, 0.3, 0.2, -0.1]])
    )
    found, span = required_forces(plant, motion), force_range(plant)
    legs, _ = leg_displacements(plant, pose)
    np.testing.assert_array_equal(required_forces(plant, motion, legs).share, found.share)
    force = span.middle + span.half * found.share[0]
    moved = plant_motion(plant, motion)
    place = platen_pose_at(pose[0])
    given = wrench_at(plant, place, [*force, *found.pull[0]])
    turn = place.rotation
    twist = pin.Motion(motion.velocity[0, :3], turn @ moved.v[0, 3:])
    rate = pin.Motion(motion.acceleration[0, :3], turn @ moved.a[0, 3:])
    still = required_wrench_at(plant, place, twist, rate)
    np.testing.assert_allclose(given.vector, still.vector, atol=1e-7 * np.abs(still.vector).max())


def test_single_axis_capacity_is_the_closed_form_and_joints_of_a_specimen_do_not_matter():
    plant = plant_named("lhpost6")
    capacity, span = axis_capacity(plant), force_range(plant)
    rest = find_equilibrium(plant).force[4:]
    assert capacity.rise[2] == pytest.approx(np.sum(span.most[4:] - rest), rel=1e-9)
    assert capacity.fall[2] == pytest.approx(np.sum(rest - span.least[4:]), rel=1e-9)
    assert capacity.fall[3] == pytest.approx(6 * 2.871 * (rest[0] - span.least[4]), rel=1e-6)  # all six at one lever
    machine = load_machine()
    loose, locked = (make_plant(machine.with_specimen("pendulum", locked=x)) for x in (False, True))
    one, two = axis_capacity(loose), axis_capacity(locked)
    np.testing.assert_allclose(one.fall, two.fall, rtol=1e-12)
    assert lock_joints(locked) is locked


def test_a_tall_specimen_is_limited_by_the_unloading_of_a_vertical_actuator(tmp_path):
    plant = make_plant(load_machine().with_specimen(block(tmp_path, 2e6, z=8.0)))
    performance = {one.axis: one for one in table_performance(plant)}
    assert performance["x"].bound("acceleration").by.startswith("unloading of V")
    limit = performance["x"].bound("acceleration").value
    still = np.zeros((2, 6))
    push = np.zeros((2, 6))
    push[:, 0] = [limit, -limit]
    shares = {
        p.quantity: p.utilisation for p in judge_motion(plant, PlatenMotion(still, still, push)).peaks if p.decides
    }
    assert max(shares.values()) == pytest.approx(1.0, abs=1e-6)


def test_the_peak_of_unloading_is_the_force_lost_that_its_share_is_of():
    plant, still = plant_named("lhpost6"), np.zeros((2, 6))
    rise = still.copy()
    rise[:, 2] = [-5.0, 0.0]
    found = {demand.quantity: demand for demand in MotionDemands(plant)(still, still, rise)}
    span, rest = force_range(plant), rest_forces(plant)
    at_rest = (span.middle + span.half * rest.share[0])[4:]  # of the vertical actuators
    lost = found["actuator unloading"]
    assert lost.value[0].min() > 0.0
    np.testing.assert_allclose(lost.share * (at_rest - span.least[4:]), lost.value, rtol=1e-12)  # rounding
    np.testing.assert_array_equal(lost.value[1], 0.0)  # at rest none is lost
    push = found["actuator push"]
    np.testing.assert_allclose(push.share[:, 4:] * (span.most[4:] - at_rest), push.value[:, 4:], rtol=1e-12)


def test_performance_is_the_least_of_three_lines():
    (one,) = table_performance(plant_named("uniaxial"))
    bounds = [one.bound(q).value for q in ("displacement", "velocity", "acceleration")]
    frequency = np.array([0.01, 0.6, 40.0])
    w = 2.0 * np.pi * frequency
    np.testing.assert_allclose(one.peak_velocity(frequency), [w[0] * bounds[0], bounds[1], bounds[2] / w[2]])
    loaded = {o.axis: o for o in table_performance(with_payload(plant_named("lhpost6"), 4.9e6))}
    assert loaded["z"].bound("acceleration").value / G == pytest.approx(1.632, abs=1e-3)


def test_a_specimen_that_unloads_an_actuator_is_to_move_or_to_be_held_down_not_to_have_more_supply(tmp_path):
    machine = load_machine().with_specimen(block(tmp_path, 4e5 * G, x=6.0, y=3.0))
    where = r"V6 must give 1\.23\de\+05 N at rest, which unloads it: 0\.239 MPa in its chamber, below .* 0\.55 MPa"
    with pytest.raises(SimulationError, match=where) as caught:
        find_equilibrium(make_plant(machine))
    assert "supply_pressure" not in str(caught.value)
    assert str(caught.value).endswith(
        "move the specimen towards the centre, or raise the pressure of the struts (hold_down.pressure)"
    )
    for helped in (
        load_machine().with_specimen(block(tmp_path, 4e5 * G, x=5.0, y=2.5)),
        machine.with_params({"hold_down.pressure": {"value": 19.0, "unit": "MPa"}}),
    ):
        check_motion_limits(make_plant(helped), sine("x", 0.01))
    with pytest.raises(SimulationError, match=r"V1 .*beyond its supply: .*raise hydraulics\.supply_pressure"):
        find_equilibrium(make_plant(load_machine().with_specimen(block(tmp_path, 80e6))))
    near = load_machine().with_specimen(block(tmp_path, 3.33e6, x=9.0))  # above return pressure, below 125 psi
    with pytest.raises(OutOfRangeError, match=r"V[56] must .* unloads it: .* 0\.862 MPa, .*hold_down\.pressure") as low:
        check_motion_limits(make_plant(near), sine("x", 1.0))
    assert low.value.exceeded == ("actuator unloading",)


def test_a_motion_beyond_the_valves_says_what_the_other_reading_of_eq_4_2_admits():
    plant, target = plant_named("lhpost6"), make_target(find_motion("sxh1"), rate=float(SAMPLE_RATE))
    with pytest.raises(OutOfRangeError, match='flow_reading = "full_stroke"') as caught:
        check_motion_limits(plant, target)
    other = make_plant(plant.machine.with_flow_reading("full_stroke"))
    fits = fitting_scale(other, target)
    assert str(caught.value).endswith(f"the largest scale is {fits:g}") and fits > caught.value.largest_scale


def test_a_motion_beyond_one_open_valve_states_what_both_admit():
    """Ridgecrest at 1.3: the horizontal valves are exceeded; with both open its own largest scale is the one stated."""
    plant = plant_named("lhpost6")
    target = make_target(find_motion("ridgecrest"), scale=1.3, rate=float(SAMPLE_RATE))
    with pytest.raises(OutOfRangeError, match="actuator velocity") as caught:
        check_motion_limits(plant, target)
    both = make_plant(load_machine().with_valves(2))
    fits = fitting_scale(both, target)
    words = "With both servovalves of each horizontal actuator open (--valves 2, or horizontal.valves = 2 in an "
    assert f"{words}override) the largest scale is {fits:g}. With the other reading" in str(caught.value)
    assert fits > 1.3 > caught.value.largest_scale
    check_motion_limits(both, target)
    with pytest.raises(OutOfRangeError) as caught:
        check_motion_limits(both, with_scale(target, 2.0 * fits))
    assert "--valves" not in str(caught.value)  # all are open


def test_where_more_valves_mend_nothing_none_are_proposed():
    """The flow of the vertical actuators, which have one servovalve each, and of a machine with no more than it has."""
    target = make_target(find_motion("sine", axis="z", amplitude=0.1, period=0.8), rate=2048.0)
    with pytest.raises(OutOfRangeError, match="actuator velocity") as caught:
        check_motion_limits(plant_named("lhpost6"), target)
    assert "--valves" not in str(caught.value)
    target = make_target(find_motion("sine", axis="x", amplitude=0.1, period=0.3), axes="x", rate=2048.0)
    with pytest.raises(OutOfRangeError, match="actuator velocity") as caught:
        check_motion_limits(plant_named("uniaxial"), target)
    assert "--valves" not in str(caught.value)


def test_the_help_of_valves_states_the_number_in_the_machine_file():
    (help,) = (option.help for option in Valves.__metadata__)
    numbers = {a.valves for a in load_machine().actuators if a.area_b is not None}
    assert numbers == {1} and f"LHPOST6: 1 of {ALL_VALVES}" in help


def test_tilt_of_pistons_and_upward_acceleration_have_limits_of_their_own():
    plant, still = plant_named("lhpost6"), np.zeros((2, 6))
    tilt, up = still.copy(), still.copy()
    tilt[0, 3:5] = np.radians([1.2, 1.2])
    up[:, 2] = [40.0, 10.0]  # beyond 3.6 g, which is downwards; 11.9 g upwards
    peaks = {(p.quantity, p.name): p for p in judge_motion(plant, PlatenMotion(tilt, still, up)).peaks}
    assert peaks["acceleration", "z"].utilisation == pytest.approx(40.0 / (11.9 * G), rel=1e-6)
    expected = np.arccos(np.cos(np.radians(1.2)) ** 2) / np.radians(2.0)
    assert peaks["piston tilt", "platen"].utilisation == pytest.approx(expected, rel=1e-6)
    lifted = 174420.0 * (40.0 + G) / 22.9e6
    assert peaks["platen strength", "z up"].utilisation == pytest.approx(lifted, rel=1e-3)  # tilted by 1.7 deg


# Ends of strokes ------------------------------------------------------------------------------------------------------


def lifted(machine, spool: float, seconds: float = 0.9):
    """A run with all vertical valves open."""
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    samples = int(seconds * SAMPLE_RATE)
    spools = np.tile(rest.spool, (samples, 1))
    spools[:, 4:] = spool
    return simulate(plant, OpenLoop(spools, rest.state), samples=samples, engine="fused")


def test_within_the_stroke_a_bumper_changes_nothing_and_at_its_end_it_acts_before_the_hard_stop(caplog):
    machine = load_machine()
    keys = [f"{kind}.{key}" for kind in ("horizontal", "vertical") for key in ("bumper_stiffness", "bumper_travel")]
    quantities = {path: q for path, q in machine.parameters.quantities.items() if path not in keys}
    without = build_machine(replace(machine.parameters, quantities=quantities))
    with caplog.at_level(logging.WARNING):
        hard, soft = lifted(without, 0.35), lifted(machine, 0.35)
    assert hard.trouble is not None and "left its stroke of +-0.127 m;" in hard.trouble
    n = len(hard.time)
    assert np.array_equal(hard.q[: n - 1], soft.q[: n - 1]) and np.array_equal(hard.z[: n - 1], soft.z[: n - 1])
    assert len(soft.time) > n
    said = run_doubts(soft)
    assert any(doubt.startswith("V1 reached the end of its stroke of 0.127 m at") for doubt in said)
    if soft.trouble is not None:
        assert "through its bumper to the hard stop at 0.1334 m" in soft.trouble


def test_a_measured_motion_beyond_the_stroke_is_evaluated_and_one_beyond_the_chamber_is_not():
    plant = plant_named("lhpost6")
    displacement = np.zeros((4, 6))
    displacement[2, 2] = 0.1285
    still = np.zeros((4, 6))
    path = ports_along(plant, plant_motion(plant, PlatenMotion(displacement, still, still)))
    assert path.s[2, 4:10] == pytest.approx(np.full(6, 0.1285))
    (first, *_) = ends = stroke_ends(plant, np.arange(4) / 512, path.s[:, : plant.spools])
    assert len(ends) == 6 and first.actuator == "V1" and first.time == 2 / 512


# Pressures ------------------------------------------------------------------------------------------------------------


def test_a_chamber_below_zero_is_trouble_and_below_the_return_pressure_a_remark(caplog):
    run = lifted(load_machine(), 0.05, 0.05)
    index = run.plant.state_index("actuators_3_way", "V6", "pressure_a")
    assert with_pressure_trouble(run).trouble is None and run_doubts(run) == []
    low, empty = run.z.copy(), run.z.copy()
    low[30:, index], empty[40:, index] = 0.4e6, -1e4
    (said,) = run_doubts(replace(run, z=low))
    assert said.startswith("chamber A of V6 fell to 0.4 MPa, below the return pressure of 0.55 MPa, first at 0.015 s")
    assert with_pressure_trouble(replace(run, z=low)).trouble is None and not caplog.records
    trouble = with_pressure_trouble(replace(run, z=empty)).trouble
    assert trouble is not None and "at 0.0195 s: chamber A of V6" in trouble and "lose contact" in trouble
    assert 'add the effect "cavitation"' in trouble and trouble in caplog.text
    (said,) = run_doubts(replace(run, z=empty))
    assert said == "chamber A of V6 fell to -0.01 MPa, below zero, first at 0.020 s"


def test_an_empty_chamber_is_stated_before_the_stop_that_follows_it():
    """Valves that open at once throw the platen off its actuators, long before these leave their strokes."""
    run = lifted(load_machine(), 0.35)
    places = [run.plant.state_index("actuators_3_way", f"V{k}", "pressure_a") for k in range(1, 7)]
    empty = (run.z[:, places] < 0.0).any(axis=1)
    trouble = with_pressure_trouble(run).trouble
    assert run.trouble is not None and trouble is not None and trouble.endswith(f"; then: {run.trouble}")
    assert trouble.startswith(f"became unphysical at {run.time[empty.argmax()]:.4f} s: chamber A of V")


def test_a_simulated_test_of_a_campaign_that_is_not_physical_says_so_in_its_record(caplog):
    machine, sensors = load_machine().with_specimen("block_4_9MN", (4.0, 1.5, 0.0)), load_sensors("lhpost6")
    settings = load_controller("cautious")
    for scale, sound in ((0.1, True), (3.0, False)):
        made = simulate_campaign(machine, settings, sensors, seed=0, tests=("WN",), scale=scale)
        trouble = made.records[0].attrs["trouble"]
        assert trouble == "none" if sound else "chamber A of V6 fell below zero pressure" in trouble
    assert any(message.startswith("WN: the run became unphysical at ") for message in caplog.messages)


def test_voids_that_take_too_little_of_the_stiffness_do_not_excuse_a_chamber_below_zero():
    run = lifted(load_machine(), 0.05, 0.05)
    z = run.z.copy()
    place = run.plant.state_index("actuators_3_way", "V6", "pressure_a")
    soft = make_plant(load_machine().with_effect("cavitation", ("V6",)))
    z[40:, place] = -1e4
    trouble = with_pressure_trouble(replace(run, z=z, plant=soft)).trouble
    assert trouble is not None and 'raise "share" of its effect "cavitation"' in trouble
    z[40:, place] = 0.5e5  # the vapour pressure is 0.1 MPa
    kept = replace(run, z=z, plant=soft)
    assert with_pressure_trouble(kept).trouble is None
    (said,) = run_doubts(kept)
    assert said.endswith("its oil cavitates below 0.1 MPa, and V6, which cannot pull, hardly bears on the platen")


def test_a_tall_specimen_is_judged_by_the_moments_that_the_reaction_mass_bears():
    machine = load_machine()
    plant = make_plant(machine)
    # of the bare table they are Table 2.2's accelerations by construction
    strength = stated_strength(machine.parameters)
    for k, most in enumerate(strength.reaction_moment):
        assert most / machine.platen.inertia[k] == pytest.approx(machine.limits.acceleration[3 + k], rel=1e-6)
    tall = make_plant(machine.with_specimen("tall_column"))
    motion = np.zeros((3, 2, 6))
    motion[2, 1, 0] = 5.0  # m/s2 along x

    def demand(one):
        found = MotionDemands(one)(*motion)
        return next(d for d in found if d.quantity == "reaction mass moment")

    bare, loaded = demand(plant), demand(tall)
    assert bare.share[1, 1] < 1e-6
    # the column's inertia force acts at its centre of gravity above B; it is the same force that accelerates it
    inertia = tall.model.inertias[1]
    assert loaded.share[1, 1] == pytest.approx(
        abs(5.0 * inertia.mass * inertia.lever[2]) / strength.reaction_moment[1], rel=0.05
    )


# --------------------------------------------------------------------------------- reserve of the strokes
def test_the_largest_scale_leaves_the_reserve_of_strokes_and_displacements_and_what_is_achieved_may_take_it():
    """Closed form on the guided table: 0.2 m to 98 % of 0.15 m; a motion of 0.149 m is refused, achieved it fits."""
    plant = make_plant(load_machine("uniaxial"))
    target = make_target(find_motion("triangle", amplitude=0.2), rate=2048.0)
    peak = float(np.abs(target.displacement[:, 0]).max())
    with pytest.raises(OutOfRangeError, match=r"x displacement .* against 0\.15 m less the reserve of 2 %") as caught:
        check_motion_limits(plant, target)
    assert caught.value.largest_scale == rounded_down(0.98 * 0.15 / peak, 3) == fitting_scale(plant, target)
    close = with_scale(target, 0.149 / peak)
    with pytest.raises(OutOfRangeError, match=r"A1 actuator stroke .* of its stroke less the reserve of 2 %"):
        check_motion_limits(plant, close)
    motion = PlatenMotion(close.displacement, close.velocity, close.acceleration)
    shares = {p.quantity: p.utilisation for p in judge_motion(plant, motion).peaks if p.decides and p.name in "xA1"}
    assert shares["displacement"] == pytest.approx(0.149 / 0.15) == shares["actuator stroke"]
    bound = table_performance(plant)[0].bound("displacement")
    assert bound.value == pytest.approx(0.98 * 0.15) and bound.by.endswith("less 2 %")


ENDING = [
    pytest.param("uniaxial", "triangle", {"velocity": 0.25, "corner_acceleration": 3.0}, id="TX of a campaign"),
    pytest.param("uniaxial", "triangle", {}, id="triangle"),
    pytest.param("lhpost6", "triangle", {"axis": "z"}, id="triangle z", marks=pytest.mark.long),
    pytest.param("lhpost6", "sine", {"axis": "z", "period": 5.0}, id="sine z", marks=pytest.mark.long),
    pytest.param(
        "lhpost6", "sine", {"axis": "y", "amplitude": 0.4, "period": 1.6}, id="sine y", marks=pytest.mark.long
    ),
]


@pytest.mark.parametrize(("name", "kind", "options"), ENDING)
def test_a_motion_at_the_scale_that_fits_leaves_no_stroke_and_none_of_its_limits(name, kind, options):
    """At the scale to the very stroke A1 left it after 4.9 s (TX), and vertical pistons met their bumpers."""
    machine = load_machine(name)
    plant = make_plant(machine)
    full = make_target(find_motion(kind, **{"amplitude": 0.2, **options}), rate=float(SAMPLE_RATE))
    target = with_scale(full, fitting_scale(plant, full))
    test = rehearse(machine, target, load_controller(machine.controller), attrs={"test": "fits"}, engine="fused")
    assert test.run.trouble is None and len(test.run.time) == len(target.time)
    assert not stroke_ends(plant, test.run.time, test.record["actuator_displacement"].values)
    peaks = judge_record(plant, test.record, fits=False).peaks
    assert max(peak.utilisation for peak in peaks if peak.decides) <= 1.0


OSCILLATOR = """[mass]
mass = {{ value = 201, unit = "t" }}
centre_of_gravity = {{ value = [0, 0, 2.985], unit = "m" }}
inertia = {{ value = [3e4, 3e4, 3e4], unit = "kg m2" }}
[modes]
frequency = {{ value = [{frequency}], unit = "Hz" }}
damping = {{ value = [0.02], unit = "1" }}
participation = {{ value = [[0, 447.2, 0, -1341.6, 0, 0]], unit = "sqrt(kg)" }}
"""


@pytest.mark.parametrize("frequency", [2.0, 30.0], ids=["in resonance", "far above the motion"])
def test_an_achieved_motion_is_judged_with_the_response_of_the_specimen(frequency, tmp_path):
    """200 t at 3 m were taken as locked: 30 % of the reaction mass's strength where the actuators gave 125 % of it."""
    path = tmp_path / "oscillator.toml"
    path.write_text(OSCILLATOR.format(frequency=frequency))
    machine = load_machine().with_specimen(path)
    target = make_target(find_motion("sine", axis="y", amplitude=0.02, period=0.5, cycles=6), rate=float(SAMPLE_RATE))
    test = rehearse(machine, target, load_controller("lhpost6"), attrs={}, engine="fused", beyond_limits=True)
    plant, record = test.run.plant, test.record
    peaks = {(peak.quantity, peak.name): peak.value for peak in judge_record(plant, record, fits=False).peaks}
    ledger = force_ledger(test.run)
    table = [k for k, name in enumerate(ledger.effects) if name not in ("gravity", "specimen_modes")]
    given = np.abs(ledger.wrench[:, table, 1].sum(axis=1)).max()  # of actuators, struts, seals and pads
    assert abs(peaks["reaction mass strength", "y"]) == pytest.approx(given, rel=1e-3)  # the step's error
    locked = {(p.quantity, p.name): p.value for p in judge_record(plant, record.drop_vars("specimen_wrench")).peaks}
    ratio = abs(peaks["reaction mass strength", "y"] / locked["reaction mass strength", "y"])
    assert ratio > 2.0 if frequency == 2.0 else ratio == pytest.approx(1.0, abs=0.02)  # (2 Hz / 30 Hz)^2 = 0.4 %


def test_of_a_rigid_specimen_the_response_is_that_of_its_inertia(tmp_path):
    machine = load_machine().with_specimen(block(tmp_path, z=2.0))
    target = sine("y", 1.0)
    test = rehearse(machine, target, load_controller("lhpost6"), attrs={}, engine="fused")
    one, two = (
        judge_record(test.run.plant, r, fits=False) for r in (test.record, test.record.drop_vars("specimen_wrench"))
    )
    for known, rigid in zip(one.peaks, two.peaks, strict=True):
        assert known.utilisation == pytest.approx(rigid.utilisation, rel=1e-6, abs=1e-9), known.quantity  # rounding
