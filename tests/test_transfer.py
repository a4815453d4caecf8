"""Transfer functions against plants whose response, noise and delay are known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plant_cases import TwoAxes
from scipy import signal

from lhpost6_pin.core.errors import UnknownNameError
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.signals import align
from lhpost6_pin.data.transfer import Transfer, band, band_within, delay_of, estimate_transfer

RATE = 256.0
F = np.arange(1, 513) / 8.0  # [Hz], of segments of 8 s up to a quarter of the rate


def noise(seconds: float, columns: int, seed: int = 0) -> np.ndarray:
    """White noise of unit variance."""
    return np.random.default_rng(seed).standard_normal((round(seconds * RATE), columns))


PLANT = TwoAxes((20, 0.5), (12, 0.3, 0.3), (9, 0.2, -0.2), (15, 0.4))
"""Two axes that resonate and couple."""


def pure_delay(tau: float) -> Transfer:
    """One axis that is late by `tau` [s] and nothing else."""
    return Transfer(F, np.exp(-2j * np.pi * F * tau)[:, None, None], np.ones((len(F), 1)), ("x",))


# ------------------------------------------------------------------------------------------- estimate
def test_white_noise_finds_the_response_of_a_plant_with_coupled_axes():
    x = noise(200, 2)
    found = band(estimate_transfer(x, PLANT.respond(x), RATE, axes=("x", "yaw")), 0.5, 60)
    assert found.axes == ("x", "yaw")
    np.testing.assert_allclose(found.frequency, np.arange(4, 481) / 8, rtol=1e-12)  # rounding
    # what rings on from the segment before is noise: (ringing time / segment) ~ 0.1 s / 8 s, over 49 segments
    np.testing.assert_allclose(found.response, PLANT.response(found.frequency), atol=0.01)
    assert found.coherence.min() > 0.99  # nothing but that noise, deepest where the output is weakest


@pytest.mark.parametrize("ratio", [0.25, 1.0, 9.0])
def test_noise_on_the_output_lowers_the_coherence_to_the_signal_s_share_of_power(ratio: float):
    x = noise(400, 1)
    found = estimate_transfer(x, x + noise(400, 1, seed=1) / np.sqrt(ratio), RATE, segment=2, axes=("x",))
    # standard error of one frequency sqrt(2) (1 - g) sqrt(g / 399) < 0.03, of the mean over 256 of them 0.002
    assert found.coherence.mean() == pytest.approx(ratio / (1 + ratio), abs=0.006)


def test_few_segments_do_not_flatter_the_coherence():
    x = noise(400, 6)
    y = x + noise(400, 6, seed=1)
    found = [
        estimate_transfer(x[start : start + 14 * 512], y[start : start + 14 * 512], RATE, segment=4).coherence
        for start in range(0, 80 * 1024, 14 * 512)
    ]  # 13 segments for six inputs: uncorrected it would be near (0.5 + 6 / 13 / 2) = 0.73
    assert np.mean(found) == pytest.approx(0.5, abs=0.02)  # 12 x 512 x 6 values of scatter 0.2, clipped at 0


def test_outputs_that_are_silent_or_have_nothing_to_do_with_the_inputs_do_not_cohere():
    found = estimate_transfer(noise(100, 3), noise(100, 2, seed=1), RATE, segment=2, axes=("x", "y", "z"))
    assert found.response.shape[1:] == (2, 3)
    assert np.median(found.coherence) < 0.01  # uncorrected 3 / 99
    found = estimate_transfer(noise(50, 1), np.zeros((12800, 1)), RATE, axes=("z",))
    assert not found.response.any() and not found.coherence.any()


def test_where_the_input_is_silent_nothing_is_claimed():
    low = signal.sosfiltfilt(signal.butter(10, 20, fs=RATE, output="sos"), noise(100, 1), axis=0)
    found = estimate_transfer(low, low + 1e-3 * noise(100, 1, seed=1), RATE, axes=("x",))
    heard, silent = band(found, 1, 18), band(found, 60, 120)  # (60 / 20)^-40 = -190 dB
    np.testing.assert_allclose(heard.response, 1, atol=0.01)  # noise of 1e-3 relative to an input of order one
    assert np.abs(silent.response).max() < 0.01  # T = Sxx / (Sxx + floor), far below one
    assert silent.coherence.max() < 0.5


def test_a_common_scale_of_inputs_and_outputs_changes_nothing():
    x = noise(50, 2)
    one = estimate_transfer(x, PLANT.respond(x), RATE, axes=("x", "y"))
    other = estimate_transfer(1e-6 * x, 1e-6 * PLANT.respond(x), RATE, axes=("x", "y"))
    np.testing.assert_allclose(other.response, one.response, atol=1e-12)  # rounding
    np.testing.assert_allclose(other.coherence, one.coherence, atol=1e-12)


X = noise(50, 2)
SHORT = X[: int(9 * RATE)]


@pytest.mark.parametrize(
    ("x", "y", "axes", "message"),
    [
        (X * [1.0, 0.0], X, ("x", "yaw"), "input yaw is silent"),
        (X, X, AXES, "as many different axes"),
        (X, X, ("x", "surge"), "surge"),
        (X, X[1:], ("x", "y"), "as many rows"),
        (SHORT, SHORT, ("x", "y"), "segments"),
        (X, np.where(X > 3, np.nan, X), ("x", "y"), "finite"),
    ],
)
def test_bad_records_are_refused_with_what_is_wrong(x, y, axes, message):
    with pytest.raises((ValueError, UnknownNameError), match=message):
        estimate_transfer(x, y, RATE, axes=axes)


# ------------------------------------------------------------------------------------------- delay, bands
@given(st.floats(-0.3, 0.3))
def test_the_delay_of_a_pure_delay_is_exact_whatever_the_phase_turns(tau: float):
    # up to 19 turns at 64 Hz; the rounding of a phase of 120 rad
    assert delay_of(pure_delay(tau), 0, 0, 0.5, 60) == pytest.approx(tau, abs=1e-12)


def test_the_delay_of_a_measured_signal_is_found_to_a_fraction_of_a_sample():
    x = signal.sosfiltfilt(signal.butter(6, 40, fs=RATE, output="sos"), noise(100, 1), axis=0)
    late = align(x, -0.0271, 1 / RATE) + 0.1 * noise(100, 1, seed=1)
    found = estimate_transfer(x, late, RATE, axes=("x",))
    # phase noise 0.1 / sqrt(2 · 23 segments) rad over 2 pi 20 Hz sqrt(236 frequencies): 8 us
    assert delay_of(found, 0, 0, 1, 30) == pytest.approx(0.0271, abs=3e-5)


def test_frequencies_that_do_not_cohere_have_no_say_in_the_delay():
    part = pure_delay(0.01)
    wrong = np.where((F > 20)[:, None, None], 1j, part.response)
    deaf = replace(part, response=wrong, coherence=1.0 * (F <= 20)[:, None])
    assert delay_of(deaf, 0, 0, 0.5, 60) == pytest.approx(0.01, abs=1e-12)  # rounding
    assert np.isnan(delay_of(replace(deaf, coherence=0 * deaf.coherence), 0, 0, 0.5, 60))


def test_a_band_without_frequencies_is_refused():
    with pytest.raises(ValueError, match="no frequency"):
        band(pure_delay(0), 70, 80)
    with pytest.raises(ValueError, match="at least two"):
        delay_of(pure_delay(0), 0, 0, 0.99, 1.01)


def test_the_band_within_3_db_of_a_butterworth_filter_ends_at_its_corner():
    gain = 1 / np.sqrt(1 + (F / 10.05) ** 4)
    found = Transfer(F, gain[:, None, None], np.ones((len(F), 1)), ("x",))
    half_power = 20 * np.log10(np.sqrt(2))
    assert band_within(found, 0, half_power, 0.9) == (0.125, 10.0)  # the last frequency below the corner
    lost = replace(found, coherence=np.where(F == 0.5, 0.8, 1.0)[:, None])
    assert band_within(lost, 0, half_power, 0.9) == (0.625, 10.0)
    assert np.isnan(band_within(lost, 0, half_power, 0.9, around=0.5)).all()
    assert np.isnan(band_within(found, 0, half_power, 0.9, around=30)).all()
