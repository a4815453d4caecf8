"""Peaks of a motion that the low-pass of its target takes away: what the table is asked for is less than the motion."""

import numpy as np

from .motion import AXES

__all__ = ["lost_peaks"]

_INSIGNIFICANT = 1e-3  # of the largest peak of its kind, up to which an axis counts as not moved


def lost_peaks(name: str, given: np.ndarray, kept: np.ndarray, corner: float, allowed: float, unit: str) -> str:
    """A sentence on the axis whose peak falls by most, and the remedy; empty if none falls by more than `allowed`.

    given, kept (n, 6): the motion and what a low-pass at `corner` [Hz] leaves of it, in m or m/s^2 as `unit` says,
    rotations in rad or rad/s^2.
    """
    peak, left = np.abs(given).max(axis=0), np.abs(kept).max(axis=0)
    least = _INSIGNIFICANT * np.repeat([peak[:3].max(), peak[3:].max()], 3)
    share = np.divide(left, peak, out=np.ones(len(AXES)), where=peak > least)
    lost = np.flatnonzero(share < 1.0 - allowed)
    if not lost.size:
        return ""
    k = int(lost[np.argmin(share[lost])])
    unit = unit if k < 3 else unit.replace("m", "rad", 1)
    others = ", ".join(AXES[i] for i in lost if i != k)
    return (
        f"{name}: the low-pass at {corner:g} Hz leaves {left[k]:.3g} {unit} of its peak of {peak[k]:.3g} {unit} in "
        f"{AXES[k]}{f' (less of {others}, too)' if others else ''}: that is the target. A higher --low-pass keeps more "
        "of it, as far as the table's band reaches"
    )
