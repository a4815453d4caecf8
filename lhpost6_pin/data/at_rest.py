"""Which columns of a signal are at rest but for rounding, and so have no relative error."""

import numpy as np

from ..core.arrays import Array, Mask
from ..core.extremes import finite_peaks

__all__ = ["PLACE", "at_rest"]

SHARE = 1e-6
"""Of the largest peak of its kind, up to which a column is rounding; metres and radians, N and N m count alike."""

PLACE = float(np.finfo(np.float32).eps)
"""[m, rad] Rounding of a displacement in single precision, beside lengths of metres: no table moves as little."""


def at_rest(values: Array, largest: float = 0.0, place: bool = False) -> Mask:
    """Columns (k,) of values (n, k) that are rounding beside the largest of them, or beside a greater `largest`.

    `place`: the values are displacements, which `PLACE` limits, too. Values that are not finite do not count.
    """
    peak = np.maximum(finite_peaks(values), 0.0)
    limit = SHARE * max(largest, peak.max(initial=0.0))
    return np.asarray(peak <= (max(limit, PLACE) if place else limit))
