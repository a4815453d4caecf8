"""Valves, chambers, leaks, lines and supply against closed forms; what their families mean in a machine."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_cases import DOUBLE, FLOW, SINGLE, SUPPLY, Case
from run_cases import as_measured, at_rest, rms, stirred
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.data.alignment import due_spools
from lhpost6_pin.data.signals import lag
from lhpost6_pin.effects import supply as shared
from lhpost6_pin.effects.evaluate import advance_states
from lhpost6_pin.effects.registry import parameters_of
from lhpost6_pin.identification.residuals import evaluate_residuals
from lhpost6_pin.laws import bulk, chamber, hydraulic, leaks, lines, orifice, play, supply
from lhpost6_pin.laws.spool import dead_zone
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.valve_delay import delayed_spools
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import ClosedLoop, OpenLoop, simulate

pytestmark = pytest.mark.long

base = cache(load_machine)
OPENED = st.floats(-1.0, 1.0)
PRESSURE = st.floats(-1e6, 25e6)


def advanced(p: hydraulic.Hydraulic, opened: float, pressures: tuple, at: float, stroke: float, dt: float) -> tuple:
    """Pressures of an actuator of the report one step on; `opened` is its valve's opening."""
    spool = orifice.spool_for_opening(opened, p.flow_curve)
    valve = hydraulic.valve_flows(p, False, spool, *pressures, *SUPPLY)
    return hydraulic.step_pressures(p, False, valve, pressures, SUPPLY[1], at, stroke, dt)


# ---------------------------------------------------------------------------------------- orifices
def test_the_root_is_exact_above_its_regularisation_and_odd():
    for x in (500.0, 501.0, 2e7):
        root, slope = orifice.signed_root(x, 500.0)
        assert root == math.sqrt(x)
        assert slope == pytest.approx(0.5 / math.sqrt(x), rel=1e-15)
    for x in (1e-3, 100.0, 499.0, 500.0, 1e6):
        plus, minus = orifice.signed_root(x, 500.0), orifice.signed_root(-x, 500.0)
        assert minus == (-plus[0], plus[1])


def test_the_root_and_its_slope_are_continuous_and_the_slope_is_that_of_the_root():
    for x in np.concatenate([np.linspace(-800.0, 800.0, 401), [-500.0, 500.0]]):
        h = 1e-3
        _, slope = orifice.signed_root(x, 500.0)
        above, below = orifice.signed_root(x + h, 500.0), orifice.signed_root(x - h, 500.0)
        # the curvature jumps at the joint by 2.5 / 500 Pa of the slope: h/4 of that in the difference, 2 h in the slope
        assert (above[0] - below[0]) / (2 * h) == pytest.approx(slope, rel=2e-6)
        assert above[1] == pytest.approx(below[1], rel=2e-5)


@given(opened=OPENED, pressure=PRESSURE)
def test_oil_flows_from_high_to_low_pressure_and_the_orifice_dissipates(opened: float, pressure: float):
    flow, slope = orifice.port_flow(opened, 8e-5, 1e-4, *SUPPLY, pressure, 500.0)
    beyond = SUPPLY[0] if opened >= 0.0 else SUPPLY[1]
    assert flow * (beyond - pressure) >= 0.0
    assert slope <= 0.0  # a fuller chamber takes less: the step rule of the chambers stands on it


def test_flow_passes_through_zero_with_the_spool():
    for pressure in (1e6, 10e6, 21e6):
        flows = [orifice.port_flow(x, 8e-5, 1e-4, *SUPPLY, pressure, 500.0)[0] for x in (-1e-9, 0.0, 1e-9)]
        assert flows[1] == 0.0 and max(abs(f) for f in flows) <= 1e-9 * 1e-4 * math.sqrt(25e6)


@given(opened=st.floats(-0.99, 0.99), curve=st.floats(0.5, 2.0))
def test_the_spool_for_an_opening_gives_that_opening_and_beyond_the_full_stroke_asks_for_more(opened, curve):
    spool = orifice.spool_for_opening(opened, curve)
    assert orifice.opening(spool, curve) == pytest.approx(opened, rel=1e-12, abs=1e-16)
    assert orifice.spool_for_opening(0.9999, 1.3) > 1.0 and math.isfinite(orifice.spool_for_opening(-5.0, 1.3))


