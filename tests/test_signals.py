"""Signals and their conditioning against closed forms: delays, shifts, derivatives, filters and integrals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lhpost6_pin.data.conditioning import integrate, resolution
from lhpost6_pin.data.signals import (
    Band,
    align,
    correlation,
    delay,
    delay_within,
    differentiate,
    drift_rate,
    fast_length,
    lowpass_zero_phase,
    peak_ratio,
    resample_band_limited,
    rrmse,
)

RATE = 512.0
DT = 1 / RATE
T = np.arange(6144) * DT  # 12 s
INSIDE = slice(200, -200)  # clear of the ends, where a record says nothing of its continuation


class Waves:
    """A sum of sines up to `highest` Hz with random phases, known with its derivative at any time."""

    def __init__(self, highest: float, columns: int = 3, seed: int = 0):
        rng = np.random.default_rng(seed)
        self.omega = 2 * np.pi * rng.uniform(0.3, highest, (60, columns))
        self.phase = rng.uniform(0, 2 * np.pi, (60, columns))

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Values at times `t`, (n, columns)."""
        return np.sin(np.multiply.outer(t, self.omega) + self.phase).sum(axis=1)

    def rate(self, t: np.ndarray) -> np.ndarray:
        """Derivatives at times `t`, (n, columns)."""
        return (self.omega * np.cos(np.multiply.outer(t, self.omega) + self.phase)).sum(axis=1)


# ------------------------------------------------------------------------------------------- measures
def test_the_error_of_a_scaled_signal_is_its_scale_error():
    x = Waves(30)(T)
    np.testing.assert_allclose(rrmse(x, 1.05 * x), 0.05, rtol=1e-12)  # rounding
    np.testing.assert_allclose(peak_ratio(x, -1.05 * x), 1.05, rtol=1e-12)
    np.testing.assert_allclose(correlation(x, -3 * x + 7), -1.0, rtol=1e-12)


def test_the_error_of_a_sine_late_by_a_phase_is_twice_the_sine_of_half_of_it():
    x, late = np.sin(2 * np.pi * 4 * T), np.sin(2 * np.pi * 4 * T - 0.3)
    assert rrmse(x, late) == pytest.approx(2 * np.sin(0.15), rel=1e-12)  # 48 whole periods: exact but for rounding


def test_an_axis_at_rest_has_no_error_if_the_table_rests_and_an_infinite_one_if_it_moves():
    still, moving = np.zeros((9, 2)), np.stack([np.zeros(9), np.ones(9)], axis=1)
    np.testing.assert_array_equal(rrmse(still, moving), [0.0, np.inf])
    np.testing.assert_array_equal(peak_ratio(still, moving), [0.0, np.inf])
    np.testing.assert_array_equal(correlation(still, moving), [0.0, 0.0])
    with pytest.raises(ValueError, match="differ in shape"):
        rrmse(np.zeros((5, 2)), np.zeros((5, 3)))


def test_the_drift_rate_is_the_slope_of_a_line():
    error = np.array([4.0, 5.0]) + np.multiply.outer(T, [2e-5, -3e-3])
    np.testing.assert_allclose(drift_rate(error, DT), [2e-5, -3e-3], rtol=1e-9)  # 4 / 2e-5 roundings


# ---------------------------------------------------------------------------------------------- delay
@settings(max_examples=30, deadline=None)
@given(st.floats(-0.09, 0.09), st.integers(0, 99), st.floats(1.0, 150.0))
def test_a_fractional_delay_is_found(late: float, seed: int, highest: float):
    waves = Waves(highest, seed=seed)
    found = delay(waves(T), 0.9 * waves(T - late) + 0.2, DT, max_delay=0.1)
    # the signal's cut ends reach into the interpolation: far below the 0.05 ms wanted
    np.testing.assert_allclose(found, late, atol=1e-6)


def test_noise_moves_the_delay_by_no_more_than_its_cramer_rao_bound_allows():
    waves, rng = Waves(30), np.random.default_rng(3)
    noise = 0.2 * rng.standard_normal((len(T), 3))
    found = delay(waves(T), waves(T - 0.0271) + noise, DT)
    bound = 0.2 * np.sqrt(1.5 / np.sum(waves.rate(T) ** 2, axis=0))  # 1.5: a Hann window's price
    assert np.all(np.abs(found - 0.0271) < 5 * bound)  # five standard deviations: once in 10^6
    assert np.all(5 * bound < 5e-5)  # and that is within 0.05 ms


def test_a_slow_signal_that_ends_elsewhere_than_it_began_has_its_delay_found():
    ramp = 0.5 * T + np.sin(2 * np.pi * 0.2 * T)
    late = 0.5 * (T - 0.02) + np.sin(2 * np.pi * 0.2 * (T - 0.02))
    assert delay(ramp, late, DT) == pytest.approx(0.02, abs=1e-5)  # a fifth of the accuracy wanted


