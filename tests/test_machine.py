"""Machines of any kind from a file: geometry against the report, rest under any load, and a moment of motion."""

import numpy as np
import pytest
from machine_cases import MACHINES, PENDULUM, machine_named, plant_named
from run_cases import at_rest

from lhpost6_pin.core.errors import ParameterError, SimulationError
from lhpost6_pin.core.names import ENGINES, SCHEMES
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.registry import parameters_of
from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.mechanics import kinematics as kin
from lhpost6_pin.mechanics.derivatives import evaluate_derivatives
from lhpost6_pin.mechanics.equilibrium import find_equilibrium, parked_pose, rest_pressures
from lhpost6_pin.mechanics.instant import displacement_of, wrench_at
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.mechanics.schemes import A
from lhpost6_pin.mechanics.workspace import make_workspace
from lhpost6_pin.simulation.running import RunningPlant
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

LHPOST6 = machine_named("lhpost6")
G = 9.80665


def printed(path):
    """A number or vector of the machine file, as the report's tables have it."""
    return np.array(LHPOST6.parameters[path].value)


def point(name):
    """Platen end of a component at rest, in {s} [m]."""
    return np.array(next(c for c in LHPOST6.components if c.name == name).platen_point)


# Geometry that the report's figures held, from its tables -------------------------------------------------------------


def v_angle():
    """Angle between the horizontal actuators and X, from the coordinates [rad]."""
    h1 = LHPOST6.actuators[0]
    along = np.subtract(h1.base_point, h1.platen_point)
    return np.arctan2(along[1], along[0])


def test_v_angle_of_the_coordinates_is_that_of_the_peak_forces_in_table_2_2():
    force = printed("table_2_2.force_actuators")
    # 10.6 MN is printed to 0.5 %, 8.38 to 0.1 %: 0.13 deg
    assert np.degrees(np.arctan2(force[1], force[0])) == pytest.approx(38.33, abs=0.01)
    assert np.degrees(v_angle()) == pytest.approx(38.33, abs=0.13)


def test_v_angle_of_the_coordinates_is_that_of_the_lumped_masses_in_table_4_1():
    x, y, z = printed("estimates.horizontal.mass")
    # four actuators at +-theta: X = 4 (m_across + d cos^2), Y = 4 (m_across + d sin^2), Z = 4 m_across
    angle = 0.5 * np.arccos((x - y) / (x + y - 2.0 * z))
    assert np.degrees(angle) == pytest.approx(38.33, abs=0.01)
    assert np.degrees(v_angle()) == pytest.approx(np.degrees(angle), abs=0.4)  # differences of masses to 10 kg
    h1 = LHPOST6.actuators[0]
    assert h1.mass_across == pytest.approx(z / 4.0)
    assert h1.mass_along == pytest.approx(z / 4.0 + (x + y - 2.0 * z) / 4.0)


def test_peak_horizontal_forces_of_table_2_2_are_both_areas_at_supply_less_return():
    h1 = LHPOST6.actuators[0]
    pressure = 2950 * 6894.757  # 3000 psi less 50 psi of return
    both = 2.0 * (h1.area_a + h1.area_b) * pressure
    # two actuators push, two pull; tables to 3 digits
    found = both * np.array([np.cos(v_angle()), np.sin(v_angle())])
    assert np.allclose(found, printed("table_2_2.force_actuators")[:2], rtol=0.003)


def test_vertical_actuators_stand_where_tables_4_1_and_2_2_put_them():
    mass, inertia = printed("estimates.vertical.mass")[2], printed("estimates.vertical.inertia")
    x, y, _ = np.abs(point("V1"))
    # six at |y|, four at |x|; masses printed to 0.3 %, so distances to 0.15 %
    assert [y, x] == pytest.approx([np.sqrt(inertia[0] / mass), np.sqrt(inertia[1] / mass * 6.0 / 4.0)], rel=0.0015)
    velocity = printed("limits.velocity")  # 0.45 m/s is printed to 1 %
    assert [y, x] == pytest.approx([velocity[2] / velocity[3], velocity[2] / velocity[4]], rel=0.01)
    assert point("V3")[0] == point("V4")[0] == 0.0


