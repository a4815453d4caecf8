"""Intensity measures of a ground motion by their definitions: peaks, Arias intensity, significant duration, CAV."""

from typing import NamedTuple

import numpy as np
from scipy.constants import g as STANDARD_GRAVITY

from ..core.arrays import Array

__all__ = ["IntensityMeasures", "intensity_measures"]

SIGNIFICANT = (0.05, 0.95)
"""Shares of the Arias intensity at which the significant duration begins and ends (Trifunac and Brady 1975)."""


class IntensityMeasures(NamedTuple):
    """Intensity measures of one component of a ground motion."""

    pga: float  # peak acceleration [m/s2]
    pgv: float  # peak velocity [m/s]
    pgd: float  # peak displacement [m]
    arias: float  # Arias intensity, pi / (2 g) times the integral of a^2 (Arias 1970) [m/s]
    duration: float  # significant duration D5-95 [s]; not-a-number without motion
    cav: float  # cumulative absolute velocity, the integral of |a| [m/s]


def intensity_measures(
    acceleration: Array, velocity: Array, displacement: Array, time_step: float
) -> IntensityMeasures:
    """Measures of one component, channels (n,) [m/s2], [m/s], [m] at a `time_step` [s].

    Integrals are those of channels linear between samples: of a^2 it is exact, as is that of |a| where a keeps its
    sign between two samples. Not-a-number where a channel has non-finite samples.
    """
    a, b = acceleration[:-1], acceleration[1:]
    squares = np.concatenate([[0.0], np.cumsum((a * a + a * b + b * b) * (time_step / 3.0))])
    begin, end = (_time_at(squares, share * squares[-1], time_step) for share in SIGNIFICANT)
    pga, pgv, pgd = (float(np.max(np.abs(x))) for x in (acceleration, velocity, displacement))
    arias = float(np.pi / (2.0 * STANDARD_GRAVITY) * squares[-1])
    duration = end - begin if squares[-1] > 0.0 else np.nan
    cav = float(np.sum(np.abs(a) + np.abs(b)) * time_step / 2.0)
    return IntensityMeasures(pga, pgv, pgd, arias, duration, cav)


def _time_at(growing: Array, level: float, time_step: float) -> float:
    """Time [s] at which a growing sum (n,) reaches a level, linear between samples."""
    return float(np.interp(level, growing, np.arange(len(growing)) * time_step))
