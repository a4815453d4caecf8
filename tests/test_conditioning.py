"""Conditioning: offsets, gaps, resolution and integrals against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.conditioning import fill_gaps, integrate, resolution, without_offset

DT = 1 / 512
T = np.arange(4096) * DT


def test_what_is_left_of_a_rest_has_no_mean() -> None:
    x = np.stack([np.full(100, 3.0), np.arange(100.0)], axis=1)
    left = without_offset(x, slice(0, 11))
    np.testing.assert_allclose(left[:11].mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(left[-1], [0.0, 94.0])
    with pytest.raises(ValueError, match="no samples"):
        without_offset(x, slice(0, 0))


def test_the_resolution_is_the_smallest_step() -> None:
    assert resolution(0.25 * np.round(np.sin(T) / 0.25)) == pytest.approx(0.25)
    assert resolution(np.ones(9)) == 0.0


def test_short_gaps_are_filled_from_both_sides() -> None:
    x = np.stack([np.sin(2 * np.pi * 3 * T), np.cos(2 * np.pi * 3 * T)], axis=1)
    holed = x.copy()
    holed[100:105, 0] = np.nan
    holed[2000, 1] = np.inf
    filled = fill_gaps(holed, DT, 0.02)
    # a cubic over h = 6 samples: curvature change (w h)^3 / 6 of the amplitude, 2 %, at most; Akima's slopes less
    np.testing.assert_allclose(filled, x, atol=5e-3)
    np.testing.assert_array_equal(filled[np.isfinite(holed)], x[np.isfinite(holed)])
    assert np.isnan(holed[100, 0])  # the original stays as it is


@given(st.integers(0, 199), st.integers(1, 60))
def test_a_gap_is_filled_or_named(first: int, length: int) -> None:
    x = np.linspace(0.0, 1.0, 200)[:, None] * np.ones(2)
    end = min(first + length, 200)
    x[first:end, 1] = np.nan
    if first == 0 or end == 200 or (end - first) > 20:
        with pytest.raises(RecordError, match=rf"force\[1\]: {end - first} samples missing from sample {first}"):
            fill_gaps(x, 0.001, 0.020, "force")
    else:
        np.testing.assert_allclose(fill_gaps(x, 0.001, 0.020)[:, 1], x[:, 0], atol=1e-12)  # a line stays one


@pytest.mark.parametrize(("frequency", "accuracy"), [(5.0, 1e-9), (51.2, 1e-5)])
def test_integrals_are_those_of_a_sine(frequency: float, accuracy: float) -> None:
    w = 2 * np.pi * frequency
    once, twice = integrate(np.sin(w * T)[:, None], DT)
    np.testing.assert_allclose(
        once[:, 0] * w, 1 - np.cos(w * T), atol=100 * accuracy
    )  # of ends, which a spline guesses
    np.testing.assert_allclose(np.diff(once[100:-100, 0]) * w, np.diff(-np.cos(w * T))[100:-100], atol=accuracy)
    assert twice[0, 0] == once[0, 0] == 0.0