def test_a_delay_has_a_sign_and_a_limit():
    waves = Waves(5)
    np.testing.assert_allclose(delay(waves(T - 0.03), waves(T), DT), -0.03, atol=1e-5)
    assert np.all(np.abs(delay(waves(T), waves(T - 0.03), DT, max_delay=0.01)) <= 0.01)


def test_a_delay_at_the_end_of_the_range_is_none():
    waves = Waves(5)
    assert np.isnan(delay_within(waves(T), waves(T - 0.03), DT, 0.01)).all()
    np.testing.assert_allclose(delay_within(waves(T), waves(T - 0.005), DT, 0.01), 0.005, atol=1e-5)


def test_a_silent_signal_has_no_delay_and_a_short_record_is_refused():
    assert np.isnan(delay(np.sin(T), np.zeros_like(T), DT))
    with pytest.raises(ValueError, match="at least"):
        delay(np.ones(20), np.ones(20), DT)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        held = 0.1 + 1e-17 * rng.integers(-3, 4, (2, 4096))  # a spool that holds: equal to the last bit, or nearly
        late = delay(held[0], held[1], 1 / 2048)
        assert np.isnan(late) or abs(late) <= 0.1


# ---------------------------------------------------------------------------------------------- align
def test_aligning_undoes_a_delay_of_each_column():
    waves, late = Waves(150), np.array([0.0271, -0.0033, 0.0999])
    shifted = np.stack([waves(T - tau)[:, k] for k, tau in enumerate(late)], axis=1)
    # the ends' curvature reaches in, falling off as 1 / distance^3; far from them little but rounding is left
    assert rrmse(waves(T)[INSIDE], align(shifted, late, DT)[INSIDE]).max() < 1e-6


def test_aligning_by_whole_samples_moves_samples_and_holds_the_end():
    x = Waves(20)(T)
    np.testing.assert_allclose(align(x, 5 * DT, DT)[:-5], x[5:], atol=1e-9)  # rounding of 12000-point FFTs
    np.testing.assert_array_equal(align(x, 5 * DT, DT)[-5:], np.tile(x[-1], (5, 1)))
    np.testing.assert_array_equal(align(x, -5 * DT, DT)[:5], np.tile(x[0], (5, 1)))


