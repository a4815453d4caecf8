"""A force that is given by a table: linear between equally spaced values, and as at its end beyond them.

    f = -a (f_k (1 - w) + f_k+1 w),   w and k from (x - x_0) / (x_1 - x_0) (n - 1)

x [m or m/s] what the force depends on, x_0 and x_1 the table's ends, f [N] its n values, a [1] its share. What a search
has found and has no name for is such a force. No potential is declared: all work counts as dissipated, and may be
negative. Kernel of `by_position`, `by_speed` and `by_memory`.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled

__all__ = ["NODES", "Table", "table_force"]

NODES = 24
"""Values of a table."""


class Table(NamedTuple):
    """Parameters."""

    share: Annotated[float, "1"]
    first: Annotated[float, "m | m/s"]
    last: Annotated[float, "m | m/s"]
    force: Annotated[NDArray[np.float64], "N", NODES]


@compiled
def table_force(x: float, first: float, last: float, values: NDArray[np.float64]) -> float:
    """Force [N] at x, from `values` (n,) at n points from `first` to `last`."""
    steps = values.size - 1
    place = min(max((x - first) / (last - first) * steps, 0.0), float(steps))
    k = min(int(place), steps - 1)
    return -(values[k] + (place - k) * (values[k + 1] - values[k]))
