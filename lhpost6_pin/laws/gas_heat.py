"""Heat that the gas of a strut exchanges with its wall.

    y = a h,  T dh/dt = (n - 1) ln(1 + dL/L_c0) - h

T [s] time constant. With a = 1 slow strokes are isothermal and fast ones polytropic with n; a share a [1] goes that far
between them.

P = P_n exp(y), P_n the pressure of `nitrogen_strut`; force beyond the nominal one: f_n (exp(y) - 1). Stored energy: the
nominal potential times exp(y) - 1; what y changes in it is taken or given by the wall. Source: ideal gas
with the nominal index as that of a stroke without heat,
T dh/dt from Newton's law of cooling; derived here.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law
from .nitrogen_strut import Gas, potential
from .nitrogen_strut import force as nominal_force

__all__ = ["LAW", "GasHeat", "advance", "force", "log_ratio", "power", "rates"]


class GasHeat(NamedTuple):
    """Parameters."""

    share: Annotated[float, "1"]
    pressure: Annotated[float, "Pa"]
    area: Annotated[float, "m2"]
    gas_length: Annotated[float, "m"]
    polytropic_index: Annotated[float, "1"]
    time_constant: Annotated[float, "s"]


LAW = Law(
    GasHeat,
    states=("exchanged",),
    amplitude=("share", "pressure", "area"),
    stores_energy=True,
    acts_on_gas=True,
    follows_motion=True,
)


@compiled
def log_ratio(p: GasHeat, exchanged: float) -> float:
    """Ln P/P_n."""
    return p.share * exchanged


@compiled
def _gas(p: GasHeat) -> Gas:
    return Gas(p.pressure, p.area, p.gas_length, p.polytropic_index)


@compiled
def _slow(p: GasHeat, elongation: float) -> float:
    """Where h goes if there is time [1]: (n - 1) ln(1 + dL/L_c0)."""
    return (p.polytropic_index - 1.0) * math.log1p(elongation / p.gas_length)


@compiled
def force(p: GasHeat, s: float, exchanged: float) -> float:
    """Force [N] beyond the nominal one."""
    return nominal_force(_gas(p), s) * math.expm1(log_ratio(p, exchanged))


@compiled
def rates(p: GasHeat, s: float, exchanged: float) -> float:
    """Rate of h [1/s]."""
    return (_slow(p, s) - exchanged) / p.time_constant


@compiled
def advance(p: GasHeat, s: float, d: float, dt: float, exchanged: float) -> float:
    """Heat h [1] after dt [s], while where it goes changes linearly: exact."""
    start, end = _slow(p, s), _slow(p, s + d)
    ratio = dt / p.time_constant
    gain = -math.expm1(-ratio)
    return exchanged + gain * (start - exchanged) + (end - start) * (1.0 - gain / ratio)


@compiled
def power(p: GasHeat, s: float, exchanged: float) -> tuple[float, float]:
    """Power [W] that the wall takes, and stored energy [J]."""
    held, change = potential(_gas(p), s), math.expm1(log_ratio(p, exchanged))
    return -held * (1.0 + change) * p.share * rates(p, s, exchanged), held * change