def test_nothing_wraps_around_the_ends_of_a_record():
    pulse = np.exp(-(((T - T[-1] + 0.05) / 0.02) ** 2))
    moved = align(pulse, -0.5, DT)  # out over the end
    assert np.abs(moved[: len(T) // 2]).max() < 1e-9


def test_a_line_stays_a_line_under_any_shift():
    line = 3.0 - 2.0 * T
    np.testing.assert_allclose(align(line, 0.0123, DT)[:-10], (line - 2.0 * 0.0123)[:-10], atol=1e-10)


# ------------------------------------------------------------------------------------------- resampling
def test_a_band_limited_record_is_interpolated_to_a_millionth():
    waves = Waves(0.8 * RATE / 2)
    fine = np.arange(4 * len(T) - 3) / (4 * RATE)
    inside = slice(4 * 30, -4 * 30)
    error = np.abs(resample_band_limited(waves(T), T, fine) - waves(fine))[inside]
    assert error.max() < 60 * 1e-7  # the window's stop band, 140 dB, for each of 60 waves


def test_interpolation_returns_the_samples_at_their_own_times_and_keeps_constants():
    x = Waves(100)(T)
    np.testing.assert_allclose(resample_band_limited(x, T, T), x, atol=1e-12 * 60)
    np.testing.assert_allclose(resample_band_limited(np.ones(99), T[:99], T[:99] * 0.77), 1.0, atol=1e-12)


def test_interpolation_follows_a_record_that_starts_and_ends_at_rest_up_to_its_ends():
    def rest_to_rest(t: np.ndarray) -> np.ndarray:
        return np.sin(np.pi * np.clip(t / T[-1], 0, 1)) ** 4 * np.sin(2 * np.pi * 20 * t)

    fine = np.arange(4 * len(T) + 9) / (4 * RATE)  # beyond the last sample too
    assert np.abs(resample_band_limited(rest_to_rest(T), T, fine) - rest_to_rest(fine)).max() < 1e-7


def test_interpolation_holds_the_ends_outside_the_record_and_refuses_uneven_time():
    x = Waves(30)(T)
    np.testing.assert_allclose(resample_band_limited(x, T, [-1.0, 99.0]), x[[0, -1]], atol=1e-9)
    uneven = T.copy()
    uneven[7] += 0.5 * DT
    with pytest.raises(ValueError, match="uniform"):
        resample_band_limited(x, uneven, T)


# ---------------------------------------------------------------------------------------------- filters
def test_the_low_pass_halves_a_wave_at_its_cutoff_and_turns_no_phase():
    for f, gain in ((20.0, 1 / (1 + 0.5**8)), (40.0, 0.5), (80.0, 1 / (1 + 2.0**8))):
        wave = np.sin(2 * np.pi * f * T)
        # 3 %: the bilinear transform warps 80 of 256 Hz; at the cutoff it is exact
        error = lowpass_zero_phase(wave, DT, 40.0)[1000:-1000] - gain * wave[1000:-1000]
        assert np.abs(error).max() < (1e-9 if f == 40.0 else 3e-3)


def test_differentiation_is_exact_for_band_limited_waves():
    np.testing.assert_allclose(differentiate(3.0 - 2.0 * T, DT), -2.0, atol=1e-9)  # and for a line
    waves = Waves(100)
    peak = np.abs(waves.rate(T)).max()
    error = np.abs(differentiate(waves(T), DT) - waves.rate(T))
    assert error[INSIDE].max() < 2e-3 * peak  # the ends' curvature reaches in as 1 / distance
    tapered = np.sin(np.pi * T / T[-1]) ** 4 * np.sin(2 * np.pi * 20 * T)
    rate = np.gradient(tapered, DT, edge_order=2)
    assert np.abs(differentiate(tapered, DT)[0]) < 1e-6 * np.abs(rate).max()  # at rest to its very end


def test_the_noise_of_a_derivative_is_as_stated():
    noise = np.random.default_rng(8).standard_normal(100_000)
    sharp = 2 * np.pi * (RATE / 2) * np.sqrt(2 * (RATE / 2) * DT / 3)
    assert np.std(differentiate(noise, DT)) == pytest.approx(sharp, rel=0.01)  # 100 000 samples: 0.3 %
    cut = 2 * np.pi * 50 * np.sqrt(2 * 50 * DT / 3)
    measured = np.std(differentiate(noise, DT, cutoff=50.0, order=8))
    # sqrt(3 integral of u^2 / (1 + u^8)^2) = 0.893; a band of 50 of 256 Hz has 20 000 free samples: 0.5 %
    assert measured / cut == pytest.approx(0.893, rel=0.02)


# ----------------------------------------------------------------------------------------------- bands
def test_a_band_passes_what_is_inside_and_stops_what_is_outside_without_phase():
    band = Band(2.0, 30.0)
    for f, gain in ((0.2, 0.0), (8.0, 1.0), (30.0, 0.5), (200.0, 0.0)):
        x = np.sin(2 * np.pi * f * T)
        # 1e-3: the skirts ((8/30)^8 = 3e-5), and ends, where a wave is not what its odd reflection makes of it
        np.testing.assert_allclose(band.apply(x, DT)[1500:-1500], gain * x[1500:-1500], atol=1e-3)
        assert band.gain(f) == pytest.approx(gain, abs=1e-4)


def test_a_low_pass_band_keeps_a_line_and_is_the_butterworth_low_pass_run_both_ways():
    np.testing.assert_allclose(Band(high=20.0).apply(3 + 2 * T, DT), 3 + 2 * T, atol=1e-12)
    x = Waves(60)(T)
    both = lowpass_zero_phase(x, DT, 20.0)
    # the bilinear transform bends the digital filter's frequencies by (pi f dt)^2 / 3, 0.5 % at 20 Hz
    np.testing.assert_allclose(Band(high=20.0).apply(x, DT)[INSIDE], both[INSIDE], atol=0.05 * x.std())


def test_a_band_commutes_with_differentiation():
    x, band = Waves(40)(T) * np.hanning(len(T))[:, None] ** 2, Band(1.0, 25.0)  # at rest at both ends, as a test is
    first = band.apply(differentiate(x, DT), DT)
    second = differentiate(band.apply(x, DT), DT)
    # what the taper leaves at the ends, where the low corner rings
    np.testing.assert_allclose(first, second, atol=1e-4 * second.std())


@pytest.mark.parametrize(("low", "high"), [(5.0, 5.0), (7.0, 5.0), (-1.0, 5.0), (0.0, float("nan"))])
def test_a_band_that_passes_nothing_is_refused(low: float, high: float):
    with pytest.raises(ValueError, match="no band"):
        Band(low, high)


def test_the_resolution_is_the_smallest_step():
    assert resolution(0.25 * np.round(np.sin(T) / 0.25)) == pytest.approx(0.25)
    assert resolution(np.ones(9)) == 0.0


@pytest.mark.parametrize(("frequency", "accuracy"), [(5.0, 1e-9), (51.2, 1e-5)])
def test_integrals_are_those_of_a_sine(frequency: float, accuracy: float):
    w = 2 * np.pi * frequency
    once, twice = integrate(np.sin(w * T)[:, None], DT)
    np.testing.assert_allclose(
        once[:, 0] * w, 1 - np.cos(w * T), atol=100 * accuracy
    )  # of ends, which a spline guesses
    np.testing.assert_allclose(np.diff(once[100:-100, 0]) * w, np.diff(-np.cos(w * T))[100:-100], atol=accuracy)
    assert twice[0, 0] == once[0, 0] == 0.0


def test_fast_lengths_are_those_of_scipy():
    from scipy.fft import next_fast_len

    lengths = [*range(1, 3000), 102_401, 123_457, 999_983]
    assert [fast_length(n) for n in lengths] == [next_fast_len(n, real=True) for n in lengths]
