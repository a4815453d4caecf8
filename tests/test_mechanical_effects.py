"""Friction, springs, gas and flexibility against closed forms; what their families mean in a machine."""

import math
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from law_cases import CASES, GAS, Case, s_at, sd_at
from machine_cases import frame_array, machine_named, random_poses
from run_cases import at_rest, measured_of, shaken
from scipy.integrate import solve_ivp

from lhpost6_pin.effects.evaluate import advance_states
from lhpost6_pin.identification.inverse_dynamics import inverse_dynamics
from lhpost6_pin.laws import backlash, ball, bouc_wen, gas_heat, gas_leak, nitrogen_strut, oscillator, tabulated
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.port_names import SWIVEL_TURNS, port_names
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.ports import evaluate_ports
from lhpost6_pin.mechanics.pose import kinematic_jacobian
from lhpost6_pin.mechanics.rigid_body import platen_inertia
from lhpost6_pin.simulation.ledger import force_ledger

pytestmark = pytest.mark.long

base = cache(load_machine)


# --------------------------------------------------------------------------------------------- friction
in_disc = st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 2 * math.pi)).map(
    lambda polar: polar[0] * np.array([math.cos(polar[1]), math.sin(polar[1])])
)
slips, far = st.floats(-5.0, 5.0), st.floats(-30.0, 30.0)
shapes = st.floats(0.0, 0.5)


def test_rounding_across_the_slip_does_not_hold_it_up():
    """A single-axis motion leaves Z and slips of rounding size, of either sign, across it."""
    rng = np.random.default_rng(3)
    for _ in range(20000):
        along, z_x = rng.normal(), rng.uniform(-0.9, 0.9)
        across, z_y = -(10 ** rng.uniform(-20, 0)), 10 ** rng.uniform(-320, -14)
        reached = bouc_wen.advance_planar(along, across, z_x, z_y, 1.0, 0.1)
        # Z may differ as it did at the start, and at most e-fold more
        np.testing.assert_allclose(reached, bouc_wen.advance_planar(along, across, z_x, 0.0, 1.0, 0.1), atol=1e-12)


@given(dx=far, angle=st.floats(0.0, 6.2))
def test_loading_from_rest_in_any_direction_pulls_against_the_slip(dx: float, angle: float):
    """From rest both products are positive all the way, where the law does not know its axes."""
    z = bouc_wen.advance_planar(dx * math.cos(angle), dx * math.sin(angle), 0.0, 0.0, 1.0, 0.3)
    np.testing.assert_allclose(z, math.tanh(dx) * np.array([math.cos(angle), math.sin(angle)]), atol=1e-13)
    assert bouc_wen.advance_along(dx, 0.0, 1.0, 0.1) == pytest.approx(math.tanh(dx), abs=1e-14)
    assert bouc_wen.friction_force(9250.0, z[0]) == pytest.approx(-9250.0 * z[0], rel=1e-12)  # against the slip


@settings(deadline=None, max_examples=60)
@given(dx=slips, dy=slips, z=in_disc, shape=shapes, share=st.floats(0.0, 1.0))
def test_a_straight_slip_is_advanced_as_an_ode_solver_does_in_one_piece_and_in_two(dx, dy, z, shape, share):
    """Slips in yield displacements, any signs."""

    def right(_: float, z: np.ndarray) -> tuple[float, float]:
        return bouc_wen.planar_rates(dx, dy, z[0], z[1], 1.0, shape)

    exact = solve_ivp(right, (0.0, 1.0), z, max_step=0.01, rtol=1e-12, atol=1e-12, method="DOP853").y[:, -1]
    found = bouc_wen.advance_planar(dx, dy, *z, 1.0, shape)
    # the solver's own error where the rate has kinks (a product v Z changes sign)
    np.testing.assert_allclose(found, exact, atol=1e-7)
    half = bouc_wen.advance_planar(share * dx, share * dy, *z, 1.0, shape)
    twice = bouc_wen.advance_planar((1 - share) * dx, (1 - share) * dy, *half, 1.0, shape)
    np.testing.assert_allclose(twice, found, atol=1e-10)  # each crossing of a zero is found to rounding of the slip


