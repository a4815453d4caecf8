"""Generators and notches against transfer functions in continuous time; commands per actuator and servovalve."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from lhpost6_pin.control import filters
from lhpost6_pin.control.filters import (
    MODES,
    drive_for,
    feedback_generator,
    notch_section,
    reference_generator,
    sampled_response,
)
from lhpost6_pin.control.valves import per_actuator, valve_counts, valve_names
from lhpost6_pin.laws.orifice import opening, port_flow
from lhpost6_pin.machine.machine import load_machine

RATE = 2048.0
BAND = np.geomspace(0.01, 33.0, 60)
"""The table's band [Hz], and below it."""

corners = st.floats(0.01, 400.0)


def bessel(order, corner, s):
    b, a = signal.bessel(order, corner, analog=True, norm="mag")
    return np.polyval(b, s) / np.polyval(a, s)


def reference(mode, high, damping, low, s):
    """Xr over d in continuous time."""
    w, w2 = 2 * np.pi * high, 2 * np.pi * low
    if mode == "acceleration":
        return 1 / (s**2 + 2 * damping * w * s + w**2)
    return bessel(3, w2, s) / (s + w) if mode == "velocity" else bessel(4, w2, s)


def run(matrices, inputs):
    """Outputs (n, outputs) of sampled matrices from rest, for inputs (n, ...)."""
    a, b, c, d = matrices
    x, out = np.zeros(len(a)), []
    for u in inputs:
        out.append(c @ x + d @ np.atleast_1d(u) if d.ndim == 2 else c @ x + d * u)
        x = a @ x + (b @ np.atleast_1d(u) if b.ndim == 2 else b * u)
    return np.array(out)


# Reference generator --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
def test_the_sampled_reference_is_the_continuous_one_within_the_tables_band(mode):
    s = 2j * np.pi * BAND
    found = sampled_response(reference_generator(mode, 0.05, 0.7, 200.0, RATE), BAND, RATE)[:, :3, 0]
    wanted = reference(mode, 0.05, 0.7, 200.0, s)[:, None] * s[:, None] ** np.arange(3)
    # a sampled derivative is off by (pi f / rate)^2 / 3, 0.09 % at 33 Hz: up to twice in acceleration, and as much in
    # the low-pass's phase, which is of the order of one radian there
    assert np.allclose(found, wanted, rtol=3e-3, atol=0.0)


@pytest.mark.parametrize("mode", MODES)
def test_jerk_is_the_derivative_of_acceleration_as_far_as_the_low_pass_lets_it(mode):
    s = 2j * np.pi * BAND
    response = sampled_response(reference_generator(mode, 0.05, 0.7, 200.0, RATE), BAND, RATE)[:, :, 0]
    low = 1 / (1 + s / (2 * np.pi * 200.0)) if mode == "acceleration" else 1.0
    # as above, and the corner at 200 Hz is turned by a tenth of the angle per sample
    assert np.allclose(response[:, 3], s * response[:, 2] * low, rtol=6e-3, atol=0.0)


def test_displacement_and_velocity_mode_pass_a_standing_drive_as_their_names_say():
    ones = np.ones(2048)
    # jerk is of the order of (2 pi 200 Hz)^3, 2e9, in the transient: its rounding is left
    still = run(reference_generator("displacement", 0.05, 0.7, 200.0, RATE), ones)[-1]
    assert np.allclose(still, [1, 0, 0, 0], rtol=0.0, atol=1e-5)
    xr, vr, ar, jr = run(reference_generator("velocity", 0.05, 0.7, 200.0, RATE), ones)[-1]
    w = 2 * np.pi * 0.05
    # 1 m/s for a second: the low-pass holds it up for about its delay, 2 ms
    assert xr == pytest.approx((1 - np.exp(-w)) / w, abs=2e-3)
    assert vr == pytest.approx(1 - w * xr) and abs(ar + w * vr) < 1e-9 and abs(jr + w * ar) < 1e-5