def _steady_pressures(area_a: float, area_b: float, widths: tuple, force: float, sign: int) -> np.ndarray:
    """Chamber pressures of a slow steady stroke under a force: flows A_1 v and A_2 v, v -> 0 (Eqs. 4-2, 4-5)."""
    w1, w2, w3, w4 = widths
    # drops at the two ports stand as the squares of area over width
    share = (area_a / area_b * (w2 / w1 if sign > 0 else w4 / w3)) ** 2
    near, far = SUPPLY[::sign]
    return np.linalg.solve([[1.0, share], [area_a, -area_b]], [near + share * far, force])


@pytest.mark.parametrize("force", [0.0, 3e5, -2e5])
def test_the_widths_of_eq_4_1_let_pressures_stand_when_the_stroke_reverses(force: float):
    areas = 0.2027, 0.1297
    matched = [_steady_pressures(*areas, orifice.width_ratios(*areas), force, sign) for sign in (1, -1)]
    equal = [_steady_pressures(*areas, (1.0, 1.0, 1.0, 1.0), force, sign) for sign in (1, -1)]
    np.testing.assert_allclose(matched[0], matched[1], rtol=1e-12)  # rounding of a 2 x 2 system
    assert matched[0].sum() == pytest.approx(sum(SUPPLY), rel=1e-12)
    assert np.abs(equal[0] - equal[1]).max() > 1e6
    # and the law says the same: at these pressures both directions keep step with the piston
    w1, w2, w3, w4 = np.array(orifice.width_ratios(*areas)) * 1e-4
    p = DOUBLE._replace(flow_pa=w1, flow_bt=w2, flow_at=w3, flow_pb=w4)
    for spool in (0.4, -0.4):
        q_a, q_b, _, _ = hydraulic.valve_flows(p, False, spool, *matched[0], *SUPPLY)
        assert q_a / areas[0] == pytest.approx(-q_b / areas[1], rel=1e-10)


# ---------------------------------------------------------------------------------------- chambers
@pytest.mark.parametrize("p", [DOUBLE._replace(leakage=0.0, chamber_b=0.8), SINGLE._replace(leakage=0.0)])
def test_a_closed_chamber_follows_the_logarithm_of_its_length(p: hydraulic.Hydraulic):
    def compress(steps: int) -> float:
        pressures, stroke = (5e6, 8e6 if p.area_b else 0.0), -0.1 / steps
        for k in range(steps):
            pressures = advanced(p, 0.0, pressures, k * stroke, stroke, 1e-3)
        exact = 5e6 - 9e8 * math.log(1 - 0.1 / p.chamber_a)
        exact_b = 8e6 - 9e8 * math.log(1 + 0.1 / p.chamber_b) if p.area_b else 0.0
        return float(np.abs(np.subtract(pressures, (exact, exact_b))).max())

    errors = [compress(n) for n in (10, 20, 40)]
    assert errors[0] < 1e6  # of 120 and 365 MPa
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx(4.0, rel=0.05)  # mid-step length: second order


@given(pressure=st.floats(15e6, 20.7e6), dt=st.floats(1e-5, 1e-3))
def test_a_wide_open_valve_brings_a_stalled_chamber_to_supply_and_never_bursts_through(pressure: float, dt: float):
    """Linearised at a drop d, the root moves the pressure by c sqrt(d) / (1 + c / (4 sqrt(d))), c = dt beta k / (L A).

    That is below 2 d, and the drop shrinks, wherever d > (c/4)^2; below, it may overshoot to 0.087 c^2 at most and
    then flutter there: 6 kPa at 2048 steps a second with these numbers. An explicit step would overshoot by c^2 / 4.
    """
    k = 1e-4
    p = SINGLE._replace(flow_pa=k, flow_at=k, leakage=0.0)
    flutter = max(0.087 * (dt * p.bulk_modulus * k / (p.chamber_a * p.area_a)) ** 2, p.root_regularisation)
    for _ in range(100):
        drop = abs(SUPPLY[0] - pressure)
        pressure, _ = advanced(p, 1.0, (pressure, 0.0), 0.0, 0.0, dt)
        assert abs(SUPPLY[0] - pressure) <= max(drop, flutter) * 1.01  # 0.087 is rounded


