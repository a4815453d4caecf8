"""Intensity measures and response spectra of the target and the achieved motion of a record, and the required one."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.names import AXES
from ..core.threads import by_threads
from ..motions.intensity_measures import IntensityMeasures, intensity_measures
from ..motions.response_spectra import ResponseSpectrum, response_spectrum
from .metrics import QUANTITIES, SQUARED, channel, commanded_axes, labels, sampling

__all__ = ["DAMPING", "MOTIONS", "PERIODS", "MotionMeasures", "motion_measures"]

PERIODS = np.geomspace(0.03, 10.0, 120)
"""Periods [s] of the response spectra: the bands of ground motions and of shake tables."""

DAMPING = 0.05
"""Damping ratio of the response spectra, as in codes and attenuation relations; that of a required one if there is."""

MOTIONS = {"target": "reference", "achieved": "platen"}
"""Motions of a record, and how the names of their variables begin."""


@dataclass(frozen=True)
class MotionMeasures:
    """Measures of the motion of one axis, of the "target" and the "achieved" one where they are recorded."""

    axis: str
    intensity: dict[str, IntensityMeasures]  # of translations
    spectra: dict[str, ResponseSpectrum]  # of accelerations without gaps; the "required" one
    damping: float = DAMPING  # of the spectra

    @property
    def spectrum_error(self) -> float:
        """RMS over the periods of achieved over target pseudo-acceleration, less one; not-a-number without both.

        Periods are spaced evenly in their logarithm; those at which the target has next to no response do not count.
        """
        if not set(MOTIONS) <= set(self.spectra):
            return np.nan
        target, achieved = (self.spectra[name].pseudo_acceleration for name in MOTIONS)
        some = target > SQUARED
        return float(np.sqrt(np.mean((achieved[some] / target[some] - 1.0) ** 2))) if some.any() else np.nan


def motion_measures(record: xr.Dataset) -> list[MotionMeasures]:
    """Measures of the commanded axes; without a target, of those that moved."""
    step = sampling(record)[1]
    periods = PERIODS[PERIODS >= 10.0 * step]  # peaks are taken at samples
    return list(by_threads(lambda axis: _measures_of(record, axis, step, periods), commanded_axes(record)))


def _measures_of(record: xr.Dataset, axis: str, step: float, periods: Array) -> MotionMeasures:
    intensity, spectra = dict[str, IntensityMeasures](), dict[str, ResponseSpectrum]()
    place, required = labels(record, "axis").index(axis), _required(record, axis)
    damping = float(record["required_spectrum"].attrs["damping"]) if required else DAMPING
    if required:
        spectra["required"] = required
    for name, prefix in MOTIONS.items():
        names = [f"{prefix}_{quantity}" for quantity in reversed(QUANTITIES)]
        motion = [channel(record, n)[:, place] for n in names if n in record]
        if axis in AXES[:3] and len(motion) == len(names):
            intensity[name] = intensity_measures(motion[0], motion[1], motion[2], step)
        if names[0] in record and np.isfinite(motion[0]).all() and len(periods):
            spectra[name] = response_spectrum(motion[0], step, periods, damping)
    return MotionMeasures(axis, intensity, spectra, damping)


def _required(record: xr.Dataset, axis: str) -> ResponseSpectrum | None:
    """Spectrum that the target of an axis was to have, linear between logarithms."""
    if "required_spectrum" not in record:
        return None
    required = record["required_spectrum"].sel(axis=axis)
    frequency, acceleration = required["required_frequency"].values, required.values
    if np.isnan(acceleration).any():
        return None
    periods = PERIODS[(frequency[-1] >= 1 / PERIODS) & (frequency[0] <= 1 / PERIODS)]
    found = np.exp(np.interp(-np.log(periods), np.log(frequency), np.log(acceleration)))
    circular = 2 * np.pi / periods
    return ResponseSpectrum(periods, found / circular**2, found / circular, found)
