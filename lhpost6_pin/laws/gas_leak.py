"""Gas that a strut loses: y = -(y_0 + r t), at a rate r [1/s], a share y_0 before the test.

P = P_n exp(y), P_n the pressure of `nitrogen_strut`; force beyond the nominal one: f_n (exp(y) - 1). Stored energy: the
nominal potential times exp(y) - 1; what y changes in it is taken or given by the gas that leaves. Source: ideal gas
with the nominal index as that of a stroke without heat; derived here.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law
from .nitrogen_strut import Gas, potential
from .nitrogen_strut import force as nominal_force

__all__ = ["LAW", "GasLeak", "advance", "force", "log_ratio", "power", "rates"]


class GasLeak(NamedTuple):
    """Parameters."""

    rate: Annotated[float, "1/s"]
    pressure: Annotated[float, "Pa"]
    area: Annotated[float, "m2"]
    gas_length: Annotated[float, "m"]
    polytropic_index: Annotated[float, "1"]
    lost: Annotated[float, "1"]  # y_0


LAW = Law(GasLeak, states=("time",), amplitude=GasLeak._fields, stores_energy=True, acts_on_gas=True)


@compiled
def log_ratio(p: GasLeak, time: float) -> float:
    """Ln P/P_n."""
    return -(p.lost + p.rate * time)


@compiled
def _gas(p: GasLeak) -> Gas:
    return Gas(p.pressure, p.area, p.gas_length, p.polytropic_index)


@compiled
def force(p: GasLeak, s: float, time: float) -> float:
    """Force [N] beyond the nominal one."""
    return nominal_force(_gas(p), s) * math.expm1(log_ratio(p, time))


@compiled
def rates(p: GasLeak, time: float) -> float:
    """Rate of the time since the start of the test [1]."""
    return 1.0


@compiled
def advance(p: GasLeak, dt: float, time: float) -> float:
    """Time since the start of the test [s]."""
    return time + dt


@compiled
def power(p: GasLeak, s: float, time: float) -> tuple[float, float]:
    """Power [W] that leaves with the gas, and stored energy [J]."""
    held, change = potential(_gas(p), s), math.expm1(log_ratio(p, time))
    return held * (1.0 + change) * p.rate, held * change
