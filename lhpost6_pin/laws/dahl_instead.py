"""Friction of Dahl's form in place of the report's, in any share; with d_y = 0 along one direction.

Dahl's friction in two dimensions, which is LuGre's without damping of its bristles:

Y_d dd/dt = v - |v| d,  f = -F (d - Z)

v [m/s] slip velocity, Y_d [m] yield displacement, d [1] hysteretic state with |d| <= 1, F [N] share of the sliding
force; Z [1] is the hysteresis of `bouc_wen`, of which that share is taken back.
Rate-independent: only the slip's path counts. Stored energy: none is declared, all work counts as dissipated. Source:
Dahl (1968), exponent one; in two dimensions as the LuGre model of Velenis, Tsiotras and Canudas-de-Wit (2002).
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .bouc_wen import advance_along, advance_planar, friction_force, planar_rates
from .contract import Law

__all__ = ["LAW", "DahlInstead", "advance", "advance_dahl", "dahl_rate", "force", "rates"]


class DahlInstead(NamedTuple):
    """Parameters."""

    friction: Annotated[float, "N"]
    yield_slip: Annotated[float, "m"]  # of the form that is replaced
    shape: Annotated[float, "1"]
    dahl_yield: Annotated[float, "m"]


LAW = Law(DahlInstead, ports=(1, 2), states=("z_x", "z_y", "d_x", "d_y"), amplitude=("friction",))


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


@compiled
def force(p: DahlInstead, z_x: float, z_y: float, d_x: float, d_y: float) -> tuple[float, float]:
    """Friction forces [N] beyond those of the form that is replaced."""
    return friction_force(p.friction, d_x - z_x), friction_force(p.friction, d_y - z_y)


@compiled
def rates(
    p: DahlInstead, v: float, v_2: float, z_x: float, z_y: float, d_x: float, d_y: float
) -> tuple[float, float, float, float]:
    """Rates of Z and d [1/s]."""
    zd_x, zd_y = planar_rates(v, v_2, z_x, z_y, p.yield_slip, p.shape)
    dd_x, dd_y = dahl_rate(v, v_2, d_x, d_y, p.dahl_yield)
    return zd_x, zd_y, dd_x, dd_y


@compiled
def advance(
    p: DahlInstead, d: float, d_2: float, planar: bool, z_x: float, z_y: float, d_x: float, d_y: float
) -> tuple[float, float, float, float]:
    """Z and d after a straight slip [m]: exact."""
    after_x, after_y = advance_dahl(d, d_2, d_x, d_y, p.dahl_yield)
    if planar:
        z_x, z_y = advance_planar(d, d_2, z_x, z_y, p.yield_slip, p.shape)
    else:
        z_x = advance_along(d, z_x, p.yield_slip, p.shape)
    return z_x, z_y, after_x, after_y
