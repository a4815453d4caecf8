"""Targets: derivatives, resampling, rest at both ends, refusal of what does not fit; and response spectra."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.core.errors import MotionError, OutOfRangeError
from lhpost6_pin.motions import (
    AXES,
    Demand,
    GroundMotion,
    MotionLimits,
    check_limits,
    find_motion,
    largest_scale,
    make_motion,
    make_target,
    response_spectrum,
    with_scale,
)
from lhpost6_pin.motions.limits import _round_down

RATE = 2048.0
WIDE = MotionLimits(np.full(6, 1e6), np.full(6, 1e6), np.full(6, 1e6))
# eighth-order central difference: its error at 33 Hz is (w dt)^8 / 630 = 2e-11
STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


def derivative(samples: np.ndarray) -> np.ndarray:
    return np.stack([np.correlate(column, STENCIL, mode="valid") for column in samples.T], axis=1) * RATE


def pulse(step: float, frequency: float = 5.0, duration: float = 10.0):
    """Acceleration of a smooth burst and its exact displacement, as functions of time."""
    middle, spread = duration / 2, duration / 14

    def displacement(time):
        s = time - middle
        return np.exp(-0.5 * (s / spread) ** 2) * np.sin(2 * np.pi * frequency * s)

    def acceleration(time):
        s = time - middle
        w = 2 * np.pi * frequency
        wave = np.exp(-0.5 * (s / spread) ** 2 + 1j * w * s)
        return (((-s / spread**2 + 1j * w) ** 2 - 1 / spread**2) * wave).imag

    time = np.arange(round(duration / step) + 1) * step
    return time, displacement, acceleration


@pytest.mark.parametrize("name", ["ridgecrest", "ridgecrest-clc", "tx5", "sxh1", "sfu-like"])
def test_velocity_and_acceleration_are_the_derivatives_of_the_displacement(name):
    target = make_target(find_motion(name))
    inside = slice(4, -4)
    for integral, rate in ((target.displacement, target.velocity), (target.velocity, target.acceleration)):
        # the rest window's third derivative jumps where the pad ends, which costs the stencil a few 1e-6
        error = np.abs(derivative(integral) - rate[inside]).max(axis=0)
        assert (error <= 1e-5 * np.abs(rate).max(axis=0)).all()


@pytest.mark.parametrize("name", ["ridgecrest", "ac156", "tz4", "white-noise"])
def test_a_target_starts_and_ends_at_rest_in_the_zero_position(name):
    target = make_target(find_motion(name))
    for quantity in (target.displacement, target.velocity, target.acceleration):
        assert not quantity[[0, -1]].any()
    assert target.time[0] == 0 and target.time_step == 1 / RATE


@pytest.mark.parametrize("step", [0.005, 0.01, 0.0024, 1 / 256, 1 / 2048, 0.02 / 3])
def test_resampling_to_the_control_rate_is_exact_for_a_band_limited_motion(step):
    time, displacement, acceleration = pulse(step)
    motion = make_motion("pulse", step, {"y": acceleration(time)}, "acceleration", "closed form")
    # corners far from 5 Hz: gain there is 1 - (0.02/5)^4 - (500/5)^-8 = 1 - 3e-10
    target = make_target(motion, high_pass=0.02, low_pass=500)
    clock = target.time + target.reference.start
    # the burst's spectrum at 25 Hz, the nearest Nyquist frequency, and its ends are below 1e-9 of the peak
    for found, exact in ((target.displacement, displacement), (target.acceleration, acceleration)):
        wanted = exact(clock)
        np.testing.assert_allclose(found[:, 1], wanted, atol=2e-8 * np.abs(wanted).max())
    assert not target.displacement[:, [0, 2, 3, 4, 5]].any()


def test_a_displacement_motion_is_differentiated_exactly():
    time, displacement, acceleration = pulse(1 / RATE)
    motion = make_motion("pulse", 1 / RATE, {"x": displacement(time)}, "displacement", "closed form")
    target = make_target(motion, low_pass=900)
    wanted = acceleration(target.time + target.reference.start)
    # gain at 5 Hz is 1 - (5/900)^8; the burst's ends are 2e-11 of its peak
    np.testing.assert_allclose(target.acceleration[:, 0], wanted, atol=1e-7 * np.abs(wanted).max())


def test_a_displacement_that_does_not_begin_at_zero_is_led_there_smoothly():
    motion = make_motion("offset", 0.01, {"x": np.linspace(0.3, 0.2, 500)}, "displacement", "test")
    target = make_target(motion)
    assert not target.displacement[[0, -1]].any()
    # quintic over 4 s from 0 to 0.3 m: peak velocity 1.875 d/T; plus the record's own
    assert np.abs(target.velocity).max() < 1.875 * 0.3 / 4 + 0.03
    inside = (target.time > 4.5) & (target.time < 8.5)
    clock = target.time[inside] + target.reference.start
    # the record's ends are kinks, smoothed by the low-pass within 0.5 s
    np.testing.assert_allclose(target.displacement[inside, 0], 0.3 - 0.1 * clock / 4.99, atol=1e-5)


@pytest.mark.parametrize(("corner", "low_pass"), [(1.0, 500.0), (2.0, 500.0), (0.1, 1.0), (0.1, 0.8)])
def test_the_band_pass_has_zero_phase_and_its_stated_gain(corner, low_pass):
    step = 0.01
    time = np.arange(20_001) * step  # long: the ends do not matter in the middle
    motion = make_motion("tone", step, {"x": np.sin(2 * np.pi * time)}, "acceleration", "closed form")
    target = make_target(motion, high_pass=corner, low_pass=low_pass)
    middle = slice(len(target.time) // 3, 2 * len(target.time) // 3)
    gain = 1 / (1 + corner**4) / (1 + (1 / low_pass) ** 8)  # at 1 Hz, orders 2 and 4 of the data file
    wanted = gain * np.sin(2 * np.pi * (target.time[middle] + target.reference.start))
    # transients of the ends and the straight line taken off have died out here
    np.testing.assert_allclose(target.acceleration[middle, 0], wanted, atol=1e-5)


def test_scale_and_axes_act_linearly_on_the_channels():
    motion = find_motion("ridgecrest-clc")
    whole = make_target(motion)
    turned = make_target(motion, scale=-0.5, axes="x=y,y=z")
    np.testing.assert_allclose(turned.displacement[:, 0], -0.5 * whole.displacement[:, 1], atol=1e-14)
    np.testing.assert_allclose(turned.acceleration[:, 1], -0.5 * whole.acceleration[:, 2], atol=1e-11)
    assert not turned.velocity[:, 2:].any()
    assert turned.reference.axes == (("x", "y"), ("y", "z")) and turned.reference.scale == -0.5
    single = make_target(motion, axes="z")
    assert single.displacement[:, 2].any() and not single.displacement[:, [0, 1, 3, 4, 5]].any()
    doubled = with_scale(turned, 1.0)
    np.testing.assert_allclose(doubled.velocity, -2 * turned.velocity, rtol=1e-14)
    assert doubled.reference.scale == 1.0


def test_a_window_cuts_the_record():
    motion = find_motion("ridgecrest")
    target = make_target(motion, window=(10.0, 30.0))
    assert target.time[-1] == pytest.approx(20.0 + 2 * 4.0, abs=1e-9)
    assert target.reference.start == pytest.approx(6.0)


@pytest.mark.parametrize(
    "options",
    [
        *({"axes": x} for x in ("q", "", "xx", "x=w")),
        *({"window": x} for x in ((5.0, 1.0), (0.0, 900.0))),
        *({"high_pass": 50.0}, {"high_pass": 0.0}, {"low_pass": 5000.0}, {"pad": 0.0}, {"scale": np.nan}),
    ],
    ids=str,
)
def test_processing_that_makes_no_sense_is_refused(options):
    with pytest.raises(MotionError):
        make_target(find_motion("ridgecrest"), **options)


def test_a_triangular_wave_has_its_amplitude_velocity_and_corner_acceleration():
    target = make_target(find_motion("triangle", axis="y", amplitude=0.2, velocity=0.25, corner_acceleration=2.0))
    peaks = [np.abs(q).max() for q in (target.displacement, target.velocity, target.acceleration)]
    # the 33 Hz low-pass rounds the kinks where the half-sine acceleration sets in
    np.testing.assert_allclose(peaks, [0.2, 0.25, 2.0], rtol=2e-3)
    speed = np.abs(target.velocity[:, 1])
    share = np.mean(np.abs(speed[speed > 1e-3] - 0.25) < 1e-3)
    assert share > 0.5  # most of the time at constant velocity


def test_sxh1_asks_for_the_velocity_of_the_report():
    target = make_target(find_motion("sxh1"))
    w = 2 * np.pi / 2.0
    np.testing.assert_allclose(target.displacement[:, 0].max(), 0.89, rtol=1e-6)
    # between the ramps it is a pure sine: A w and A w^2, to the nearest sample
    full = (target.time > 10.5) & (target.time < 19.5)
    np.testing.assert_allclose(np.abs(target.velocity[full, 0]).max(), 0.89 * w, rtol=1e-5)
    np.testing.assert_allclose(np.abs(target.acceleration[full, 0]).max(), 0.89 * w**2, rtol=1e-5)


def limited(**changes: tuple[str, float]) -> MotionLimits:
    arrays = {name: np.full(6, 1e6) for name in ("displacement", "velocity", "acceleration")}
    for quantity, (axis, value) in changes.items():
        arrays[quantity][AXES.index(axis)] = value
    return MotionLimits(**arrays)


def leg_across(d: np.ndarray, v: np.ndarray, a: np.ndarray, stroke: float = 0.02) -> list[Demand]:
    """A leg across the motion, 3 m long."""
    return actuators(("H1",), np.abs(v[:, :1]) / 100, (np.sqrt(3.0**2 + d[:, :1] ** 2) - 3.0) / stroke)


def actuators(names: tuple[str, ...], velocity: np.ndarray, stroke: np.ndarray) -> list[Demand]:
    return [
        Demand("actuator velocity", names, velocity, "of the unloaded velocity of its valves"),
        Demand("actuator stroke", names, stroke, "of its stroke"),
    ]


def test_an_over_range_target_names_axis_value_limit_time_and_the_scale_that_fits():
    target = make_target(find_motion("sine", amplitude=0.5, period=2.0), scale=2.0)
    limits = limited(displacement=("x", 0.3), velocity=("x", 1.0))
    with pytest.raises(OutOfRangeError) as caught:
        check_limits(target, limits)
    message = str(caught.value)
    # velocity is 1 m pi/s against 1, displacement 1 m against 0.3: scale 2 x 0.3 = 0.6
    for part in (
        "x displacement 1 m against 0.3 m at t = ",
        "x velocity 3.142 m/s against 1 m/s at t = ",
        "The largest scale that fits is 0.6; exceeded",
    ):
        assert part in message
    places = re.findall(r"t = ([\d.]+) s \(sample (\d+)\)", message)
    assert len(places) == 2
    for time, sample in places:
        assert float(time) == pytest.approx(int(sample) / RATE, abs=5e-4)  # three decimals
    fitting = with_scale(target, largest_scale(target, limits))
    assert check_limits(fitting, limits).highest[2] == pytest.approx(1.0, abs=0.02)
    with pytest.raises(OutOfRangeError):
        check_limits(with_scale(target, 0.61), limits)


def test_a_target_at_exactly_its_limit_passes():
    target = make_target(find_motion("sxh1"))
    limits = limited(displacement=("x", 0.89))
    summary = check_limits(target, limits)
    assert largest_scale(target, limits) == 1.0
    assert summary.highest[:2] == ("displacement", "x")
    assert summary.utilisation["velocity"]["y"] == 0


def test_legs_limit_the_scale_although_their_length_is_not_linear_in_the_pose():
    target = make_target(find_motion("sine", amplitude=0.5, period=2.0, cycles=0.5, ramp_cycles=0.5))

    # closed forms: sqrt(9.25) - 3 over 0.02 is 206.9 %; (0.5 s)^2 = 3.02^2 - 9, so s = 0.6940, rounded down
    said = r"fits is 0.69[34]; .*H1 actuator stroke 206.9 % of its stroke at t = .* s \(sample"
    with pytest.raises(OutOfRangeError, match=said):
        check_limits(target, WIDE, leg_across)
    fits = largest_scale(target, WIDE, leg_across)
    assert check_limits(with_scale(target, fits), WIDE, leg_across).utilisation["actuator stroke"]["H1"] <= 1


def test_what_exceeds_a_limit_at_rest_fits_at_no_scale_and_says_so():
    target, looks = make_target(find_motion("sine", amplitude=0.5, period=2.0)), []

    def check(displacement: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> list[Demand]:
        looks.append(len(displacement))
        return [Demand("platen strength", ("z up",), 1.3 + np.abs(velocity[:, :1]), "of its strength")]

    with pytest.raises(OutOfRangeError, match=r"at any scale, as what is mounted does at rest: z up platen .* 130 %"):
        check_limits(target, WIDE, check)
    assert largest_scale(target, WIDE, check) == 0.0
    assert sum(looks) < 1.1 * len(target.time)


@pytest.mark.parametrize("weight", [0.0, 0.5, 0.9])
def test_a_demand_with_a_static_part_limits_the_scale_although_another_one_is_larger_at_first(weight):
    """Closed form: |x| s <= 1 and weight + |v| s / 9 <= 1, whose samples are others; rounded down to three digits."""
    target = make_target(find_motion("sine", amplitude=0.5, period=2.0))

    def check(displacement: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> list[Demand]:
        lifted = weight + np.abs(velocity[:, :1]) / 9.0
        return [Demand("actuator stroke", ("H1",), displacement[:, :1], ""), Demand("lift", ("V1",), lifted, "")]

    peak = np.abs(target.displacement[:, 0]).max(), np.abs(target.velocity[:, 0]).max()
    expected = min(1.0 / peak[0], 9.0 * (1.0 - weight) / peak[1])
    found = largest_scale(target, limited(displacement=("x", 5.0)), check)
    assert 0.989 * expected < found <= expected * (1 + 1e-6)


def test_a_demand_that_is_infinite_at_the_first_trial_does_not_hide_the_others():
    target = make_target(find_motion("sine", amplitude=0.5, period=2.0))

    def check(displacement: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> list[Demand]:
        reached = np.where(np.abs(displacement[:, :1]) < 4.0, 0.0, np.inf)
        return [Demand("actuator stroke", ("H1",), reached, ""), Demand("speed", ("H1",), velocity[:, :1] / 2.0, "")]

    expected = 2.0 / np.abs(target.velocity[:, 0]).max()
    assert 0.989 * expected < largest_scale(target, limited(displacement=("x", 5.0)), check) <= expected * (1 + 1e-6)


@pytest.mark.parametrize("place", range(1000, 1008))
def test_a_demand_of_a_single_sample_limits_the_scale_wherever_it_is(place):
    """Closed form: the share (4 + x) s of one sample is full; the search looks at every eighth sample first."""
    target = make_target(find_motion("sine", amplitude=0.5, period=2.0))
    marked = target.displacement.copy()
    marked[place, AXES.index("yaw")] = 1.0

    def check(displacement: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> list[Demand]:
        return [Demand("lift", ("V1",), displacement[:, :1] + 4.0 * displacement[:, -1:], "")]

    alone = 1.0 / (4.0 + marked[place, 0])
    found = largest_scale(replace(target, displacement=marked), limited(displacement=("x", 5.0)), check)
    assert 0.989 * alone < found <= alone * (1 + 1e-6)


def test_the_largest_scale_takes_few_looks_at_all_samples():
    target, looks = make_target(find_motion("ridgecrest-ccc")), []

    def check(displacement: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> list[Demand]:
        looks.append(len(displacement))
        return [Demand("actuator velocity", ("H1",), velocity[:, :1] / 0.5, "")]

    fits = largest_scale(target, WIDE, check)
    assert fits == pytest.approx(0.5 / np.abs(target.velocity[:, 0]).max(), rel=0.01)
    assert sum(looks) < 1.5 * len(target.time)  # of few samples all looks but one


def test_an_over_range_refusal_is_short_and_says_first_the_scale_then_axes_then_legs_by_quantity():
    motion = find_motion("sfu-like")
    limits = MotionLimits(np.full(6, 1e-3), np.full(6, 1e-3), np.full(6, 1e-3))  # all 18 exceeded
    names = tuple(f"H{i}" for i in range(1, 5))

    def legs(displacement: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> list[Demand]:
        share = np.abs(velocity[:, :1]) * np.array([50.0, 90.0, 70.0, 1e-3])
        return actuators(names, share, 100 * np.abs(displacement[:, :1]) * np.array([[1.0, 2.0, 0.0, 0.0]]))

    target = make_target(motion)
    with pytest.raises(OutOfRangeError) as caught:
        check_limits(target, limits, legs)
    first, _, rest = str(caught.value).partition("; exceeded: ")
    assert re.fullmatch(r"sfu-like at scale 1 exceeds .*\. The largest scale that fits is [\d.e-]+", first)
    clauses = rest.split("; ")
    assert len(clauses) == 5
    assert {clause.split(" ")[1] for clause in clauses[:3]} == {"displacement", "velocity", "acceleration"}
    assert all(clause.count("(sample ") == 1 and clause.count(" t = ") == 1 for clause in clauses)
    for clause in clauses[:3]:  # the worst in full, the five other axes by name
        worst, _, others = clause.partition(", also ")
        assert {worst.split(" ")[0], *others.split(", ")} == set(AXES) and " against 0.001 " in worst
    stroke, velocity = clauses[3:]
    peak = np.abs(target.displacement[:, 0])
    assert stroke.startswith(
        f"H2 actuator stroke {2e4 * peak.max():.4g} % of its stroke at t = {peak.argmax() / RATE:.3f} s"
    )
    assert stroke.endswith(", also H1")
    speed = np.abs(target.velocity[:, 0])
    assert velocity.startswith(
        f"H2 actuator velocity {9000 * speed.max():.4g} % of the unloaded velocity of its valves at t = "
    )
    assert velocity.endswith(f"(sample {speed.argmax()}), also H3, H1")  # H4 is within its own


@pytest.mark.parametrize("scale", [1e-320, 1e-300, 1e-12, 1e12, 1e150, 1e290])
def test_the_scale_that_fits_does_not_depend_on_the_scale_that_was_asked(scale):
    motion = find_motion("sine", amplitude=0.5, period=2.0)
    limits = limited(displacement=("x", 0.3))
    legs = partial(leg_across, stroke=2.0)
    target = make_target(motion, scale=scale)
    if scale > 1:
        with pytest.raises(OutOfRangeError) as caught:
            check_limits(target, limits, legs)
        assert len(str(caught.value)) < 600 and "scale that fits is 0.6;" in str(caught.value)
        assert "H1 actuator stroke" in str(caught.value)
    else:
        check_limits(target, limits, legs)
    # below 1e-307 the samples themselves have lost their digits: no scale is too large that can be told
    assert largest_scale(target, limits, legs) == (0.6 if scale > 1e-305 else np.inf)


@pytest.mark.parametrize("scale", [1e306, -1e308])
def test_a_scale_too_large_to_compute_with_is_refused_as_such(scale):
    for name in ("sfu-like", "ridgecrest-ccc"):
        with pytest.raises(MotionError, match=f"{name}: at scale .*; give a smaller scale"):
            make_target(find_motion(name), scale=scale)


@given(st.floats(min_value=1e-300, max_value=1e300))
def test_a_scale_is_rounded_down_to_three_digits(value):
    found = _round_down(value)
    # a part in 1e6 up is the tolerance of the limits; three digits are at worst a hundredth
    assert 0.99 * value <= found <= value * (1 + 2e-6)
    assert float(f"{found:.2e}") == found


def test_a_still_target_fits_at_any_scale_and_limits_that_are_none_are_refused():
    still = GroundMotion("still", 0.01, np.zeros((500, 6)), "displacement", "test")
    assert largest_scale(make_target(still), WIDE) == np.inf
    for bad in (np.zeros(6), np.ones(3), np.full(6, np.nan), -np.ones(6)):
        with pytest.raises(ValueError, match="six positive numbers"):
            MotionLimits(np.ones(6), bad, np.ones(6))


def test_axes_that_leave_nothing_of_a_motion_are_refused():
    with pytest.raises(MotionError, match="moves x only, of which axes 'z' leave nothing; 'z=x' moves z of the table"):
        make_target(find_motion("sine"), axes="z")
    assert make_target(find_motion("sine"), axes="z=x").displacement[:, 2].any()


def test_resonant_harmonic_builds_up_to_the_closed_form():
    damping, period, amplitude, cycles = 0.05, 0.5, 2.0, 40
    w = 2 * np.pi / period
    step = period / 400
    time = np.arange(cycles * 400 + 1) * step
    found = response_spectrum(amplitude * np.sin(w * time), step, [period], damping)
    # u = A/(2 D w^2) (1 - exp(-D w t)) at the peaks, up to D^2; the excitation linear between samples loses
    # (w dt)^2/12 = 2e-5 and the sampled peak (w dt)^2/8 = 3e-5
    steady = amplitude / (2 * damping * w**2)
    assert found.displacement[0] == pytest.approx(steady, rel=1.3e-3)  # D^2/2 = 1.25e-3
    assert found.displacement[0] < steady


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.05, 0.3])
def test_a_sudden_constant_acceleration_overshoots_as_the_step_response(damping):
    period, amplitude = 0.8, 1.5
    w = 2 * np.pi / period
    half = np.pi / (w * np.sqrt(1 - damping**2))  # time of the first peak, placed on a sample
    step = half / 64
    found = response_spectrum(np.full(400, amplitude), step, [period], damping)
    overshoot = np.exp(-damping * np.pi / np.sqrt(1 - damping**2))
    # the input is linear between samples, so the recurrence is exact: rounding only
    assert found.displacement[0] == pytest.approx(amplitude / w**2 * (1 + overshoot), rel=1e-10)


def test_a_stiff_oscillator_follows_the_ground_and_a_soft_one_stays_behind():
    step = 1 / 2048
    time = np.arange(8 * 2048) * step
    envelope = np.sin(np.pi * time / time[-1]) ** 2
    displacement = 0.1 * envelope * np.sin(2 * np.pi * time)
    acceleration = np.gradient(np.gradient(displacement, step), step)
    found = response_spectrum(acceleration, step, [0.02, 200.0])
    # stiff: PSA = PGA (1 + (T/T_ground)^2 ...) = 4e-4; soft: SD = PGD within the ratio of the periods, 5e-3
    assert found.pseudo_acceleration[0] == pytest.approx(np.abs(acceleration).max(), rel=2e-3)
    assert found.displacement[1] == pytest.approx(np.abs(displacement).max(), rel=2e-2)


def test_the_recurrence_agrees_with_a_general_integrator_on_a_random_input():
    from scipy.integrate import solve_ivp

    step, period, damping = 0.02, 0.7, 0.05
    acceleration = np.random.default_rng(5).standard_normal(60)
    time = np.arange(60) * step
    w = 2 * np.pi / period

    def rate(t, state):
        return state[1], -np.interp(t, time, acceleration) - 2 * damping * w * state[1] - w**2 * state[0]

    solution = solve_ivp(rate, (0, time[-1]), [0, 0], t_eval=time, rtol=1e-11, atol=1e-14, max_step=step / 4)
    found = response_spectrum(acceleration, step, [period], damping)
    # the integrator's tolerance over the kinks of the input
    assert found.displacement[0] == pytest.approx(np.abs(solution.y[0]).max(), rel=1e-6)


def test_pseudo_quantities_are_the_displacement_times_powers_of_the_frequency():
    # 20 s at 2048 Hz: angle per step 1.5e-4; the same motion sampled coarsely, whose peaks miss at most (w dt)^2 / 8
    coarse = np.random.default_rng(2).standard_normal(100)
    fine = np.interp(np.arange(99 * 512 + 1) / 512, np.arange(100), coarse)
    slow, fast = (response_spectrum(x, dt, [20.0]).displacement[0] for x, dt in ((coarse, 0.25), (fine, 0.25 / 512)))
    assert fast == pytest.approx(slow, rel=8e-4)
    acceleration = np.random.default_rng(1).standard_normal(500)
    periods = np.geomspace(0.05, 10, 30)
    found = response_spectrum(acceleration, 0.005, periods)
    w = 2 * np.pi / periods
    np.testing.assert_allclose(found.pseudo_velocity, w * found.displacement, rtol=1e-14)
    np.testing.assert_allclose(found.pseudo_acceleration, w**2 * found.displacement, rtol=1e-14)


@pytest.mark.parametrize(
    ("step", "period", "damping"), [(0.0, 1.0, 0.05), (0.01, 0.0, 0.05), (0.01, 1.0, 1.0), (0.01, 1.0, -0.1)]
)
def test_impossible_oscillators_are_refused(step, period, damping):
    with pytest.raises(ValueError, match="positive"):
        response_spectrum(np.zeros(10), step, [period], damping)


@pytest.mark.parametrize("axes", ["roll=x", "x,y=pitch"])
def test_a_translation_is_no_rotation(axes):
    with pytest.raises(MotionError, match="metres are no radians"):
        make_target(find_motion("sfu-like"), axes=axes)


def test_a_motion_of_hours_is_refused_before_anything_is_built():
    """50 m for 50 mm: a triangle of 100 minutes."""
    with pytest.raises(MotionError, match="correct the time step or the size that sets its length"):
        make_target(find_motion("triangle", amplitude=50.0))