@pytest.mark.parametrize("mode", MODES)
def test_the_drive_made_for_a_motion_gives_that_motion_as_reference(mode):
    """Through the high-pass at 0.05 Hz, over ten seconds; late by the low-pass where a mode has one."""
    t = np.arange(10 * 2048) / RATE
    rise = np.clip(t / 2.0, 0.0, 1.0)
    window, w = rise**4 * (35 - 84 * rise + 70 * rise**2 - 20 * rise**3), 2 * np.pi * 0.8
    x = (window * (0.1 * np.sin(w * t) + 0.2))[:, None] * np.ones(6)
    v = np.gradient(x, 1 / RATE, axis=0)
    a = np.gradient(v, 1 / RATE, axis=0)
    drive = drive_for(mode, x, v, a, np.full(6, 0.05), np.full(6, 0.7))
    found = run(reference_generator(mode, 0.05, 0.7, 200.0, RATE), drive[:, 2])[:, 0]
    order = {"acceleration": 0, "velocity": 3, "displacement": 4}[mode]
    late = 0.0
    if order:
        b, den = signal.bessel(order, 2 * np.pi * 200.0, analog=True, norm="mag")
        late = den[-2] / den[-1]  # group delay at 0 Hz
        assert b[-1] == pytest.approx(den[-1])
    # numerical derivatives err by (2 pi f / rate)^2 / 6 of the motion, 1e-6; Bessel delays are flat to more than that
    assert np.allclose(found, np.interp(t - late, t, x[:, 0]), rtol=0.0, atol=2e-5)


# Feedback generator ---------------------------------------------------------------------------------------------------


def feedback(crossover, s):
    """L and H in continuous time."""
    c = 2 * np.pi * crossover
    return (3 * c**2 * s + c**3) / (s + c) ** 3, (s**3 + 3 * c * s**2) / (s + c) ** 3


@pytest.mark.parametrize("crossover", [0.3, 1.0, 5.0])
def test_the_feedback_generator_is_l_of_displacement_and_h_of_acceleration(crossover):
    s = 2j * np.pi * BAND
    low, high = feedback(crossover, s)
    found = sampled_response(feedback_generator(crossover, RATE), BAND, RATE)
    for k in range(3):
        # as for the reference generator; from displacement it matters only far above the crossover, where L is small
        assert np.allclose(found[:, k, 0], s**k * low, rtol=2e-3, atol=0.0)
        assert np.allclose(found[:, k, 1], s ** (k - 2) * high, rtol=2e-3, atol=0.0)


def test_an_offset_of_the_accelerometer_leaves_a_bounded_offset_of_the_displacement():
    """3 as / c^2 at rest: no integrator runs away."""
    inputs = np.tile([0.0, 0.01], (10 * 2048, 1))
    found = run(feedback_generator(1.0, RATE), inputs)[-1]
    assert found[0] == pytest.approx(3 * 0.01 / (2 * np.pi) ** 2, rel=1e-6) and abs(found[1]) < 1e-9


# Notches --------------------------------------------------------------------------------------------------------------


def notch(frequency, bandwidth, depth, at):
    b0, b1, b2, a1, a2 = notch_section(frequency, bandwidth, depth, RATE)
    z = np.exp(-2j * np.pi * np.asarray(at) / RATE)
    return (b0 + b1 * z + b2 * z**2) / (1 + a1 * z + a2 * z**2)


@given(st.floats(1.0, 900.0), st.floats(0.1, 50.0), st.floats(-1.0, 3.0))
def test_a_notch_has_its_depth_at_its_frequency_and_is_one_at_both_ends(frequency, bandwidth, depth):
    assert notch(frequency, bandwidth, depth, frequency) == pytest.approx(1 + depth, abs=1e-7)
    assert np.allclose(notch(frequency, bandwidth, depth, [0.0, RATE / 2]), 1.0, rtol=0.0, atol=1e-7)


def test_a_notch_is_its_continuous_transfer_function_far_below_the_rate():
    s, w0, breadth = 2j * np.pi * BAND, 2 * np.pi * 12.0, 2 * np.pi * 3.0
    wanted = 1 - 0.7 * breadth * s / (s**2 + breadth * s + w0**2)
    # the bilinear transform shifts frequencies by (pi f / rate)^2 / 3, 1e-3 at 33 Hz, and the notch is exact at w0
    assert np.allclose(notch(12.0, 3.0, -0.7, BAND), wanted, rtol=0.0, atol=1e-3)


