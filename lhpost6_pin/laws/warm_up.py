"""Friction that grows (a < 0: shrinks) with the mean speed of the last while, as seals warm up.

    f = -a h / (1 + h / h_s) Z,  T dh/dt = |v| - h

a [N s/m], h [m/s] mean speed, T [s] memory; h_s [m/s] mean speed at which half of the whole change a h_s is reached;
Z [1] the hysteresis of `bouc_wen`. Stored energy: none is declared, all work counts as dissipated. Source: the simplest
form that is linear in its amplitude, with a saturation, since a seal loses no more than its own friction.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .bouc_wen import advance_along, planar_rates
from .contract import Law

__all__ = ["LAW", "WarmUp", "advance", "force", "rates"]


class WarmUp(NamedTuple):
    """Parameters."""

    growth: Annotated[float, "N s/m"]
    yield_slip: Annotated[float, "m"]
    shape: Annotated[float, "1"]
    memory: Annotated[float, "s"]
    saturation: Annotated[float, "m/s"]  # h_s


LAW = Law(WarmUp, states=("z", "mean_speed"), amplitude=("growth", "saturation"))


@compiled
def force(p: WarmUp, z: float, mean_speed: float) -> float:
    """Friction [N] in proportion to the mean speed, up to its saturation."""
    return -p.growth * mean_speed / (1.0 + mean_speed / p.saturation) * z


@compiled
def rates(p: WarmUp, v: float, z: float, mean_speed: float) -> tuple[float, float]:
    """Rates of Z [1/s] and of the mean speed [m/s2]."""
    return planar_rates(v, 0.0, z, 0.0, p.yield_slip, p.shape)[0], (abs(v) - mean_speed) / p.memory


@compiled
def advance(p: WarmUp, d: float, dt: float, z: float, mean_speed: float) -> tuple[float, float]:
    """Z and mean speed after a slip [m] at constant velocity over dt [s]: exact."""
    gain = -math.expm1(-dt / p.memory)
    return advance_along(d, z, p.yield_slip, p.shape), mean_speed + gain * (abs(d) / dt - mean_speed)
