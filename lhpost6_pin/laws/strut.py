"""Nitrogen hold-down strut (Eqs. 4-7 and 4-8).

P = P_0 (1 + dL/L_c0)^-n,  f = -P A

P [Pa] gas pressure, P_0 that in the control zero-position, dL [m] elongation, L_c0 [m] gas length, n [1] polytropic
index, A [m2] effective area; f [N] pulls the platen down. Valid for dL > -L_c0.
Stored energy: potential U(dL) with f = -dU/dL, zero at dL = 0. Source: report Section 4.2.
"""

import math

from ..core.compiled import compiled

__all__ = ["gas_pressure", "strut_energy", "strut_force"]


@compiled
def gas_pressure(elongation: float, pressure: float, gas_length: float, index: float) -> float:
    """Gas pressure [Pa] (Eq. 4-7)."""
    return pressure * (1.0 + elongation / gas_length) ** -index


@compiled
def strut_force(elongation: float, pressure: float, area: float, gas_length: float, index: float) -> float:
    """Axial force on the platen [N], negative: a pull (Eq. 4-8)."""
    return -gas_pressure(elongation, pressure, gas_length, index) * area


@compiled
def strut_energy(elongation: float, pressure: float, area: float, gas_length: float, index: float) -> float:
    """Potential energy [J] of Eq. 4-8: P_0 A L_c0 ((1 + dL/L_c0)^(1-n) - 1)/(1-n), a logarithm at n = 1."""
    stretch = 1.0 + elongation / gas_length
    if abs(index - 1.0) < 1e-9:
        return pressure * area * gas_length * math.log(stretch)
    return pressure * area * gas_length * (stretch ** (1.0 - index) - 1.0) / (1.0 - index)