@settings(deadline=None, max_examples=300)
@given(dx=st.floats(-1e4, 1e4), dy=st.floats(-1e4, 1e4), z=in_disc, shape=st.floats(0.0, 1.0))
def test_the_state_stays_in_the_unit_disc_and_one_dimension_is_two_with_nothing_across(dx, dy, z, shape):
    assert math.hypot(*bouc_wen.advance_planar(dx, dy, *z, 1.0, shape)) <= 1.0 + 1e-9  # rounding of long exponentials
    z_x, z_y = bouc_wen.advance_planar(1e-3 * dx, 0.0, z[0], 0.0, 1.0, shape)
    along = bouc_wen.advance_along(1e-3 * dx, z[0], 1.0, shape)
    assert along == pytest.approx(z_x, abs=1e-13) and z_y == 0.0  # tanh against exponentials


@settings(deadline=None, max_examples=100)
@given(corners=st.lists(st.tuples(slips, slips), min_size=2, max_size=5), shape=shapes, two=st.booleans())
def test_from_rest_friction_never_gives_energy_back(corners: list, shape: float, two: bool):
    """Z.v = d/dt(Y |Z|^2 / 2) + H |Z|^2, H >= 0 for shapes up to 1/2: work on the law is at least Y |Z|^2 / 2."""
    z, at, work = np.zeros(2), np.zeros(2), 0.0
    pieces = 200
    for corner in [*corners, (0.0, 0.0)]:  # back where it began: a closed loop
        target = np.array(corner) * [1.0, float(two)]
        step = (target - at) / pieces
        for _ in range(pieces):
            after = np.array(bouc_wen.advance_planar(*step, *z, 1.0, shape))
            work += 0.5 * (z + after) @ step
            z = after
        at = target
    path_error = 1e-3 * len(corners) * 5  # trapezoid: step^2 / 12 times the curvature of Z, per corner
    assert work >= 0.5 * z @ z - path_error


RUB = ball.Ball(9e3, 2e-4, 0.1)


def test_friction_of_another_form_in_full_is_dahl_s_alone():
    """The report's and what takes its place add up to -F d."""
    instead = next(c for c in CASES if c.law == "dahl_instead")
    z = instead.march(0.3, 600)[-1]
    rubs = Case("bouc_wen_2d", bouc_wen.Friction(*instead.p[:3]))
    both = sum(case.forces(s_at(0.3), sd_at(0.3), z)[1] for case in (instead, rubs))
    np.testing.assert_allclose(both[1:], -9e3 * z[2:], rtol=1e-12)


def test_a_ball_about_one_axis_is_a_seal_and_slides_as_coulomb_says():
    for d in (1e-4, -3e-4):
        along = bouc_wen.advance_along(d, 0.4, 2e-4, 0.1)
        assert ball.advance(RUB, 0.0, d, 0.0, 0.0, 0.4, 0.0)[1] == pytest.approx(along, rel=1e-12)
    axis = np.array([2.0, -1.0, 0.5]) / np.linalg.norm([2.0, -1.0, 0.5])
    np.testing.assert_allclose(ball.advance(RUB, *(5e-3 * axis), 0.3, 0.8, -0.1), axis, atol=1e-9)


def test_a_table_is_a_straight_line_between_its_values_and_flat_beyond_them():
    values = np.array([1.0, 4.0, -2.0])
    x = np.array([-5.0, -1.0, -0.5, 0.0, 0.25, 1.0, 7.0])
    expected = -np.interp(x, [-1.0, 0.0, 1.0], values)
    for force in (tabulated.table_force, tabulated.table_force.py_func):
        np.testing.assert_allclose([force(y, -1.0, 1.0, values) for y in x], expected, atol=1e-15)


def test_backlash_crosses_its_gap_without_force_after_each_reversal():
    p = backlash.Backlash(friction=1e4, yield_slip=2e-4, gap=1e-3)
    e, step, force = p.gap + p.yield_slip, -1e-5, []
    for _ in range(400):
        e = backlash.advance(p, step, e)
        force.append(backlash.force(p, e))
    path = -step * np.arange(1, 401)
    free = (path > p.yield_slip * 1.001) & (path < p.yield_slip + 2 * p.gap - 1e-8)
    assert np.abs(np.array(force)[free]).max() == 0.0
    assert force[-1] == pytest.approx(p.friction)
    assert e == pytest.approx(-p.gap - p.yield_slip)


