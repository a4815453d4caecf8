"""Machines of any kind from a file, at rest and driven for a moment; the LHPOST6's geometry against the report."""

import numpy as np
import pytest
from machine_cases import MACHINES, PENDULUM, machine_named, plant_named

from lhpost6_pin.core.errors import ParameterError, SimulationError, UnknownNameError
from lhpost6_pin.core.names import ENGINES, SCHEMES
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics import kinematics as kin
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import platen_motion
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


def test_vertical_actuators_stand_where_table_4_1_puts_them():
    mass, inertia = printed("estimates.vertical.mass")[2], printed("estimates.vertical.inertia")
    # six at |y|, four at |x|; masses printed to 0.3 %, so distances to 0.15 %
    assert abs(point("V1")[1]) == pytest.approx(np.sqrt(inertia[0] / mass), rel=0.0015)
    assert abs(point("V1")[0]) == pytest.approx(np.sqrt(inertia[1] / mass * 6.0 / 4.0), rel=0.0015)
    assert point("V3")[0] == point("V4")[0] == 0.0


def test_vertical_actuators_stand_where_the_angular_velocities_of_table_2_2_put_them():
    velocity = printed("limits.velocity")
    # 0.45 m/s is printed to 1 %
    assert abs(point("V1")[1]) == pytest.approx(velocity[2] / velocity[3], rel=0.01)
    assert abs(point("V1")[0]) == pytest.approx(velocity[2] / velocity[4], rel=0.01)


def test_swivels_lever_is_that_of_the_yaw_rate_in_table_2_2():
    velocity = printed("limits.velocity")
    lever = velocity[1] / velocity[5]  # 2.0 m/s over 18.79 deg/s
    assert lever == pytest.approx(6.10, abs=0.005)
    assert abs(point("H1")[0]) == pytest.approx(lever, rel=0.025)  # 2.0 is printed to 2.5 %


def test_struts_stand_where_the_yaw_inertia_of_table_4_1_puts_them():
    mass, inertia = printed("estimates.hold_down.mass"), printed("estimates.hold_down.inertia")
    distance = np.sqrt(inertia[2] / (2.0 / 3.0 * mass[0]))
    assert distance == pytest.approx(4.907, abs=0.001)
    assert point("S1")[0] == pytest.approx(distance, rel=0.005)  # 4.89 is drawn
    assert point("S2")[0] == 0.0
    assert point("S3")[0] == -point("S1")[0]


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


def test_strokes_in_the_limits_are_within_the_chambers():
    for actuator in LHPOST6.actuators:
        assert actuator.stroke < actuator.chamber_a
        assert actuator.chamber_b is None or actuator.stroke < actuator.chamber_b


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


@pytest.mark.parametrize("name", MACHINES)
def test_any_machine_rests_in_equilibrium_and_stays_there(name):
    plant = plant_named(name)
    rest = find_equilibrium(plant)
    run = simulate(plant, OpenLoop(np.tile(rest.spool, (20, 1)), rest.state), samples=20)
    assert run.trouble is None
    assert np.abs(run.a).max() < 1e-12  # rounding of the forces over tonnes
    assert np.abs(run.q - run.q[0]).max() < 1e-15
    assert np.abs(run.z - run.z[0]).max() < 1e-6  # Pa of 1e7


def test_rest_of_the_lhpost6_is_the_known_one():
    plant = plant_named("lhpost6")
    rest = find_equilibrium(plant)
    z = dict(zip(plant.states, rest.state.z, strict=True))
    for h in ("H1", "H2", "H3", "H4"):  # no horizontal force is needed
        assert z[f"actuators_4_way.{h}.pressure_a"] == pytest.approx(5.504e6, abs=0.5e3)
        assert z[f"actuators_4_way.{h}.pressure_b"] == pytest.approx(8.601e6, abs=0.5e3)
    assert z["actuators_3_way.V1.pressure_a"] == pytest.approx(2.767e6, abs=0.5e3)
    assert np.allclose(rest.spool, [-4.57e-4] * 4 + [1.91e-4] * 6, rtol=0.0, atol=5e-7)
    held = LHPOST6.platen.mass[2] * G + sum(s.area * s.pressure for s in LHPOST6.struts)
    assert rest.force[4:].sum() == pytest.approx(held, rel=1e-12)