def test_swivels_and_struts_stand_where_the_yaw_rate_of_table_2_2_and_the_inertia_of_table_4_1_put_them():
    velocity = printed("limits.velocity")
    lever = velocity[1] / velocity[5]  # 2.0 m/s over 18.79 deg/s
    assert lever == pytest.approx(6.10, abs=0.005)
    assert abs(point("H1")[0]) == pytest.approx(lever, rel=0.025)  # 2.0 is printed to 2.5 %
    mass, inertia = printed("estimates.hold_down.mass"), printed("estimates.hold_down.inertia")
    distance = np.sqrt(inertia[2] / (2.0 / 3.0 * mass[0]))
    assert distance == pytest.approx(4.907, abs=0.001)
    assert point("S1")[0] == -point("S3")[0] == pytest.approx(distance, rel=0.005)  # 4.89 is drawn
    assert point("S2")[0] == 0.0


def test_height_of_b_follows_from_the_roll_inertia_of_swivels_and_struts():
    b = LHPOST6.platen.centre_of_gravity[2]
    mass, inertia = printed("estimates.hold_down.mass"), printed("estimates.hold_down.inertia")
    assert b - np.sqrt(inertia[0] / mass[1]) == pytest.approx(point("S2")[2], abs=0.01)
    mass, inertia = printed("estimates.horizontal.mass"), printed("estimates.horizontal.inertia")
    # I_x = m_y h^2 + m_z y^2 with y = 0.48 m drawn: weak, 0.1 m of B's height
    height = np.sqrt((inertia[0] - mass[2] * point("H1")[1] ** 2) / mass[1])
    assert b - height == pytest.approx(point("H1")[2], abs=0.1)


def test_the_table_is_symmetric_about_both_vertical_planes():
    ends = {tuple(np.round(c.platen_point, 9)) + tuple(np.round(c.base_point, 9)) for c in LHPOST6.components}
    for flip in ([-1, 1, 1], [1, -1, 1]):
        mirrored = {tuple(np.array(e) * [*flip, *flip] + 0.0) for e in ends}
        assert mirrored == {tuple(np.array(e) + 0.0) for e in ends}


def test_order_of_components_is_by_the_signs_of_x_and_y():
    assert LHPOST6.actuator_names == ("H1", "H2", "H3", "H4", "V1", "V2", "V3", "V4", "V5", "V6")
    assert LHPOST6.strut_names == ("S1", "S2", "S3")
    assert LHPOST6.double_acting == ("H1", "H2", "H3", "H4")
    signs = [tuple(np.sign(point(n)[:2])) for n in LHPOST6.actuator_names]
    assert signs[:4] == [(1, 1), (1, -1), (-1, 1), (-1, -1)]
    assert signs[4:] == [(1, 1), (1, -1), (0, 1), (0, -1), (-1, 1), (-1, -1)]
    assert [np.sign(point(n)[0]) for n in LHPOST6.strut_names] == [1, 0, -1]


def test_identified_inertia_is_not_that_of_a_rigid_body_and_is_taken_as_it_is():
    x, y, z = LHPOST6.platen.inertia
    assert x + y < z  # no rigid body can have it (triangle inequality); identified, lumped
    assert make_plant(LHPOST6).model.inertias[1].inertia[2, 2] == z


def test_travel_of_table_2_2_one_axis_at_a_time_is_within_every_stroke():
    zero = kin.inverse_kinematics(LHPOST6, np.zeros(6))
    stroke = np.array([a.stroke for a in LHPOST6.actuators])
    share = []
    for axis in np.diag(LHPOST6.limits.displacement):
        moved = [np.abs(kin.inverse_kinematics(LHPOST6, sign * axis) - zero) / stroke for sign in (1.0, -1.0)]
        share.append(np.max(moved))
    assert max(share) < 1.0 + 1e-12
    assert share[2] == pytest.approx(1.0, abs=1e-12)  # Z is the vertical actuators' stroke
    # X uses what a stroke of +-0.75 m was assumed for: 0.89 m shortens an actuator by its projection and a little more
    assert share[0] * 0.75 == pytest.approx(0.89 * np.cos(v_angle()), abs=0.03)
    # pure tilt: tan(angle) times the actuator's distance from the axis, and a little lift of the plane
    for axis, k in ((3, 1), (4, 0)):
        rise = np.tan(LHPOST6.limits.displacement[axis]) * abs(point("V1")[k])
        assert share[axis] * 0.127 == pytest.approx(rise, abs=0.002)


# Any machine: rest and a few milliseconds -----------------------------------------------------------------------------