# ----------------------------------------------------------------------------- springs, gas and viscosity
@pytest.mark.parametrize("damping", [0.0, 0.03, 0.3])
def test_a_shaken_oscillator_answers_as_its_transfer_function(damping: float):
    """X/B = (w^2 + 2 d w s) / (s^2 + 2 d w s + w^2), after what the start leaves has died down."""
    w, drive, dt = 60.0, 35.0, 1e-4
    p, e, v = oscillator.Oscillator(1.0, w, damping, 0.0, 0.0, 0.0), 0.0, 0.0
    steps = 200_000 if damping else 3000
    trace = np.zeros(steps)
    for k in range(steps):
        slip = 1e-3 * (math.sin(drive * (k + 1) * dt) - math.sin(drive * k * dt))
        e, v = oscillator.advance(p, slip, 0.0, 0.0, dt, e, v)
        trace[k] = e
    t = dt * np.arange(1, steps + 1)
    if damping:
        s = 1j * drive
        answer = 1e-3 * ((w * w + 2 * damping * w * s) / (s * s + 2 * damping * w * s + w * w) - 1.0)
        expected = (answer * np.exp(s * t)).imag[-2000:]
        trace = trace[-2000:]
    else:  # from rest, without damping: e'' + w^2 e = drive^2 b, and the mass stands still at first
        r = drive / w
        b = 1e-3 * r * r / (1 - r * r)
        expected = b * np.sin(drive * t) - (b * drive + 1e-3 * drive) / w * np.sin(w * t)
    np.testing.assert_allclose(trace, expected, atol=2e-8)  # second order: (w dt)^2 / 12 of a few millimetres


def held_force(case: Case, s: np.ndarray, z: np.ndarray) -> float:
    """Force of a strut with what changes its gas [N]."""
    return case.forces(s, np.zeros(3), z)[0][0] + nitrogen_strut.force(nitrogen_strut.Gas(*GAS), s[0])


def test_slow_strokes_of_a_gas_with_heat_are_isothermal_and_fast_ones_polytropic():
    steps = 2000
    for duration, index in ((1e3, 1.0), (1e-3, GAS[3])):
        case, z = Case("gas_heat", gas_heat.GasHeat(1.0, *GAS, 0.5)), np.zeros(1)
        for k in range(steps):
            s, stroke = np.full((2, 3), [[0.3 * k / steps], [0.3 / steps]])
            advance_states(case.rows, s, stroke, duration / steps, case.spool, case.supply, z)
        expected = nitrogen_strut.force(nitrogen_strut.Gas(*GAS[:3], index), 0.3)
        # what is left of the way: T / duration, or duration / T
        assert held_force(case, np.full(3, 0.3), z) == pytest.approx(expected, rel=2e-3)


def test_a_leaking_strut_loses_pressure_as_an_exponential():
    case, z = Case("gas_leak", gas_leak.GasLeak(0.2, *GAS, 0.05)), np.zeros(1)
    for _ in range(100):
        advance_states(case.rows, np.zeros(3), np.zeros(3), 0.03, case.spool, case.supply, z)
    expected = -15e6 * 0.15 * math.exp(-0.05 - 0.2 * 3.0)
    assert held_force(case, np.zeros(3), z) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("index", [1.0, 1.0 + 1e-10, 1.001, 1.4, 1.75])
def test_the_strut_pulls_down_the_slope_of_its_potential(index: float):
    p, h = nitrogen_strut.Gas(15e6, 0.15, 1.96, index), 1e-5
    for x in (-0.3, 0.0, 0.127, 0.5):
        slope = (nitrogen_strut.potential(p, x + h) - nitrogen_strut.potential(p, x - h)) / (2 * h)
        # rounding of the energy over h; near n = 1 also of 1/(n - 1)
        assert nitrogen_strut.force(p, x) == pytest.approx(-slope, rel=1e-6)
    assert nitrogen_strut.potential(p, 0.0) == 0.0


def test_an_isothermal_strut_halves_its_pull_at_twice_the_gas_length():
    isothermal = nitrogen_strut.Gas(15e6, 0.15, 2.0, 1.0)
    assert nitrogen_strut.force(isothermal, 2.0) == pytest.approx(-0.5 * 15e6 * 0.15, rel=1e-15)