@pytest.mark.parametrize("kind", ["leakage", "turbulent"])
@given(a=PRESSURE, b=PRESSURE)
def test_the_leak_across_the_piston_leaves_one_chamber_and_enters_the_other(kind: str, a: float, b: float):
    tight = DOUBLE._replace(leakage=0.0)
    valve = (0.1, -0.2, 0.0, 0.0)
    both = (tight, tight._replace(**{kind: 1e-9}))
    tight, leaky = (hydraulic.pressure_rates(p, True, valve, a, b, SUPPLY[1], 0.0, 0.0) for p in both)
    leak_a, leak_b = (
        (more - less) * area * length / 9e8
        for more, less, area, length in zip(leaky, tight, (0.2, 0.13), (0.8, 0.7), strict=True)
    )
    assert leak_a == pytest.approx(-leak_b, abs=1e-15)  # differences of flows near 0.5 m3/s
    assert leak_a * (a - b) <= 1e-15 * abs(a - b)


def test_the_oil_energy_of_a_stiff_chamber_is_half_pressure_squared_over_bulk():
    # V P^2 / (2 beta) (1 + P / (3 beta) + ...)
    assert chamber.chamber_energy(2e6, 0.2, 0.8, 9e8) == pytest.approx(0.16 * 4e12 / 1.8e9, rel=1e-3)
    assert chamber.chamber_energy(0.0, 0.2, 0.8, 9e8) == 0.0


@given(a=st.floats(-1e6, 25e6), b=st.floats(-1e6, 25e6), low=st.floats(0.0, 1e6), side=st.floats(-1.0, 1.0))
def test_every_leak_flows_down_its_pressure(a: float, b: float, low: float, side: float):
    p = DOUBLE._replace(turbulent=3e-7, external=5e-11, external_side=side)
    across, slope, out_a, out_b, slope_a, slope_b = hydraulic.leak_flows(p, True, a, b, low)
    assert across * (a - b) >= 0.0 and slope > 0.0
    assert out_a == pytest.approx(slope_a * (a - low)) and out_b == pytest.approx(slope_b * (b - low))
    assert max(slope_a, slope_b) == 5e-11 and min(slope_a, slope_b) == pytest.approx(5e-11 * (1.0 - abs(side)))
    assert slope_a >= slope_b if side > 0.0 else slope_b >= slope_a  # side 1 is A alone, -1 is B alone


# ---------------------------------------------------------------------------------------------- closed forms
def test_a_turbulent_leak_doubles_with_four_times_the_drop():
    flows = [leaks.turbulent_leak(d, 1e-7, 500.0)[0] for d in (1e6, 4e6, -1e6)]
    assert flows[1] == pytest.approx(2.0 * flows[0], rel=1e-15) and flows[2] == -flows[0]


def test_a_worn_spool_levels_a_chamber_at_half_the_supply():
    into, out, _, _ = leaks.null_leak(0.0, 0.5 * sum(SUPPLY), 1e-6, 0.02, *SUPPLY, 500.0)
    assert into == pytest.approx(out, rel=1e-14)
    e_fold, _, _, _ = leaks.null_leak(0.02, 0.5 * sum(SUPPLY), 1e-6, 0.02, *SUPPLY, 500.0)
    assert e_fold == pytest.approx(into / math.e, rel=1e-14)


