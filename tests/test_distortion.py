"""Harmonics against Fourier series in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.data.distortion import Harmonics, harmonics, phase_between, total_distortion, total_harmonic_distortion

RATE = 2048.0
T = np.arange(round(12.3 * RATE)) / RATE


@given(
    st.floats(0.2, 40),
    st.lists(st.tuples(st.floats(0.1, 3), st.floats(-3.1, 3.1)), min_size=1, max_size=6),
    st.floats(-5, 5),
)
def test_a_sum_of_harmonics_is_taken_apart_exactly(fundamental, parts, offset):
    amplitude, phase = np.array(parts).T
    order = np.arange(1, len(parts) + 1)
    x = offset + (amplitude * np.cos(2 * np.pi * fundamental * np.multiply.outer(T, order) + phase)).sum(axis=1)
    found = harmonics(x, RATE, fundamental, len(parts))
    np.testing.assert_allclose(found.frequency, fundamental * order, rtol=1e-12)  # rounding, here and below
    np.testing.assert_allclose(found.amplitude, amplitude, atol=1e-9)
    np.testing.assert_allclose(found.phase, phase, atol=1e-8)


def test_only_the_last_whole_periods_count():
    x = np.cos(2 * np.pi * T)
    x[: round(0.3 * RATE)] += 100  # 12.3 s of 1 Hz: the transient of the first 0.3 s is left out
    np.testing.assert_allclose(harmonics(x, RATE, 1, 3).amplitude, [1, 0, 0], atol=1e-9)  # rounding


def test_a_triangle_wave_has_odd_harmonics_that_fall_with_the_square_of_their_order():
    x = 2 / np.pi * np.arcsin(np.sin(2 * np.pi * 0.5 * T))
    found = harmonics(x, RATE, 0.5, 9)
    odd = np.array([1, 0, 1 / 9, 0, 1 / 25, 0, 1 / 49, 0, 1 / 81])
    # sampled 4096 times a period: harmonics near the 4096th, 1 / 4096² in size, fold back
    np.testing.assert_allclose(found.amplitude, 8 / np.pi**2 * odd, atol=1e-6)
    assert total_harmonic_distortion(found) == pytest.approx(np.sqrt(np.sum(odd[1:] ** 2)), abs=1e-6)


@pytest.mark.long
def test_a_square_wave_has_odd_harmonics_that_fall_with_their_order():
    x = np.where(np.sin(2 * np.pi * 0.5 * (T + 0.5 / RATE)) >= 0, 1.0, -1.0)  # half a sample off its edges
    found = harmonics(x, RATE, 0.5, 200)
    odd = (np.arange(1, 201) % 2) / np.arange(1, 201)
    # folding makes sin(x) of x = pi k / 4096, relative error x² / 6 < 0.004 at k = 200, of a harmonic of 4 / 200 pi
    np.testing.assert_allclose(found.amplitude, 4 / np.pi * odd, atol=3e-5)
    every = np.sqrt(np.pi**2 / 8 - 1)  # of all harmonics; those above the 200th hold sum 1 / k² = 1 / 400
    assert total_harmonic_distortion(found) == pytest.approx(np.sqrt(every**2 - 1 / 400), abs=1e-4)


@given(st.floats(-0.24, 0.24))
def test_a_late_sine_lags_by_its_delay(tau: float):
    reference = harmonics(np.sin(2 * np.pi * 2 * T), RATE, 2, 1)
    late = harmonics(0.3 * np.sin(2 * np.pi * 2 * (T - tau)), RATE, 2, 1)
    assert phase_between(reference, late) == pytest.approx(-2 * np.pi * 2 * tau, abs=1e-9)  # rounding


def test_a_phase_is_told_within_half_a_turn():
    def wave(phase: float) -> Harmonics:
        return Harmonics(np.ones(1), np.ones(1), np.array([phase]))

    assert phase_between(wave(3.0), wave(-3.0)) == pytest.approx(2 * np.pi - 6, rel=1e-12)  # rounding
    assert phase_between(wave(-3.0), wave(3.0)) == pytest.approx(6 - 2 * np.pi, rel=1e-12)
    assert phase_between(wave(0.0), wave(np.pi)) == np.pi


def test_noise_between_the_harmonics_averages_out():
    x = np.cos(2 * np.pi * T) + np.random.default_rng(0).standard_normal(len(T))
    # standard deviation of an amplitude sqrt(2 / 24576) = 0.009
    np.testing.assert_allclose(harmonics(x, RATE, 1, 5).amplitude, [1, 0, 0, 0, 0], atol=0.035)


def test_distortion_is_the_root_of_the_harmonics_power_over_the_fundamental():
    assert total_harmonic_distortion(Harmonics(np.ones(3), np.array([2.0, 0.3, 0.4]), np.zeros(3))) == 0.25
    assert np.isnan(total_harmonic_distortion(harmonics(np.cos(2 * np.pi * T), RATE, 1, 1)))  # no harmonic counted
    assert np.isnan(total_harmonic_distortion(harmonics(0 * T, RATE, 1, 4)))


@pytest.mark.parametrize(
    ("x", "fundamental", "count", "message"),
    [
        (T, 0.08, 3, "less than one period"),
        ([], 1, 3, "less than one period"),
        (T, 512, 2, "do not lie between 0 and 1024 Hz"),
        (T, -1, 2, "harmonics of -1 Hz"),
        (np.where(T == 1, np.nan, T), 1, 2, "finite"),
        (np.ones((100, 2)), 30, 2, "one column"),
    ],
)
def test_a_record_or_request_that_cannot_be_analysed_is_refused(x, fundamental, count, message):
    with pytest.raises(ValueError, match=message):
        harmonics(x, RATE, fundamental, count)


def test_total_distortion_counts_all_that_is_not_the_fundamental():
    """Harmonics above a band, which the THD of the band leaves out, and a period that is no whole number of samples."""
    t = np.arange(4000) / 2048.0
    signal = 0.3 + 2.0 * np.cos(2 * np.pi * 3.3 * t + 0.7)
    signal += 0.03 * np.cos(2 * np.pi * 40 * 3.3 * t) + 0.04 * np.sin(2 * np.pi * 5 * 3.3 * t)
    assert total_distortion(signal, 2048.0, 3.3) == pytest.approx(0.05 / 2.0, rel=2e-3)  # period to a sample in 3700
    assert total_harmonic_distortion(harmonics(signal, 2048.0, 3.3, 10)) == pytest.approx(0.04 / 2.0, rel=2e-3)