# ------------------------------------------------------------------------------------ what they mean
def test_the_whole_share_of_thrust_is_the_machine_with_normal_thrust():
    turned = base().with_effect("bearing_thrust_direction", share=1.0)
    normal = base().with_params({"machine.thrust": "normal"})
    np.testing.assert_array_equal(make_plant(turned).legs, make_plant(normal).legs)
    back = normal.with_effect("bearing_thrust_direction", share=1.0)
    np.testing.assert_array_equal(make_plant(back).legs, make_plant(base()).legs)


def test_a_gravity_offset_is_a_weight_at_a_point_and_no_inertia():
    m, x, y = 1500.0, 2.0, -1.0
    machine = base().with_effect("gravity_offset", mass=m, moment_x=m * x, moment_y=m * y, name="extra")
    ledger = force_ledger(shaken(machine, samples=20))
    expected = np.concatenate([[0, 0, -m * 9.80665], np.cross([x, y, 0.0], [0, 0, -m * 9.80665])])
    np.testing.assert_allclose(ledger.wrench[:, ledger.effect("extra")], np.tile(expected, (20, 1)), atol=1e-7)
    assert make_plant(machine).model.inertias[1].isApprox(make_plant(base()).model.inertias[1])


def test_an_added_mass_is_the_same_as_a_point_mass_of_pinocchio():
    m, at = 2e4, np.array([1.0, -2.0, 3.0])
    moments = {f"moment_{axis}": m * r for axis, r in zip("xyz", at, strict=True)}
    machine = base().with_effect("added_mass", mass=m, **moments)
    lever = at - np.array(machine.platen.centre_of_gravity)
    platen, whole = (platen_inertia(make_plant(x).model, x)[0] for x in (base(), machine))
    np.testing.assert_allclose(whole - platen, pin.Inertia(m, lever, np.zeros((3, 3))).matrix(), rtol=3e-9, atol=1e-8)
    rest = at_rest(machine)[1].force.sum() - at_rest(base())[1].force.sum()
    assert rest == pytest.approx(m * 9.80665, rel=1e-9)  # the vertical actuators hold it; the others give nothing


def test_coupling_of_inertia_is_what_its_names_say():
    machine = base().with_effect(
        "inertia_coupling", first_x=1e3, first_y=2e3, first_z=3e3, product_xy=4e3, product_xz=5e3, product_yz=6e3
    )
    platen, whole = (platen_inertia(make_plant(x).model, x)[0] for x in (base(), machine))
    first = pin.skew(np.array([1e3, 2e3, 3e3]))
    products = np.array([[0, 4e3, 5e3], [4e3, 0, 6e3], [5e3, 6e3, 0]])
    np.testing.assert_allclose(whole - platen, np.block([[np.zeros((3, 3)), -first], [first, products]]), atol=1e-6)


def test_a_specimen_weighs_on_the_actuators_and_a_structure_does_not():
    families = ("specimen_resonance", "structural_flexibility")
    changed = [base(), *(base().with_effect(f, ("platen.x",), mass=8e3) for f in families)]
    held, specimen, structure = (at_rest(machine)[1].force.sum() for machine in changed)
    assert specimen - held == pytest.approx(8e3 * 9.80665, rel=1e-9) and structure == held


def test_friction_under_load_grows_with_the_load_whatever_its_sensor_shows():
    machine = base().with_effect("load_dependent_friction", ("H1",), coefficient=0.01)
    plant, measured = make_plant(machine), measured_of(shaken(machine, samples=300))
    load = measured.channels["actuator_force"]
    wrong = load + leg_pattern(plant, load)
    for shown in (load, wrong):
        found = inverse_dynamics(plant, measured.dt * np.arange(300), measured.motion, shown, model_step=True)
        ledger = found.ledger
        seal = ledger.force[:, ledger.row("seal_friction.H1")] / -machine.actuators[0].seal_friction
        expected = -0.01 * np.abs(load[:, 0]) * seal
        of_load = ledger.force[:, ledger.row("load_dependent_friction.H1")]
        # the kinematic Jacobian is that of the zero-position: the platen tilts and travels by less than a hundredth
        np.testing.assert_allclose(of_load, expected, atol=1e-2 * np.abs(expected).max())