def test_bias_and_overlap_shift_the_flow_curve():
    def flow(x: float, modified: bool = True, **fields: float) -> float:
        return hydraulic.valve_flows(DOUBLE._replace(**fields), modified, x, 6e6, 9e6, *SUPPLY)[0]

    def standard(x: float) -> float:
        return flow(x, False)

    for x in (-0.3, -0.004, 0.0, 0.02, 0.5):
        assert flow(x, null_bias=0.01) == pytest.approx(standard(x + 0.01), rel=1e-14)
        beyond = math.copysign(max(abs(x) - 0.005, 0.0), x)
        assert flow(x, overlap=0.005) == pytest.approx(standard(beyond), rel=1e-14, abs=1e-18)
        assert flow(x, curve_error=0.2) == pytest.approx(1.2 * standard(x), rel=1e-14, abs=1e-18)
        one_sided = (1.2 if x > 0.0 else 1.0) * standard(x)
        assert flow(x, curve_error=0.2, curve_side=1.0) == pytest.approx(one_sided, rel=1e-14, abs=1e-18)


def test_edges_of_an_overlap_may_be_rounded():
    """Beyond them the overlap is lost, within them is the flow gain of a clearance, and all of it is passive."""
    slope = derivative_at(0.0, rounding=0.3)
    assert slope == pytest.approx(1.0 - 1.0 / math.hypot(1.0, 0.3), rel=1e-6)  # cubic terms: (h / d)^2
    x = np.linspace(-0.05, 0.05, 2001)
    rounded = np.array([dead_zone(one, 0.005, 0.3) for one in x])
    assert (np.diff(rounded) > 0.0).all()
    np.testing.assert_allclose(rounded, -rounded[::-1], atol=1e-17)
    far = np.abs(x) > 0.04  # what is left of the rounding: r^2 d / (x^2 - d^2) / 2 = 3.6e-6
    np.testing.assert_allclose(rounded[far], (np.abs(x) - 0.005)[far] * np.sign(x)[far], atol=4e-6)
    sharp = [dead_zone(one, 0.005, 1e-9) for one in x]
    np.testing.assert_allclose(sharp, np.sign(x) * np.maximum(np.abs(x) - 0.005, 0.0), atol=1e-11)  # 1e-9 d


def test_rounded_edges_describe_an_overlap_of_another_form():
    """Where x - d tanh(x / d) is left, sharp edges differ most near null: spools at rest were unexplained."""
    x = np.linspace(-0.02, 0.02, 801)
    other = x - 0.005 * np.tanh(x / 0.005)

    def left(numbers: np.ndarray) -> np.ndarray:
        return np.array([dead_zone(one, *numbers) for one in x]) - other

    sharp = least_squares(lambda d: left(np.array([d[0], 0.0])), [0.005], x_scale=0.005).fun
    rounded = least_squares(left, [0.005, 0.3], x_scale=[0.005, 0.3], bounds=(0.0, [0.1, 2.0])).fun
    assert rms(rounded) < 0.4 * rms(sharp) and np.abs(rounded).max() < 0.4 * np.abs(sharp).max()


def derivative_at(x: float, *, rounding: float, step: float = 1e-6) -> float:
    """Of what an overlap of 0.005 leaves, by central differences."""
    return (dead_zone(x + step, 0.005, rounding) - dead_zone(x - step, 0.005, rounding)) / (2.0 * step)


def test_a_dead_volume_is_as_much_more_chamber():
    both, alone = (Case("dead_volume", chamber.DeadVolume(0.02, side), on=DOUBLE).rows[0] for side in (0.0, 1.0))
    p, one_sided = parameters_of(both), parameters_of(alone)
    assert p.chamber_a == pytest.approx(0.8 + 0.02 / 0.2) and p.chamber_b == pytest.approx(0.7 + 0.02 / 0.13)
    assert one_sided.chamber_a == p.chamber_a and one_sided.chamber_b == 0.7
    assert both["modified"] == 0  # no more work than the report's oil


@pytest.mark.parametrize("side", [-1.0, -0.4, 1.0])
def test_one_chamber_alone_has_no_side(side):
    """Else its volume and the side would be one number in two."""
    dead = parameters_of(Case("dead_volume", chamber.DeadVolume(0.02, side), on=SINGLE).rows[0])
    assert dead.chamber_a == pytest.approx(SINGLE.chamber_a + 0.02 / SINGLE.area_a, rel=1e-14)
    leak = parameters_of(Case("external_leakage", leaks.ExternalLeakage(1e-11, side), on=SINGLE).rows[0])
    assert (leak.external, leak.external_side) == (1e-11, 0.0)


