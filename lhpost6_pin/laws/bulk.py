"""Stiffness of oil that holds air, or that has come down to its vapour pressure.

1/beta(P) = 1/beta + alpha (P_0/P)^(1/n) / (n P)                  entrained air
dP/dt     = (1 - c) beta(P) / V (Q - dV/dt)  where  P < P_v       voids open in place of a fall

alpha [1] share of air by volume at the standard atmosphere P_0, n [1] its polytropic index; P_v [Pa] pressure at which
voids open, c [1] how much of the stiffness they take: 1 lets the pressure fall no further.

Stored energy: as `chamber`, with h'(P) = 1 + h/beta(P), whatever beta(P): a chamber holds V (h(P) - P).
Source: Merritt (1967), Section 2.2; energy derived here.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["ATMOSPHERE", "Cavitation", "EntrainedAir", "LAWS", "air_modulus", "enthalpy_of", "void_share"]


class EntrainedAir(NamedTuple):
    """Parameters of air in the oil."""

    air: Annotated[float, "1"]
    polytropic_index: Annotated[float, "1"]


class Cavitation(NamedTuple):
    """Parameters of voids."""

    share: Annotated[float, "1"]
    vapour_pressure: Annotated[float, "Pa"]


LAWS = {
    "entrained_air": Law(EntrainedAir, modifies="oil", fields=("air", "air_index")),
    "cavitation": Law(Cavitation, modifies="oil", fields=("voids", "vapour_pressure")),
}

ATMOSPHERE = 101325.0
"""Standard atmosphere [Pa], by definition: at it the share of air is counted."""

_STEPS = 64
"""Of the integral of the enthalpy: a millionth of what oil gains by pressure."""


@compiled
def air_modulus(pressure: float, bulk: float, air: float, index: float, lowest: float) -> float:
    """Bulk modulus [Pa] of oil with air in it; below the pressure `lowest` [Pa] that at it."""
    p = max(pressure, lowest)
    return 1.0 / (1.0 / bulk + air * (ATMOSPHERE / p) ** (1.0 / index) / (index * p))


@compiled
def void_share(pressure: float, vapour: float, share: float) -> float:
    """What voids leave of the stiffness [1]: all of it above the vapour pressure [Pa]."""
    return 1.0 - share if pressure < vapour else 1.0


@compiled
def enthalpy_of(
    pressure: float, bulk: float, air: float, index: float, vapour: float, share: float, lowest: float
) -> float:
    """Energy that oil carries across a boundary per volume [J/m3]: h' = 1 + h/beta(P) from h = P at `lowest` [Pa].

    With u = ln P, d = h - P: dd/du = P (P + d) / beta(P), by Runge-Kutta.
    """
    if pressure <= lowest:
        return pressure
    step = math.log(pressure / lowest) / _STEPS
    grow = math.exp(0.5 * step)
    p, d = lowest, 0.0
    soft = air_modulus(p, bulk, air, index, lowest) * max(void_share(p, vapour, share), 1e-6)
    for _ in range(_STEPS):
        mid, end = p * grow, p * grow * grow
        soft_mid = air_modulus(mid, bulk, air, index, lowest) * max(void_share(mid, vapour, share), 1e-6)
        soft_end = air_modulus(end, bulk, air, index, lowest) * max(void_share(end, vapour, share), 1e-6)
        k1 = p * (p + d) / soft
        k2 = mid * (mid + d + 0.5 * step * k1) / soft_mid
        k3 = mid * (mid + d + 0.5 * step * k2) / soft_mid
        k4 = end * (end + d + step * k3) / soft_end
        d += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        p, soft = end, soft_end
    return pressure + d
