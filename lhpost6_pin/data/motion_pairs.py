"""Displacement, velocity and acceleration of the platen against derivatives of one another."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from ..core.arrays import Array
from .channels import MOTION, channel_name
from .records import sample_interval
from .signals import differentiate, lowpass_zero_phase

__all__ = ["GAIN_TOLERANCE", "inconsistent_motion", "motion_gains"]

_Warning = tuple[str, int | None, str, str]  # channel, sample, message, remedy

GAIN_TOLERANCE = 0.1  # between a channel and the derivative of another; calibration errors are far smaller
LIKE_AXES = tuple((j, k) for k in range(6) for j in range(6) if j // 3 == k // 3)  # of one unit
USUAL_FACTORS = {  # gain of a channel over what it should be -> likely reason; {} is the other channel
    -1.0: "opposite signs",
    1 / 9.80665: "in g",
    9.80665: "in m/s2, taken for g",
    1e3: "in mm",
    1e2: "in cm",
    1 / 0.0254: "in inches",
    180 / np.pi: "in degrees",
    1e-3: "{} in mm",
    1e-2: "{} in cm",
    0.0254: "{} in inches",
    np.pi / 180: "{} in degrees",
    25.4: "in mm, taken for inches, or {} in inches, taken for mm",
    1 / 25.4: "in inches, taken for mm, or {} in mm, taken for inches",
    10.0: "in mm, taken for cm, or {} in cm, taken for mm",
    0.1: "in cm, taken for mm, or {} in mm, taken for cm",
}


def inconsistent_motion(dataset: xr.Dataset) -> Iterator[_Warning]:
    """Compare each of displacement, velocity and acceleration with the derivative of those before it."""
    for low, high in ((0, 1), (1, 2), (0, 2)):
        gains = motion_gains(dataset, low, high)
        for (j, k), gain in gains.items():
            right = gain is not None and abs(gain - 1) <= GAIN_TOLERANCE
            place, source = channel_name(dataset[MOTION[high]], k), channel_name(dataset[MOTION[low]], j)
            if j == k and gain is not None and not right:
                usual = min(USUAL_FACTORS, key=lambda factor: abs(gain / factor - 1))
                near = abs(gain / usual - 1) < GAIN_TOLERANCE
                reason = f": {USUAL_FACTORS[usual].format(source)}?" if near else ""
                message = f"is {gain:.3g} times that derived from {source}{reason}"
                yield place, None, message, "check units and signs of both"
            elif j != k and right and gains[k, k] is None:
                yield place, None, f"is the derivative of {source}", "the two channels may be swapped"


def motion_gains(
    dataset: xr.Dataset, low: int, high: int, pairs: tuple[tuple[int, int], ...] = LIKE_AXES
) -> dict[tuple[int, int], float | None]:
    """Gain of axis k of `MOTION[high]` over the derivative of axis j of `MOTION[low]`, by pairs (j, k).

    None where the two are not coherent; no pair for a record without both, or shorter than two seconds.
    """
    if dataset.sizes["time"] < 256 or dataset.sizes["time"] * (dt := sample_interval(dataset)) < 2:
        return {}
    if not {MOTION[low], MOTION[high]} <= set(dataset.data_vars):
        return {}
    cutoff = min(40.0, 0.2 / dt)
    expected = dataset[MOTION[low]].values
    for _ in range(high - low):
        expected = differentiate(expected, dt, cutoff)
    found = lowpass_zero_phase(dataset[MOTION[high]].values, dt, cutoff)
    return {(j, k): _coherent_gain(expected[:, j], found[:, k], dt) for j, k in pairs}


def _coherent_gain(expected: Array, found: Array, dt: float) -> float | None:
    """Median gain found / expected where the two are coherent; None if that is almost nowhere.

    Its sign is that of the lower half of these frequencies, where a delay turns the phase least.
    """
    from scipy.signal import csd, welch

    each = {"fs": 1 / dt, "nperseg": int(min(len(found) // 4, round(2 / dt)))}
    if each["nperseg"] < 10:
        return None  # no five frequencies above zero
    f, cross = csd(expected, found, **each)
    ours, theirs = welch(expected, **each)[1], welch(found, **each)[1]
    band = (f > 0) & (f < 20) & (ours > 1e-4 * ours.max()) & (np.abs(cross) ** 2 > 0.95 * ours * theirs)
    if band.sum() < 5:
        return None
    ratio = cross[band] / ours[band]
    return float(np.copysign(np.median(np.abs(ratio)), np.median(ratio[: len(ratio) // 2].real)))
