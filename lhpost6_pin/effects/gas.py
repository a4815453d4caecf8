"""What effects do to the gas of a strut beyond the polytropic law."""

import numpy as np
from numpy.typing import NDArray

from ..laws import gas_heat, gas_leak
from .registry import CODES, parameters_of

__all__ = ["log_ratio"]

_LAWS = {CODES["gas_heat"]: gas_heat, CODES["gas_leak"]: gas_leak}


def log_ratio(row: np.void, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ln P/P_n (n,) of a row at hidden states z (n, n_states), P_n the pressure of Eq. 4-7; zeros for other laws."""
    law = _LAWS.get(int(row["law"]))
    if law is None:
        return np.zeros(len(z))
    ratio = law.log_ratio.py_func  # the scalar law as plain Python takes whole columns
    return np.asarray(ratio(parameters_of(row), z[:, row["state"]]))