def test_a_rod_with_play_runs_ahead_by_all_of_it():
    """From far pulled to far pushed, the slope adds up to the whole play, and the flanks' energy to the work done."""
    assert play.play_travel(2e6, 3e-4, 5e3) - play.play_travel(-2e6, 3e-4, 5e3) == pytest.approx(6e-4, rel=1e-5)
    force = np.linspace(-2e6, 2e6, 400_001)
    slope = np.array([play.play_slope(f, 3e-4, 5e3) for f in force])
    assert np.trapezoid(slope, force) == pytest.approx(6e-4, rel=1e-5)  # 1 - (f_0 / f)^2 / 2 of it, and the sum's error
    half = force >= 0.0
    held = np.trapezoid((force * slope)[half], force[half])
    assert play.play_energy(2e6, 3e-4, 5e3) == pytest.approx(held, rel=1e-5)
    assert play.play_energy(-2e6, 3e-4, 5e3) == play.play_energy(2e6, 3e-4, 5e3)


def test_a_loose_pin_swallows_the_stroke_that_turns_the_force_round():
    """Valve shut: the force goes from pulling to pushing over as much more stroke as the play is."""

    def travel(half_play: float) -> float:
        case = Case("play", play.Play(half_play, 5e3), on=DOUBLE)
        z, step = case.z.copy(), -1e-7  # the rod is pushed in; chamber A's pressure rises
        z[1] = z[0] * DOUBLE.area_a / DOUBLE.area_b + 1e6
        stroke = 0.0
        while hydraulic.force(DOUBLE, z[0], z[1]) < 1.3e5:
            move = np.array([step, 0.0, 0.0])
            advance_states(case.rows, np.array([stroke, 0.0, 0.0]), move, 1e-9, np.zeros(1), case.supply, z)
            stroke += step
        return -stroke

    # from -130 kN to 130 kN: both ends within (f_0 / f)^2 / 2 of half the play
    assert travel(3e-4) - travel(1e-12) == pytest.approx(6e-4, rel=2e-3)


def test_air_compresses_by_its_polytropic_law_beside_the_oil():
    """Volume at a pressure: oil exp(-P/beta), air alpha (P_0/P)^(1/n) of it at first order; dV/dP is the softness."""
    beta, alpha, n = 9e8, 0.02, 1.2
    for p in (2e5, 1e6, 1e7):
        h = 1e-3 * p

        def volume(x: float) -> float:
            return -x / beta + alpha * (bulk.ATMOSPHERE / x) ** (1.0 / n)

        softness = -(volume(p + h) - volume(p - h)) / (2 * h)
        assert 1.0 / bulk.air_modulus(p, beta, alpha, n, 500.0) == pytest.approx(softness, rel=1e-5)  # h^2 terms
    assert bulk.air_modulus(5e6, beta, 0.0, n, 500.0) == pytest.approx(beta, rel=1e-15)


def test_the_enthalpy_without_air_is_that_of_the_report():
    for p in (1e5, 5e6, 2e7):
        mixed = bulk.enthalpy_of(p, 9e8, 0.0, 1.2, 0.0, 0.0, 500.0)
        assert mixed == pytest.approx(chamber.flow_enthalpy(p, 9e8), rel=1e-6)  # it starts at 500 Pa, not at none


@pytest.mark.parametrize("time", [0.0, 1e-4, 0.01, 3.0])
def test_a_filter_follows_a_ramp_exactly(time: float):
    y0, u0, u1, dt = 0.3, 0.1, 0.7, 0.01
    stay, first, last = lines.filter_shares(dt, time)
    assert stay + first + last == pytest.approx(1.0, rel=1e-15)
    rise = (u1 - u0) / dt
    exact = u1 - rise * time + (y0 - u0 + rise * time) * (math.exp(-dt / time) if time else 0.0)
    # shares of slow filters are small differences of numbers near one
    assert stay * y0 + first * u0 + last * u1 == pytest.approx(exact, rel=1e-13 * max(1.0, time / dt))


