"""Dahl's friction in two dimensions, which is LuGre's without damping of its bristles; along one direction if d_y = 0.

Y dd/dt = v - |v| d,  f = -F d

v [m/s] slip velocity, Y [m] yield displacement, d [1] hysteretic state with |d| <= 1, F [N] sliding force.
Rate-independent: only the slip's path counts. Stored energy: none is declared, all work counts as dissipated. Source:
Dahl (1968), exponent one; in two dimensions as the LuGre model of Velenis, Tsiotras and Canudas-de-Wit (2002).
"""

import math

from ..core.compiled import compiled

__all__ = ["advance_dahl", "dahl_rate"]


@compiled
def dahl_rate(v_x: float, v_y: float, d_x: float, d_y: float, yield_slip: float) -> tuple[float, float]:
    """Rates of d_x and d_y [1/s]; v [m/s], yield_slip [m]."""
    speed = math.sqrt(v_x * v_x + v_y * v_y)
    return (v_x - speed * d_x) / yield_slip, (v_y - speed * d_y) / yield_slip


@compiled
def advance_dahl(dx: float, dy: float, d_x: float, d_y: float, yield_slip: float) -> tuple[float, float]:
    """d_x and d_y after a straight slip (dx, dy) [m]: exact. d comes nearer to the direction of the slip, by e."""
    slip = math.sqrt(dx * dx + dy * dy)
    if slip == 0.0:
        return d_x, d_y
    gone = -math.expm1(-slip / yield_slip)
    return d_x + gone * (dx / slip - d_x), d_y + gone * (dy / slip - d_y)
