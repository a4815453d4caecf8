"""Friction that is larger at rest than in motion and that follows the velocity with a lag in slip.

    f = -F_s Z,  dZ/dt = |v| / Y (exp(-(v/v_s)^2) sgn v - Z)

F_s [N] lost in motion, v, v_s [m/s], Y [m] the slip in which bristles bend; Z [1]. Steady sliding gives Stribeck's
curve; a reversal within less slip than Y shows less of it (frictional lag). Beside friction of Dahl's form with the
same Y the sum has the steady curve of LuGre's model, Canudas-de-Wit et al. (1995), and its lag, with Y in place of Y
times the curve. Stored energy: none is declared, all work counts as dissipated.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "StribeckLag", "advance", "force", "rates"]


class StribeckLag(NamedTuple):
    """Parameters."""

    friction: Annotated[float, "N"]  # F_s, lost in motion
    yield_slip: Annotated[float, "m"]
    speed: Annotated[float, "m/s"]  # v_s


LAW = Law(StribeckLag, states=("z",), amplitude=("friction",))


@compiled
def _wanted(v: float, speed: float) -> float:
    """Z of steady sliding."""
    ratio = v / speed
    return math.copysign(math.exp(-ratio * ratio), v)


@compiled
def force(p: StribeckLag, z: float) -> float:
    """Friction [N] that is lost in motion."""
    return -p.friction * z


@compiled
def rates(p: StribeckLag, v: float, z: float) -> float:
    """Rate of Z [1/s]."""
    return abs(v) / p.yield_slip * (_wanted(v, p.speed) - z)


@compiled
def advance(p: StribeckLag, d: float, dt: float, z: float) -> float:
    """Z after a slip at a constant velocity: exact."""
    return z - math.expm1(-abs(d) / p.yield_slip) * (_wanted(d / dt, p.speed) - z)
