"""Elastic response spectra by the exact recurrence for piecewise-linear ground acceleration."""

from typing import NamedTuple

import numpy as np

__all__ = ["ResponseSpectrum", "response_spectrum"]


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
    Jennings 1969). The two-state recurrence x[i+1] = A x[i] + b0 a[i] + b1 a[i+1] is run as a second-order
    filter on u; peaks are taken at the samples, so keep the time step below a tenth of the shortest period.

    Raises ValueError for a period or time step that is not positive or damping outside [0, 1).
    """
    from scipy.signal import lfilter

    acceleration = np.asarray(acceleration, dtype=float)
    periods = np.atleast_1d(np.asarray(periods, dtype=float))
    if acceleration.ndim != 1 or len(acceleration) < 2:
        raise ValueError(f"acceleration has shape {acceleration.shape}; give one channel (n,)")
    if not (time_step > 0 and (periods > 0).all() and 0 <= damping < 1):
        raise ValueError("time step and periods must be positive, damping in [0, 1)")
    frequency = 2 * np.pi / periods
    peaks = np.empty_like(periods)
    for i, (transition, before, after) in enumerate(
        zip(*_recurrence(frequency * time_step, damping), strict=True)
    ):
        (a11, a12), (a21, a22) = transition
        poles = [1.0, -(a11 + a22), a11 * a22 - a12 * a21]
        zeros = [
            after[0],
            before[0] - a22 * after[0] + a12 * after[1],
            a12 * before[1] - a22 * before[0],
        ]
        # filter memory that makes u[0] = 0 and u'[0] = 0 whatever a[0] is
        memory = [-after[0] * acceleration[0], (before[0] - zeros[1]) * acceleration[0]]
        response, _ = lfilter(zeros, poles, acceleration, zi=memory)
        peaks[i] = max(response.max(), -response.min())
    displacement = peaks * time_step**2
    return ResponseSpectrum(periods, displacement, displacement * frequency, displacement * frequency**2)


def _recurrence(angle: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A (m, 2, 2), b0 (m, 2), b1 (m, 2) in time steps, from one matrix exponential.

    State (u, u'), then the ground acceleration and its slope, which stay linear within the step. Time in
    steps keeps all entries near one, where the textbook formulas lose digits for long periods.
    """
    from scipy.linalg import expm

    system = np.zeros((len(angle), 4, 4))
    system[:, 0, 1] = 1.0
    system[:, 1, 0] = -(angle**2)
    system[:, 1, 1] = -2 * damping * angle
    system[:, 1, 2] = -1.0
    system[:, 2, 3] = 1.0
    step = expm(system)
    slope = step[:, :2, 3]
    return step[:, :2, :2], step[:, :2, 2] - slope, slope
