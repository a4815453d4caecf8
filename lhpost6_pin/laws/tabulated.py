"""A force that is given by a table: linear between equally spaced values, and as at its end beyond them.

    f = -f_k (1 - w) - f_k+1 w,   w and k from (x - x_0) / (x_1 - x_0) (n - 1)

x [m or m/s] position or speed, or of a fading memory of positions, T dy/dt + y = s, what it holds, y, or by how much s
is away from it; x_0 and x_1 the table's ends, f [N] its n values. What a search has found and has no name for is such a
force. No potential is declared: all work counts as dissipated, and may be negative.
"""

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled

__all__ = ["remembered", "table_force"]


@compiled
def remembered(position: float, past: float, which: float) -> float:
    """The remembered position [m] where `which` is 1, by how much the position is away from it where it is 0."""
    return which * past + (1.0 - which) * (position - past)


@compiled
def table_force(x: float, first: float, last: float, values: NDArray[np.float64]) -> float:
    """Force [N] at x, from `values` (n,) at n points from `first` to `last`."""
    steps = values.size - 1
    place = min(max((x - first) / (last - first) * steps, 0.0), float(steps))
    k = min(int(place), steps - 1)
    return -(values[k] + (place - k) * (values[k + 1] - values[k]))