def test_rest_of_a_stewart_platform_carries_its_weight_through_the_legs():
    plant, machine = plant_named("stewart"), machine_named("stewart")
    rest = find_equilibrium(plant)
    forces = {
        leg.name: kin.component_force(machine, np.zeros(6), leg, f)
        for leg, f in zip(machine.actuators, rest.force, strict=True)
    }
    assert np.abs(kin.external_wrench(machine, np.zeros(6), forces)).max() < 1e-9  # Eq. 4-30, of 6e4 N
    assert np.all(rest.force > 0.0)


@pytest.mark.parametrize("bodies", ["lumped", "full"])
@pytest.mark.parametrize("pose", [(0, 0, -0.12, 0, 0, 0), (0.3, -0.1, 0.05, 0.01, -0.005, 0.02)])
def test_a_platen_at_rest_in_another_pose_stays_there(bodies, pose):
    """Held by the spools found; the wrench of its actuators on the platen is that of Eq. 4-23 at the pose."""
    plant = make_plant(LHPOST6.with_bodies(bodies))
    rest = find_equilibrium(plant, pose)
    assert displacement_of(rest.pose) == pytest.approx(pose, abs=1e-15)
    at_c = wrench_at(plant, rest.pose, rest.force)
    assert at_c.vector == pytest.approx(rest.wrench.vector, rel=1e-12, abs=1e-6)  # rounding of MN
    table = RunningPlant(plant, rest)
    for _ in range(200):
        table.advance(rest.spool)
    # rounding of 4 MN over 170 t in 0.1 s, of metres, of MN
    assert np.abs(table.state.v).max() < 1e-9 and np.abs(table.state.q - rest.state.q).max() < 1e-9
    assert table.sensors().force == pytest.approx(rest.force, rel=1e-9)


def test_the_zero_position_is_the_pose_without_one_and_poses_that_cannot_be_are_refused():
    plant, guided = plant_named("lhpost6"), plant_named("biaxial")
    for found, same in zip(find_equilibrium(plant).state, find_equilibrium(plant, np.zeros(6)).state, strict=True):
        assert np.array_equal(found, same)
    assert find_equilibrium(guided, (0.05, -0.02, 0, 0, 0, 0)).state.q == pytest.approx([0.05, -0.02], abs=0.0)
    with pytest.raises(SimulationError, match="biaxial cannot move in z; give 0"):
        find_equilibrium(guided, (0, 0, 0.01, 0, 0, 0))
    with pytest.raises(SimulationError, match=r"out of its stroke in pose 0, 0, 0\.3, 0, 0, 0 m, rad"):
        find_equilibrium(plant, (0, 0, 0.3, 0, 0, 0))
    for bad in ((0, 0), np.full(6, np.nan)):
        with pytest.raises(SimulationError, match="six finite numbers"):
            find_equilibrium(plant, bad)


def test_the_parked_pose_is_stated_by_the_machine_that_has_one():
    assert parked_pose(LHPOST6).tolist() == [0.0, 0.0, LHPOST6.platen.parked, 0.0, 0.0, 0.0]
    vertical = next(a for a in LHPOST6.actuators if a.mount == "bearing")
    assert -vertical.stroke < LHPOST6.platen.parked < 0.0
    for name in ("uniaxial", "hexapod"):
        with pytest.raises(ParameterError, match=rf"{name}\.toml.*: platen\.parked is missing"):
            parked_pose(machine_named(name))


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_any_machine_moves_where_its_spools_drive_it_in_both_engines(name, scheme):
    plant, rest = at_rest(machine_named(name))
    spool = np.tile(rest.spool, (32, 1)) + 0.05  # extend everything, for 16 ms
    runs = [
        simulate(plant, OpenLoop(spool, rest.state), samples=32, scheme=scheme, steps_per_second=16384, engine=engine)
        for engine in ENGINES
    ]
    motion = [platen_motion(plant, r.q, r.v, r.a) for r in runs]
    assert all(r.trouble is None for r in runs)
    moved = motion[0].displacement[-1]
    driven = {"uniaxial": [0], "biaxial": [0, 1]}.get(name, [2])
    direction = -1.0 if name == "uniaxial" else 1.0  # its wall is on the +X side
    least = (direction * moved[driven]).min()
    assert least > 1e-5
    # symmetric; points of the six-legged are rounded to 0.1 mm
    assert np.abs(np.delete(moved, driven)).max() < 1e-3 * least
    assert np.allclose(motion[0].displacement, motion[1].displacement, rtol=0.0, atol=1e-9 * least)
    assert np.allclose(runs[0].z, runs[1].z, rtol=1e-9, atol=1e-9)


