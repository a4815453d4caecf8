"""Nitrogen hold-down strut (Eqs. 4-7 and 4-8).

P = P_0 (1 + dL/L_c0)^-n,  f = -P A

P [Pa] gas pressure, P_0 that in the control zero-position, dL [m] elongation, L_c0 [m] gas length, n [1] polytropic
index, A [m2] effective area; f [N] pulls the platen down. Valid for dL > -L_c0.
Stored energy: potential U(dL) with f = -dU/dL, zero at dL = 0. Source: report Section 4.2.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "Gas", "force", "gas_pressure", "potential", "power"]


class Gas(NamedTuple):
    """Parameters."""

    pressure: Annotated[float, "Pa"]  # P_0
    area: Annotated[float, "m2"]
    gas_length: Annotated[float, "m"]  # L_c0
    polytropic_index: Annotated[float, "1"]


LAW = Law(Gas, stores_energy=True, inlined=True, acts_on_gas=True)


@compiled
def gas_pressure(elongation: float, pressure: float, gas_length: float, index: float) -> float:
    """Gas pressure [Pa] (Eq. 4-7)."""
    return pressure * (1.0 + elongation / gas_length) ** -index


@compiled
def force(p: Gas, s: float) -> float:
    """Axial force on the platen [N], negative: a pull (Eq. 4-8)."""
    return -gas_pressure(s, p.pressure, p.gas_length, p.polytropic_index) * p.area


@compiled
def potential(p: Gas, s: float) -> float:
    """Potential energy [J] of Eq. 4-8: P_0 A L_c0 ((1 + dL/L_c0)^(1-n) - 1)/(1-n), a logarithm at n = 1."""
    stretch = 1.0 + s / p.gas_length
    if abs(p.polytropic_index - 1.0) < 1e-9:
        return p.pressure * p.area * p.gas_length * math.log(stretch)
    return (
        p.pressure * p.area * p.gas_length * (stretch ** (1.0 - p.polytropic_index) - 1.0) / (1.0 - p.polytropic_index)
    )


@compiled
def power(p: Gas, s: float) -> tuple[float, float]:
    """Dissipated power [W], none, and stored energy [J]."""
    return 0.0, potential(p, s)