def leg_pattern(plant: Plant, load: np.ndarray) -> np.ndarray:
    """An error of the force sensors (n, n_actuators) that the platen's balance shows: a fifth of the wrench."""
    jacobian = kinematic_jacobian(plant)
    return 0.2 * (load - load[0]) @ jacobian @ np.linalg.pinv(jacobian)


# --------------------------------------------------------------------------------------------- swivels
@pytest.mark.parametrize("name", ["lhpost6", "stewart"])
def test_swivels_turn_as_the_rod_does(name: str):
    """Rates of a unit vector along the rod, by differences, and the moment of a force across it."""
    machine = machine_named(name)
    plant, names = make_plant(machine), port_names(machine.actuators, machine.struts)
    h = 1e-6
    rng = np.random.default_rng(3)
    for pose in random_poses(machine, 8):
        frame = frame_array(machine, pose)
        placement = pin.SE3(frame[:3], frame[3])
        twist = rng.uniform(-1.0, 1.0, 6)
        s, J, B = np.zeros(len(names)), np.zeros((len(names), 6)), np.zeros((len(names), 6))
        evaluate_ports(frame, plant.legs, plant.body, s, J, B)
        np.testing.assert_array_equal(J[-5:], B[-5:])
        for leg, component in zip(plant.legs, machine.components, strict=True):
            if leg["swivel"] < 0:
                continue

            ends = [(placement * pin.exp6(pin.Motion(step * twist))).act(leg["rho"]) for step in (0.0, h, -h)]
            u, after, before = ((e - leg["base_point"]) / np.linalg.norm(e - leg["base_point"]) for e in ends)
            turn = np.cross(u, (after - before) / (2 * h))  # of the rod, across itself
            platen = frame[:3] @ twist[3:]
            first = np.cross([0, 0, 1], u)
            first /= np.linalg.norm(first)
            axes = np.array([first, np.cross(u, first)])
            k = names.index(f"{component.name}.base_1")
            assert k == leg["swivel"]
            np.testing.assert_allclose(J[k : k + 2] @ twist, axes @ turn, atol=1e-8)  # rounding over h
            np.testing.assert_allclose(J[k + 2 : k + 4] @ twist, axes @ (platen - turn), atol=1e-8)
            assert J[k + 4] @ twist == pytest.approx(u @ platen, abs=1e-12)


def test_swivel_friction_takes_the_moments_of_both_ends_from_the_platen():
    """All slides: moments T against rod and platen, the rod's passed on as a lateral force at the platen's swivel."""
    machine = base().with_effect("swivel_friction", ("H1",), moment=1e4, yield_turn=1e-5, name="extra")
    run = shaken(machine, samples=400)
    ledger, plant = force_ledger(run), run.plant
    force = [ledger.force[:, ledger.row(f"extra.H1.{end}")] for end in SWIVEL_TURNS]
    for end in (force[:2], force[2:]):
        moment = np.linalg.norm(end, axis=0)
        assert moment.max() <= 1e4 * (1.0 + 1e-12)
        assert (moment > 0.999 * 1e4).mean() > 0.5
    leg = machine.actuators[0]
    for k in (150, 399):
        turn = pin.Quaternion(run.q[k, 3:7]).toRotationMatrix()
        at_c = run.q[k, :3] - turn @ np.array(machine.platen.centre_of_gravity)
        lever = turn @ np.array(leg.platen_point)
        rod = at_c + lever - np.array(leg.base_point)
        length = np.linalg.norm(rod)
        u = rod / length
        first = np.cross([0, 0, 1], u) / np.linalg.norm(np.cross([0, 0, 1], u))
        axes = np.array([first, np.cross(u, first)])
        base_moment, tip_moment = (force[i][k] * axes[0] + force[i + 1][k] * axes[1] for i in (0, 2))
        tip_moment += force[4][k] * u
        # the rod balances: moments on it are the base's and the reaction of the tip's, a lateral couple the rest
        lateral = np.cross(base_moment - tip_moment, u) / length
        expected = np.concatenate([lateral, tip_moment + np.cross(lever, lateral)])
        np.testing.assert_allclose(ledger.wrench[k, ledger.effect("extra")], expected, atol=1e-6)
    assert plant.ports[-1].endswith("tip_3")
    assert not any(port.endswith("tip_3") for port in make_plant(base()).ports)
