"""Gas pressure of struts with all that acts on the gas: leaks and heat exchange beyond the polytropic law."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects.evaluate_added import gas_log_ratio
from ..effects.registry import GAS_HEAT, GAS_LEAK
from .plant import Plant

__all__ = ["gas_ratio"]

Array = NDArray[np.float64]


def gas_ratio(plant: Plant, z: Array) -> Array:
    """Gas pressure over the nominal one of Eq. 4-7 (n, n_struts) [1] at hidden states z (n, n_states).

    Changes add up, as their forces do.
    """
    ratio = np.ones((len(z), len(plant.machine.struts)))
    law: Any = gas_log_ratio
    for row in plant.rows.view(np.recarray):
        if row.law in (GAS_LEAK, GAS_HEAT):
            ratio[:, row.port - plant.spools] += np.expm1(law.py_func(row, z.T))
    return ratio
