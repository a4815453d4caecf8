"""Elastic response spectra by the exact recurrence for piecewise-linear ground acceleration."""

from math import factorial
from typing import NamedTuple

import numpy as np

__all__ = ["ResponseSpectrum", "response_spectrum"]


_TERMS = 60  # of the power series: (2 pi)^60 / 60! = 1e-34 at a period of one time step


class ResponseSpectrum(NamedTuple):
    """Peak response of damped oscillators to one ground acceleration."""

    period: np.ndarray  # (m,) [s]
    displacement: np.ndarray  # (m,) SD, peak displacement relative to the ground [m]
    pseudo_velocity: np.ndarray  # (m,) PSV = SD w [m/s]
    pseudo_acceleration: np.ndarray  # (m,) PSA = SD w^2 [m/s^2]


def response_spectrum(
    acceleration: np.ndarray, time_step: float, periods: np.ndarray, damping: float = 0.05
) -> ResponseSpectrum:
    """Response spectrum of a ground `acceleration` (n,) [m/s^2] at oscillator `periods` (m,) [s].

    Solves u'' + 2 D w u' + w^2 u = -a(t) from rest, exactly for `a` linear between samples (Nigam and
    Jennings 1969), by the two-state recurrence x[i+1] = A x[i] + b0 a[i] + b1 a[i+1]. Peaks are taken at the
    samples, so keep the time step below a tenth of the shortest period.

    Raises ValueError for a time step that is not positive, a period below it, or damping outside [0, 1).
    """
    from .oscillators import fill_peaks  # compiled: motions that need no spectrum need no compiler

    acceleration = np.asarray(acceleration, dtype=float)
    periods = np.atleast_1d(np.asarray(periods, dtype=float))
    if acceleration.ndim != 1 or len(acceleration) < 2:
        raise ValueError(f"acceleration has shape {acceleration.shape}; give one channel (n,)")
    if not (time_step > 0 and (periods >= time_step).all() and 0 <= damping < 1):
        raise ValueError("time step must be positive, periods at least the time step, damping in [0, 1)")
    frequency = 2 * np.pi / periods
    peaks = np.full_like(periods, np.nan)  # of an acceleration with gaps
    if np.isfinite(acceleration).all():
        fill_peaks(np.ascontiguousarray(acceleration), *_recurrence(frequency * time_step, damping), peaks)
    displacement = peaks * time_step**2
    return ResponseSpectrum(periods, displacement, displacement * frequency, displacement * frequency**2)


def _recurrence(angle: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A (m, 2, 2), b0 (m, 2), b1 (m, 2) for oscillators turning by `angle` (m,) [rad] a step.

    With time in steps and the state (u, u'/angle) the system matrix is angle K, K = [[0, 1], [-1, -2 D]]. The
    exponential and its integrals over the step, phi_k = sum_j (angle K)^j / (j + k)!, are power series in the
    angle with the same matrices K^j for all oscillators. They lose no digits for long periods, where the
    textbook formulas subtract nearly equal numbers.
    """
    order = np.arange(_TERMS)
    steps = np.array([np.linalg.matrix_power([[0.0, 1.0], [-1.0, -2 * damping]], j) for j in order])
    weights = [1 / np.array([factorial(j + k) for j in order], dtype=float) for k in range(3)]
    powers = angle[:, None] ** order  # (m, terms)
    transition = np.einsum("mj,j,jab->mab", powers, weights[0], steps)
    constant, slope = (-np.einsum("mj,j,ja->ma", powers / angle[:, None], w, steps[:, :, 1]) for w in weights[1:])
    return transition, constant - slope, slope
