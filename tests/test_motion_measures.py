"""Intensity measures by closed forms, and the error of a response spectrum."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.constants import g

from lhpost6_pin.data.motion_measures import motion_measures
from lhpost6_pin.motions.intensity_measures import intensity_measures

pytestmark = pytest.mark.fast

STEP = 1e-3


def sine(amplitude: float, frequency: float, cycles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Acceleration, velocity and displacement of whole cycles."""
    w, t = 2.0 * np.pi * frequency, np.arange(0.0, cycles / frequency + STEP / 2.0, STEP)
    return amplitude * np.sin(w * t), -amplitude / w * np.cos(w * t), -amplitude / w**2 * np.sin(w * t)


def record(target: np.ndarray, achieved: np.ndarray) -> xr.Dataset:
    """A record whose motion along y is target and achieved acceleration, velocity, displacement (n, 3)."""
    channels = {}
    for who, motion in (("reference", target), ("platen", achieved)):
        for k, quantity in enumerate(("acceleration", "velocity", "displacement")):
            values = np.zeros((len(motion), 3))
            values[:, 1] = motion[:, k]
            channels[f"{who}_{quantity}"] = (("time", "axis"), values)
    return xr.Dataset(channels, {"time": np.arange(len(target)) * STEP, "axis": ["x", "y", "yaw"]})


def test_measures_of_a_sine_are_those_of_its_closed_form():
    amplitude, frequency, cycles = 3.0, 2.0, 20
    found = intensity_measures(*sine(amplitude, frequency, cycles), STEP)
    length, w = cycles / frequency, 2.0 * np.pi * frequency
    assert found[:3] == pytest.approx((amplitude, amplitude / w, amplitude / w**2), rel=1e-6)  # a sample at each peak
    # straight lines between samples lose (w dt)^2 / 6 = 3e-5 of the squares, half as much of the areas
    assert found.arias == pytest.approx(np.pi / (2.0 * g) * amplitude**2 / 2.0 * length, rel=5e-5)
    assert found.cav == pytest.approx(2.0 / np.pi * amplitude * length, rel=5e-5)
    # the squares grow evenly but for sin(2 w t) / (2 w)
    assert found.duration == pytest.approx(0.9 * length, abs=1.0 / (2.0 * w))


def test_the_significant_duration_of_a_pulse_within_silence_is_its_own():
    acceleration = np.zeros(10_001)
    acceleration[4_000:5_001] = 2.0  # constant for 1 s: 5 to 95 % of its squares pass in 0.9 s
    found = intensity_measures(acceleration, acceleration, acceleration, STEP)
    assert found.duration == pytest.approx(0.9, abs=2 * STEP)
    assert np.isnan(intensity_measures(*np.zeros((3, 50)), STEP).duration)


@given(st.floats(0.01, 100.0), st.integers(0, 2**31))
def test_measures_scale_with_the_motion_and_are_the_same_backwards(factor, seed):
    motion = np.random.default_rng(seed).normal(size=(3, 200))
    once, more = intensity_measures(*motion, STEP), intensity_measures(*factor * motion, STEP)
    powers = np.array([1, 1, 1, 2, 0, 1])
    np.testing.assert_allclose(more, np.array(once) * factor**powers, rtol=1e-9)
    np.testing.assert_allclose(intensity_measures(*motion[:, ::-1], STEP), once, rtol=1e-9)


def test_the_error_of_a_spectrum_is_the_relative_deviation_of_a_motion_that_is_too_large():
    motion = np.array(sine(1.0, 3.0, 12)).T
    (found,) = motion_measures(record(motion, 1.1 * motion))
    assert found.axis == "y" and set(found.intensity) == {"target", "achieved"}
    assert found.spectrum_error == pytest.approx(0.1, rel=1e-9)
    assert found.intensity["achieved"].arias == pytest.approx(1.21 * found.intensity["target"].arias, rel=1e-9)


def test_without_a_target_there_is_no_error_and_gaps_leave_no_spectrum():
    motion = np.array(sine(1.0, 3.0, 12)).T
    lone = record(motion, motion).drop_vars([f"reference_{q}" for q in ("acceleration", "velocity", "displacement")])
    (found,) = motion_measures(lone)
    assert list(found.spectra) == ["achieved"] and np.isnan(found.spectrum_error)
    motion[5, 0] = np.nan
    (found,) = motion_measures(record(motion, motion))
    assert not found.spectra and np.isnan(found.intensity["target"].pga)