# A specimen with free joints rides along ------------------------------------------------------------------------------


def test_pendulum_on_a_driven_table_obeys_its_closed_form_at_every_sample():
    plant, rest = at_rest(machine_named("uniaxial").with_specimen(PENDULUM))
    spool = np.tile(rest.spool, (200, 1))
    spool[20:120] += 0.3
    run = simulate(plant, OpenLoop(spool, rest.state), samples=200)
    assert run.trouble is None
    mass, arm, inertia = 500.0, 2.0, 25.0
    sine, cosine = run.q[:, 2], run.q[:, 1]  # a continuous joint
    # about the pivot, whose acceleration is the table's: J theta'' = m L (a_x cos - g sin)
    wanted = mass * arm * (run.a[:, 0] * cosine - G * sine) / (inertia + mass * arm**2)
    assert np.abs(run.a[:, 1]).max() > 0.5
    assert np.allclose(run.a[:, 1], wanted, rtol=0.0, atol=1e-11)
    with pytest.raises(SimulationError, match="free joints"):
        simulate(plant, OpenLoop(spool, rest.state), samples=200, engine="fused")


def test_lhpost6_carries_a_free_pendulum_and_still_rests():
    plant, rest = at_rest(LHPOST6.with_specimen(PENDULUM, (2.0, 1.0, 0.0)))
    held = (LHPOST6.platen.mass[2] + 700.0) * G + sum(s.area * s.pressure for s in LHPOST6.struts)
    assert rest.force[4:].sum() == pytest.approx(held, rel=1e-12)
    assert rest.force[4] > rest.force[9]  # the nearest vertical actuator carries more than the farthest
    run = simulate(plant, OpenLoop(np.tile(rest.spool, (20, 1)), rest.state), samples=20)
    assert np.abs(run.a).max() < 1e-12


# Changed copies -------------------------------------------------------------------------------------------------------


def test_stewart_file_is_a_machine_of_six_swivels_and_nothing_else():
    machine = machine_named("stewart")
    assert len(machine.actuators) == 6 and machine.struts == ()
    assert [e.name for e in machine.effects] == ["actuators_4_way", "seal_friction", "viscous"]
    assert machine.double_acting == machine.actuator_names


MPA = 1e6


def loaded(machine, **pull: float) -> Machine:
    """Pull on platen ports with constant forces [N] or moments [N m]: a gas spring so long that it does not notice."""
    effect = Effect(
        "load",
        "nitrogen_strut",
        tuple(f"platen.{axis}" for axis in pull),
        tuple((force, 1.0, 1e9, 1.0) for force in pull.values()),
        "test",
    )
    return machine.with_effect(effect)


def derivatives(machine) -> tuple[np.ndarray, np.ndarray]:
    """Acceleration (6,) and rates of hidden states in the equilibrium."""
    plant, rest = at_rest(machine)
    ws = make_workspace(plant, rest.state)
    assert evaluate_derivatives(plant, ws, rest.spool) == 0
    return ws.motion[A].copy(), ws.zd.copy()


def test_the_machine_rests_at_the_pressures_and_spools_that_follow_from_its_tables(machine, plant, rest):
    """Zero horizontal force: P_A and P_B are unique, for the same oil must leak through and flow past both orifices."""
    k = [plant.state_index("actuators_4_way", f"H{i}", p) for i in range(1, 5) for p in ("pressure_a", "pressure_b")]
    k += [plant.state_index("actuators_3_way", f"V{i}", "pressure_a") for i in range(1, 7)]
    # four digits are known of each
    np.testing.assert_allclose(rest.state.z[k], [5.504 * MPA, 8.601 * MPA] * 4 + [2.767 * MPA] * 6, atol=500.0)
    np.testing.assert_allclose(rest.spool, [-4.57e-4] * 4 + [1.91e-4] * 6, atol=5e-7)
    np.testing.assert_allclose(rest.force[:4], 0.0, atol=1e-6)  # rounding of 1.4 MN
    assert not np.delete(rest.state.z, k).any()
    weight = machine.platen.mass[2] * machine.platen.gravity  # carried by the vertical actuators with the struts' pull
    pull = sum(s.pressure * s.area for s in machine.struts)
    assert rest.force[4:].sum() == pytest.approx(weight + pull, rel=1e-12)


