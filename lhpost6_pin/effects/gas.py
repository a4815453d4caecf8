"""What effects do to the gas of a strut beyond the polytropic law."""

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled_inline
from ..laws import gas_heat, gas_leak
from . import views
from .registry import CODES, parameters_of

__all__ = ["log_ratio", "log_ratio_at"]

_HEAT, _LEAK = CODES["gas_heat"], CODES["gas_leak"]
_LAWS = {_HEAT: gas_heat, _LEAK: gas_leak}


def log_ratio(row: np.void, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ln P/P_n (n,) of a row at hidden states z (n, n_states), P_n the pressure of Eq. 4-7; zeros for other laws."""
    law = _LAWS.get(int(row["law"]))
    if law is None:
        return np.zeros(len(z))
    ratio = law.log_ratio.py_func  # the scalar law as plain Python takes whole columns
    return np.asarray(ratio(parameters_of(row), z[:, row["state"]]))


@compiled_inline
def log_ratio_at(row, z):
    """`log_ratio` at one instant, hidden states z (n_states,)."""
    if row.law == _HEAT:
        return gas_heat.log_ratio(views.view_gas_heat(row.numbers), z[row.state])
    if row.law == _LEAK:
        return gas_leak.log_ratio(views.view_gas_leak(row.numbers), z[row.state])
    return 0.0