def test_rest_of_a_stewart_platform_carries_its_weight_through_the_legs():
    plant, machine = plant_named("stewart"), machine_named("stewart")
    rest = find_equilibrium(plant)
    forces = {
        leg.name: kin.component_force(machine, np.zeros(6), leg, f)
        for leg, f in zip(machine.actuators, rest.force, strict=True)
    }
    assert np.abs(kin.external_wrench(machine, np.zeros(6), forces)).max() < 1e-9  # Eq. 4-30, of 6e4 N
    assert np.all(rest.force > 0.0)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_any_machine_moves_where_its_spools_drive_it_in_both_engines(name, scheme):
    plant = plant_named(name)
    rest = find_equilibrium(plant)
    spool = np.tile(rest.spool, (32, 1)) + 0.05  # extend everything, for 16 ms
    runs = [
        simulate(plant, OpenLoop(spool, rest.state), samples=32, scheme=scheme, steps_per_second=16384, engine=engine)
        for engine in ENGINES
    ]
    motion = [platen_motion(plant, r.q, r.v, r.a) for r in runs]
    assert all(r.trouble is None for r in runs)
    moved = motion[0].displacement[-1]
    up = {"lhpost6": 2, "stewart": 2, "uniaxial": 0}[name]
    direction = -1.0 if name == "uniaxial" else 1.0  # the uniaxial's wall is on the +X side
    assert direction * moved[up] > 1e-5
    others = np.delete(moved, up)
    assert np.abs(others).max() < 1e-3 * abs(moved[up])  # symmetric; the Stewart's points are rounded to 0.1 mm
    assert np.allclose(motion[0].displacement, motion[1].displacement, rtol=0.0, atol=1e-9 * abs(moved[up]))
    assert np.allclose(runs[0].z, runs[1].z, rtol=1e-9, atol=1e-9)


# A specimen with free joints rides along ------------------------------------------------------------------------------


def test_pendulum_on_a_driven_table_obeys_its_closed_form_at_every_sample():
    plant = make_plant(machine_named("uniaxial").with_specimen(PENDULUM))
    rest = find_equilibrium(plant)
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
    plant = make_plant(LHPOST6.with_specimen(PENDULUM, (2.0, 1.0, 0.0)))
    rest = find_equilibrium(plant)
    held = (LHPOST6.platen.mass[2] + 700.0) * G + sum(s.area * s.pressure for s in LHPOST6.struts)
    assert rest.force[4:].sum() == pytest.approx(held, rel=1e-12)
    assert rest.force[4] > rest.force[9]  # the nearest vertical actuator carries more than the farthest
    run = simulate(plant, OpenLoop(np.tile(rest.spool, (20, 1)), rest.state), samples=20)
    assert np.abs(run.a).max() < 1e-12


def test_platen_too_heavy_for_the_supply_is_refused_with_the_actuator_and_a_hint():
    plant = make_plant(machine_named("stewart").with_params(platen__mass=[2e5, 2e5, 2e5]))
    with pytest.raises(SimulationError, match=r"L\d must give .* beyond its supply"):
        find_equilibrium(plant)


# Changed copies -------------------------------------------------------------------------------------------------------


def test_with_effect_adds_one_ledger_entry_and_leaves_the_machine_alone():
    spring = Effect("cover_plate", "viscous", ("platen.x",), ((1e4,),), "assumed")
    changed = LHPOST6.with_effect(spring)
    assert [e.name for e in changed.effects] == [*(e.name for e in LHPOST6.effects), "cover_plate"]
    assert "cover_plate" not in [e.name for e in LHPOST6.effects]
    assert changed.with_params(platen__gravity=9.81).added_effects == (spring,)
    with pytest.raises(ParameterError, match="'cover_plate' is in this machine already"):
        changed.with_effect(spring)


def test_effect_on_a_port_that_is_not_there_lists_those_that_are():
    with pytest.raises(UnknownNameError, match=r"no port named 'platen.w'; did you mean .*'platen.y'"):
        make_plant(LHPOST6.with_effect(Effect("odd", "viscous", ("platen.w",), ((1.0,),), "assumed")))


@pytest.mark.parametrize(
    "law, ports, params, message",
    [
        ("magic", ("H1",), ((1.0,),), "no law named 'magic'"),
        ("viscous", ("H1",), ((1.0, 2.0),), "2 numbers given; viscous takes coefficient"),
        ("viscous", ("H1", "H2"), ((1.0,),), "1 sets of numbers for 2 ports"),
        ("viscous", ("H1",), ((float("nan"),),), "not finite"),
        ("hydraulic", ("V1",), ((1.0,) * 12,), "takes one spool"),
    ],
)
def test_effect_that_cannot_be_is_refused_when_made(law, ports, params, message):
    with pytest.raises((ParameterError, UnknownNameError), match=message):
        Effect("odd", law, ports, params, "assumed")


def test_friction_of_zero_has_no_row_in_the_ledger():
    seals = next(e for e in LHPOST6.effects if e.name == "seal_friction")
    assert seals.ports == LHPOST6.actuator_names  # Table 6.1: the struts' is lumped into the vertical actuators
    more = LHPOST6.with_params({"hold_down.seal_friction": 1000.0})
    assert next(e for e in more.effects if e.name == "seal_friction").ports[-3:] == LHPOST6.strut_names
    none = LHPOST6.with_params({"vertical.pad_friction": 0.0})
    assert "pad_friction" not in [e.name for e in none.effects]


def test_machine_that_is_not_shipped_is_refused_with_the_list():
    with pytest.raises(
        UnknownNameError, match=r"no machine named 'lhpost7'; did you mean 'lhpost6'. valid names: lhpost6"
    ):
        load_machine("lhpost7")


def test_stewart_file_is_a_machine_of_six_swivels_and_nothing_else():
    machine = machine_named("stewart")
    assert len(machine.actuators) == 6
    assert machine.struts == ()
    assert [e.name for e in machine.effects] == ["actuators_4_way", "seal_friction", "viscous"]
    assert machine.double_acting == machine.actuator_names