def test_a_line_answers_as_an_ode_solver_says():
    tau, zeta, fed = 2e-3, 0.3, 0.4

    def right(_: float, y: np.ndarray) -> list[float]:
        return [y[1] / tau, (fed - y[0] - 2 * zeta * y[1]) / tau]

    exact = solve_ivp(right, (0, 5e-3), [0.1, -0.2], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(lines.line_step(0.1, -0.2, fed, 5e-3, tau, zeta), exact, rtol=1e-9)


def test_voids_hold_the_pressure_where_they_open():
    """A chamber drawn out with its valve shut: down to the vapour pressure and hardly further."""

    def lowest(share: float) -> float:
        case = Case("cavitation", bulk.Cavitation(share or 1e-9, 1e5), on=SINGLE)
        z, stroke = case.z.copy(), np.array([0.01 / 400, 0.0, 0.0])
        for k in range(400):
            advance_states(case.rows, k * stroke, stroke, 1e-4, np.zeros(1), case.supply, z)
        return float(z[0])

    assert lowest(0.0) < -1e7  # without voids: 12 MPa less 30 MPa
    assert abs(lowest(0.999) - 1e5) < 7.5e4  # which is the fall of one step without voids


def test_a_supply_without_memory_gives_what_its_flow_leaves_it():
    """T = 0: at every step's end the state is the flow at the drooped pressure."""
    case = Case("supply_droop", supply.SupplyDroop(6e6, 0.0, 1.3), port="supply", on=DOUBLE)
    case.spool[:] = 0.8
    marched = case.march(0.02, 160)
    k = 0.8 * FLOW * orifice.opening(0.8, DOUBLE.flow_curve)
    for z in marched[1:]:
        drop = SUPPLY[0] - z[0]
        y = z[2] / 1.3  # the flow by its weight: y^2 = k^2 (drop - 1.3 6e6 y)
        fall = 1.3 * 6e6
        exact = 0.5 * (-(k**2) * fall + math.sqrt((k**2 * fall) ** 2 + 4 * k**2 * drop))
        assert y == pytest.approx(exact, rel=1e-9)  # three steps of Newton's method
    assert marched[-1, 2] > 0.04


# --------------------------------------------------------------------------------- what they mean
def test_the_record_shows_the_drooped_supply():
    altered = base().with_effect("supply_droop", droop=6e6, time=0.0)
    run = stirred(altered, samples=300)
    plant, z = run.plant, run.z
    flow = [shared.flows_exchanged(plant.rows, x, plant.supply, y)[0] for x, y in zip(run.spool, z[1:], strict=False)]
    shown = record_of_run(run, {"test": "t"})["supply_pressure"].values
    assert max(flow) > 0.3
    np.testing.assert_allclose(shown[1:], plant.supply.pressure - 6e6 * np.array(flow), atol=1.0)  # Newton's method


# ---------------------------------------------------------------------------------------------- command to spool
def test_a_lagging_spool_is_the_mean_of_its_answer_over_each_step():
    """Against the answer to a held command, second by second of its exponentials."""
    rng = np.random.default_rng(2)
    command, time, rate = rng.normal(size=(40, 1)), 3e-3, 2048.0
    path, window, found = np.array([2.5 / rate, time]), np.zeros((4, 1)), []
    command[:3] = 0.0
    for sample in range(40):
        delayed_spools(command, 0, sample, path, rate, window)
        found.append(window[:, 0].copy())
    fine = 64  # a step of 1/8192 s
    held = np.repeat(np.r_[np.zeros(3), command[:, 0]], 4 * fine)[2 * fine :][: 160 * fine]  # 2.5 samples late
    y, exact = 0.0, []
    stay = math.exp(-1.0 / (4 * fine * rate * time))
    for u in held:
        mean = u + (y - u) * (1 - stay) * 4 * fine * rate * time
        y = u + (y - u) * stay
        exact.append(mean)
    # a command that jumps within a step is taken as its mean over it
    np.testing.assert_allclose(np.concatenate(found), np.reshape(exact, (-1, fine)).mean(axis=1), atol=1e-3)


def test_the_lag_of_a_signal_is_that_of_its_differential_equation():
    t = np.arange(4000) / 1000
    w = 2 * np.pi * 3.0
    y = lag(np.sin(w * t)[:, None], 0.02, 1e-3)[:, 0]
    exact = (np.sin(w * t) - w * 0.02 * np.cos(w * t)) / (1 + (w * 0.02) ** 2)
    np.testing.assert_allclose(y[200:-200], exact[200:-200], atol=1e-3)  # its start in a kink has died down


@pytest.mark.parametrize(("family", "numbers"), [("spool_lag", {"time": 3e-3}), ("transport_delay", {"delay": 1e-3})])
def test_spools_are_late_in_a_closed_loop_and_not_again_in_a_replay(family: str, numbers: dict[str, float]):
    altered = base().with_effect(family, ("H1", "H2", "V3"), **numbers)
    plant, rest = at_rest(altered)
    loop = make_controller(plant, rest, load_controller("lhpost6"))
    n = 1500  # more than one chunk of the fused engine
    t = np.arange(n)[:, None] / 2048
    w = 2 * np.pi * 4.0
    wave = np.array([0.02, 0.01, 0.002, 0.0, 0.0, 0.0]) * np.minimum(1.0, 4 * t)
    drive = loop.drive_for(wave * np.sin(w * t), w * wave * np.cos(w * t), -(w**2) * wave * np.sin(w * t))
    fused, step = (simulate(plant, ClosedLoop(loop, drive, rest), samples=n, engine=x) for x in ("fused", "pinocchio"))
    np.testing.assert_allclose(fused.spool, step.spool, atol=1e-10)  # rounding
    record = record_of_run(fused, {"test": "t"})
    command = record["spool_command"].values

    def miss(plant: Plant) -> np.ndarray:
        return np.sqrt(((fused.spool - due_spools(plant, command, 1 / 2048))[50:-50] ** 2).mean(axis=0))

    plain = make_plant(base())
    late = [plant.machine.actuator_names.index(x) for x in ("H1", "H2", "V3")]
    others = [i for i in range(plant.spools) if i not in late]
    assert (miss(plant) < 2e-5).all()  # interpolation, straight between held commands and band-limited
    assert (miss(plain)[late] > 20 * miss(plant)[late]).all()
    np.testing.assert_allclose(miss(plain)[others], miss(plant)[others], rtol=1e-9)  # rounding
    again = simulate(plant, OpenLoop(fused.spool, rest.state), samples=n, engine="fused")
    assert np.abs(again.q - fused.q).max() < 1e-5  # the mean of each sample in place of its steps


def test_servo_and_supply_are_residuals_where_they_were_measured():
    run = stirred(base(), samples=200, steps=4)
    test = as_measured(run)
    found = evaluate_residuals(run.plant, test.with_channels(spool_command=test.channels["spool_position"]))
    assert found.servo.shape == (200, run.plant.spools) and found.supply.shape == (200, 1)
    late = make_plant(base().with_effect("transport_delay", delay=-0.004))  # 5 ms, less 4
    sooner = evaluate_residuals(late, test.with_channels(spool_command=test.channels["spool_position"]), ("servo",))
    assert rms(sooner.servo).max() < 0.3 * rms(found.servo).max()
    assert evaluate_residuals(run.plant, test).servo.shape == (200, 0)


def test_a_valve_cannot_act_ahead_of_its_command():
    twice = base().with_effect("transport_delay", ("H1",), name="a", delay=-0.004)
    with pytest.raises(ParameterError, match=r"b: the valve of H1 would act 0\.003 s ahead"):
        make_plant(twice.with_effect("transport_delay", ("H1",), name="b", delay=-0.004))
