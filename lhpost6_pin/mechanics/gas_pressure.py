"""Gas pressure of struts with all that acts on the gas: leaks and heat exchange beyond the polytropic law."""

import numpy as np
from numpy.typing import NDArray

from ..effects.gas import log_ratio
from ..effects.registry import law_of
from .plant import Plant

__all__ = ["gas_ratio"]

Array = NDArray[np.float64]


def gas_ratio(plant: Plant, z: Array) -> Array:
    """Gas pressure over the nominal one of Eq. 4-7 (n, n_struts) [1] at hidden states z (n, n_states).

    Changes add up, as their forces do.
    """
    ratio = np.ones((len(z), len(plant.machine.struts)))
    for row in plant.rows:
        if law_of(row).acts_on_gas:
            ratio[:, row["port"] - plant.spools] += np.expm1(log_ratio(row, z))
    return ratio