# Stability ------------------------------------------------------------------------------------------------------------


@given(st.sampled_from(MODES), corners, st.floats(0.1, 2.0), corners)
def test_every_generator_is_stable_whatever_its_corners(mode, high, damping, low):
    for a in (reference_generator(mode, high, damping, low, RATE)[0], feedback_generator(high, RATE)[0]):
        assert np.isfinite(a).all() and np.abs(np.linalg.eigvals(a)).max() < 1.0


@given(st.floats(0.1, 1000.0), st.floats(0.01, 500.0), st.floats(-1.0, 1.0))
def test_every_notch_is_stable(frequency, bandwidth, depth):
    *_, a1, a2 = notch_section(frequency, bandwidth, depth, RATE)
    assert abs(a2) < 1.0 and abs(a1) < 1.0 + a2  # the stability triangle


ONE, TWO = (load_machine().with_valves(valves) for valves in (1, 2))
COUNTS, CURVES = valve_counts(TWO), np.array([a.flow_curve for a in TWO.actuators])
SPOOL = st.floats(-1.0, 1.0)


def test_the_table_has_ten_servovalves_or_fourteen():
    assert valve_names(ONE.actuator_names, valve_counts(ONE)) == ONE.actuator_names
    assert valve_names(TWO.actuator_names, COUNTS) == tuple("H1A H1B H2A H2B H3A H3B H4A H4B V1 V2 V3 V4 V5 V6".split())


@given(st.lists(st.floats(-2.0, 2.0), min_size=10, max_size=10))
def test_commands_of_actuators_come_back_from_their_valves_to_the_last_bit(command):
    valves = np.repeat(command, COUNTS)
    assert len(valves) == 14 and (valves[0:8:2] == valves[1:8:2]).all()
    assert np.array_equal(per_actuator(valves, COUNTS, CURVES), command)


@given(st.tuples(SPOOL, SPOOL), st.sampled_from([1.0, -1.0]), st.floats(1e6, 2e7))
def test_valves_open_to_the_same_side_give_together_the_flow_of_two_at_their_mean_opening(pair, side, chamber):
    commands = np.zeros(14)
    commands[:2] = side * np.abs(pair)
    spool = per_actuator(commands, COUNTS, CURVES)[0]

    def flow(x):
        return port_flow(opening(x, CURVES[0]), 2e-6, 1e-6, 2.1e7, 1e5, chamber, 500.0)[0]

    # two unit openings to rounding, through exp and log: 1e-12 of full flow, 2e-6 sqrt(2e7) m3/s
    assert 2 * flow(spool) == pytest.approx(flow(commands[0]) + flow(commands[1]), rel=1e-9, abs=1e-14)


def test_valves_open_to_opposite_sides_alike_leave_the_actuator_at_rest():
    commands = np.zeros(14)
    commands[2:4] = 0.4, -0.4
    assert per_actuator(commands, COUNTS, CURVES)[1] == pytest.approx(0.0, abs=1e-15)  # one rounding of 0.4


def test_a_valve_driven_beyond_full_stroke_counts_as_fully_open():
    commands = np.zeros(14)
    commands[:2] = 5.0, 0.5
    beyond = per_actuator(commands, COUNTS, CURVES)
    commands[0] = 1.0
    assert np.array_equal(beyond, per_actuator(commands, COUNTS, CURVES))
    assert 0.5 < beyond[0] < 1.0 and not beyond[1:].any()


@pytest.mark.parametrize(("sampling", "method"), [("acceleration", "foh"), ("velocity", "bilinear")])
def test_generators_are_sampled_as_scipy_samples_them(sampling, method, monkeypatch):
    """`scipy.signal.cont2discrete` is the oracle; to rounding of matrices whose largest entries are about 1e4."""
    given = {}

    def oracle(a, b, c, d, rate, found):
        given["method"] = found
        return signal.cont2discrete((a, b, c, d), 1.0 / rate, method=found)[:4]

    arguments = (sampling, 0.05, 0.7, 80.0, 2048.0)
    own = filters.reference_generator.__wrapped__(*arguments)
    monkeypatch.setattr(filters, "_sampled", oracle)
    for one, other in zip(own, filters.reference_generator.__wrapped__(*arguments), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
    assert given["method"] == method
