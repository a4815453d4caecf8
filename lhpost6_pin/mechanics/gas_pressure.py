"""Gas pressure of struts with all that acts on the gas: leaks and heat exchange beyond the polytropic law."""

import numpy as np

from ..core.arrays import Array
from ..effects.gas import log_ratio
from ..laws.nitrogen_strut import gas_pressure
from ..machine.machine import Machine
from .plant import Plant

__all__ = ["gas_numbers", "gas_pressures", "gas_ratio", "strut_pressures"]


def gas_ratio(plant: Plant, z: Array) -> Array:
    """Gas pressure over the nominal one of Eq. 4-7 (n, n_struts) [1] at hidden states z (n, n_states).

    Changes add up, as their forces do.
    """
    ratio = np.ones((len(z), len(plant.machine.struts)))
    for row in plant.gas_rows:
        ratio[:, row["port"] - plant.spools] += np.expm1(log_ratio(row, z))
    return ratio


def strut_pressures(machine: Machine, elongation: Array) -> Array:
    """Nitrogen pressures (n, n_struts) [Pa] at elongations (n, n_struts) [m]: P_0 (1 + dL / L_c0)^-n (Eq. 4-7)."""
    return gas_pressures(gas_numbers(machine), elongation)


def gas_numbers(machine: Machine) -> Array:
    """Numbers of the nominal law (3, n_struts): P_0 [Pa], L_c0 [m], n [1]."""
    return np.array([(s.pressure, s.gas_length, s.polytropic_index) for s in machine.struts]).reshape(-1, 3).T


def gas_pressures(numbers: Array, elongation: Array) -> Array:
    """Nitrogen pressures as `strut_pressures`, of the numbers of a machine; not finite where no gas length is left."""
    law = gas_pressure.py_func  # type: ignore[attr-defined]  # the scalar law as plain Python takes whole columns
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(law(elongation, *numbers), np.float64)
