"""Friction that grows (a < 0: shrinks) with the mean slip speed of the last while, as seals and pads warm up.

    f = -a h / (1 + h / h_s) Z,  T dh/dt = |v| - h

a [N s/m], v [m/s] slip velocity, along a rod or in the plane of a pad, h [m/s] mean speed, T [s] memory; h_s [m/s]
mean speed at which half of the whole change a h_s is reached; Z [1] the hysteresis of `bouc_wen`. Stored energy: none
is declared, all work counts as dissipated. Source: the simplest form that is linear in its amplitude, with a
saturation, since a seal loses no more than its own friction.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .bouc_wen import advance_along, advance_planar, planar_rates
from .contract import Law

__all__ = ["LAW", "WarmUp", "advance", "force", "rates"]


class WarmUp(NamedTuple):
    """Parameters."""

    growth: Annotated[float, "N s/m"]
    yield_slip: Annotated[float, "m"]
    shape: Annotated[float, "1"]
    memory: Annotated[float, "s"]
    saturation: Annotated[float, "m/s"]  # h_s


LAW = Law(WarmUp, ports=(1, 2), states=("z_x", "z_y", "mean_speed"), amplitude=("growth", "saturation"))


@compiled
def force(p: WarmUp, z_x: float, z_y: float, mean_speed: float) -> tuple[float, float]:
    """Friction forces [N] in proportion to the mean speed, up to its saturation."""
    change = p.growth * mean_speed / (1.0 + mean_speed / p.saturation)
    return -change * z_x, -change * z_y


@compiled
def rates(p: WarmUp, v: float, v_2: float, z_x: float, z_y: float, mean_speed: float) -> tuple[float, float, float]:
    """Rates of Z [1/s] and of the mean speed [m/s2]."""
    rate_x, rate_y = planar_rates(v, v_2, z_x, z_y, p.yield_slip, p.shape)
    return rate_x, rate_y, (math.hypot(v, v_2) - mean_speed) / p.memory


@compiled
def advance(
    p: WarmUp, d: float, d_2: float, planar: bool, dt: float, z_x: float, z_y: float, mean_speed: float
) -> tuple[float, float, float]:
    """Z and mean speed after a straight slip [m] at constant velocity over dt [s]: exact."""
    mean = mean_speed - math.expm1(-dt / p.memory) * (math.hypot(d, d_2) / dt - mean_speed)
    if planar:
        z_x, z_y = advance_planar(d, d_2, z_x, z_y, p.yield_slip, p.shape)
        return z_x, z_y, mean
    return advance_along(d, z_x, p.yield_slip, p.shape), z_y, mean
