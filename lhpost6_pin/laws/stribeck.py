"""Friction that is larger at rest than in motion: breakaway.

    f = -F_s exp(-(v/v_s)^2) Z

F_s [N], v, v_s [m/s]; Z [1] the hysteresis of `bouc_wen`. Stored energy: none is declared, all work counts as
dissipated. Source: Stribeck's curve as in Armstrong-Helouvry et al. (1994).
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .bouc_wen import advance_along, planar_rates
from .contract import Law

__all__ = ["LAW", "Stribeck", "advance", "force", "rates"]


class Stribeck(NamedTuple):
    """Parameters."""

    friction: Annotated[float, "N"]  # F_s, lost in motion
    yield_slip: Annotated[float, "m"]
    shape: Annotated[float, "1"]
    speed: Annotated[float, "m/s"]  # v_s


LAW = Law(Stribeck, states=("z",), amplitude=("friction", "speed"))


@compiled
def force(p: Stribeck, v: float, z: float) -> float:
    """Friction [N] that is lost in motion."""
    ratio = v / p.speed
    return -p.friction * math.exp(-ratio * ratio) * z


@compiled
def rates(p: Stribeck, v: float, z: float) -> float:
    """Rate of Z [1/s]."""
    return planar_rates(v, 0.0, z, 0.0, p.yield_slip, p.shape)[0]


@compiled
def advance(p: Stribeck, d: float, z: float) -> float:
    """Z after a slip [m]: exact."""
    return advance_along(d, z, p.yield_slip, p.shape)