LOADS = [
    {},
    {"z": 2e6},
    {"z": -3e6, "x": 8e5},
    {"y": -6e5, "yaw": 4e5},
    {"x": 2.2e6},  # two actuators push with 0.7 MN each: equal pressures, nothing leaks
    {"roll": 1e6, "pitch": -2e6, "yaw": -1e6, "x": -3e5, "y": 2e5, "z": 1e6},
]


@pytest.mark.parametrize("load", LOADS)
def test_in_equilibrium_nothing_accelerates_and_no_pressure_drifts(machine, load: dict[str, float]):
    changed = loaded(machine, **load) if load else machine
    acceleration, zd = derivatives(changed)
    assert np.abs(acceleration).max() < 1e-9  # rounding of 10 MN on 170 t
    # rounding of flows near 1e-4 m3/s, times beta / V = 1e10 Pa/m3
    assert np.abs(zd).max() < 1e-3
    plant, rest = at_rest(changed)
    shut = make_workspace(plant, rest.state)
    evaluate_derivatives(plant, shut, np.zeros(plant.spools))
    fed = plant.rows["state"][plant.tables.actuators]
    leaking = np.abs(shut.zd[fed]) > 1e3
    np.testing.assert_array_equal(leaking, rest.spool != 0.0)  # with closed valves the leak shows at once


@pytest.mark.parametrize("force", [-2e6, -3e5, 0.0, 4.6e5, 5e5, 1e6, 1.1e6, 3e6])
def test_a_loaded_actuator_gets_pressures_that_give_its_force(plant, force: float):
    """Between 0.47 and 1.08 MN both chambers carry the same pressure: nothing leaks, the valve stays shut."""
    p = parameters_of(plant.rows[plant.tables.actuators][0])
    (a, b), spool = rest_pressures(p, force, plant.supply)
    assert a * p.area_a - b * p.area_b == pytest.approx(force, abs=1e-6)  # rounding of 1 MN
    assert plant.supply[1] < a < plant.supply[0]
    assert plant.supply[1] < b < plant.supply[0]
    assert spool * (a - b) > 0.0 or spool == a - b == 0.0  # oil comes in on the side that leaks


def test_without_a_leak_the_spools_rest_in_the_middle(machine):
    tight = machine.with_params({"horizontal.leakage": 0.0, "vertical.leakage": 0.0})
    assert not at_rest(tight)[1].spool.any()
    assert np.abs(derivatives(tight)[0]).max() < 1e-9


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ({"z": 6e7}, r"V1 must give .* beyond its supply: 22\.\d MPa, .*; raise hydraulics\.supply_pressure"),
        ({"x": -3e7}, r"H1 must give .* beyond its supply: .*; raise hydraulics\.supply_pressure"),
        ({"x": 3e7}, r"H1 must give -.* beyond its supply: .*; raise hydraulics\.supply_pressure"),
        ({"z": -9e6}, r"V1 must give .* unloads it: .*: raise the pressure of the struts \(hold_down\.pressure\)"),
    ],
)
def test_a_load_beyond_the_supply_is_refused_by_the_actuators_name(machine, load, words):
    """60 MN is more than 20 MPa on six pistons; less than nothing they cannot pull."""
    with pytest.raises(SimulationError, match=words):
        at_rest(loaded(machine, **load))[1]


def test_an_added_effect_stays_when_a_parameter_changes_and_friction_of_zero_has_no_row():
    spring = Effect("cover_plate", "viscous", ("platen.x",), ((1e4,),), "assumed")
    assert LHPOST6.with_effect(spring).with_params(platen__gravity=9.81).added_effects == (spring,)

    def ports(name, **changes):
        machine = LHPOST6.with_params({key.replace("__", "."): value for key, value in changes.items()})
        return {e.name: e.ports for e in machine.effects}.get(name)

    # Table 6.1: the friction of the struts' seals is lumped into the vertical actuators
    assert ports("seal_friction") == LHPOST6.actuator_names
    assert ports("seal_friction", hold_down__seal_friction=1000.0)[-3:] == LHPOST6.strut_names
    assert ports("pad_friction", vertical__pad_friction=0.0) is None


def test_a_machine_is_shown_in_a_line():
    shown = repr(machine_named("lhpost6").with_specimen(PENDULUM))
    assert shown.startswith("Machine('LHPOST6': 10 actuators, 3 struts") and "specimen pendulum" in shown
    assert len(shown) < 200
