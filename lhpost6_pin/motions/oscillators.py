"""Oscillators under ground acceleration, many at once, in compiled code."""

import numpy as np

from ..core.compiled import compiled

__all__ = ["fill_peaks"]


@compiled
def fill_peaks(acceleration, transition, before, after, peaks):  # type: ignore[no-untyped-def]
    """Largest |u| (m,) of each oscillator, from rest: u[0] = u'[0] = 0 whatever a[0] is."""
    m = peaks.size
    a11, a12 = transition[:, 0, 0].copy(), transition[:, 0, 1].copy()
    a21, a22 = transition[:, 1, 0].copy(), transition[:, 1, 1].copy()
    b0, b1, c0, c1 = before[:, 0].copy(), before[:, 1].copy(), after[:, 0].copy(), after[:, 1].copy()
    u, v = np.zeros(m), np.zeros(m)
    peaks[:] = 0.0
    for k in range(acceleration.size - 1):
        first, second = acceleration[k], acceleration[k + 1]
        for i in range(m):  # several oscillators at once
            moved = a11[i] * u[i] + a12[i] * v[i] + b0[i] * first + c0[i] * second
            v[i] = a21[i] * u[i] + a22[i] * v[i] + b1[i] * first + c1[i] * second
            u[i] = moved
            peaks[i] = max(peaks[i], abs(moved))
