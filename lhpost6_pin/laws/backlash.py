"""Friction behind a loose joint: after each reversal the joint's gap is crossed before anything rubs.

    de/dt = v while |e| < g + Y, else zero outwards;  f = -F/Y dz(e, g)

e [m] what the joint has moved since it was centred, g [m] half its gap, Y [m] elastic slip, F [N] sliding force,
dz(e, g) = e beyond +-g, zero within. Moving on, the contact slides at |e| = g + Y with |f| = F; a reversal unloads it,
then crosses 2 g without any force. With g = 0 it is an elastic, perfectly plastic friction.
Stored energy: F dz^2 / (2 Y). Source: play and dead zone in series with Coulomb friction, elementary.
"""

from ..core.compiled import compiled

__all__ = ["advance_offset", "backlash_energy", "backlash_force", "offset_rate"]


@compiled
def backlash_force(offset: float, friction: float, yield_slip: float, gap: float) -> float:
    """Force [N] of the joint: -F/Y dz(e, g)."""
    beyond = max(0.0, offset - gap) + min(0.0, offset + gap)
    return -friction / yield_slip * beyond


@compiled
def backlash_energy(offset: float, friction: float, yield_slip: float, gap: float) -> float:
    """Elastic energy [J]: F dz^2 / (2 Y)."""
    beyond = max(0.0, offset - gap) + min(0.0, offset + gap)
    return 0.5 * friction / yield_slip * beyond * beyond


@compiled
def advance_offset(offset: float, slip: float, yield_slip: float, gap: float) -> float:
    """Offset e [m] after a slip [m]: exact."""
    limit = gap + yield_slip
    return min(limit, max(-limit, offset + slip))


@compiled
def offset_rate(offset: float, velocity: float, yield_slip: float, gap: float) -> float:
    """Rate [m/s] of the offset: the slip's but for outwards at a limit."""
    limit = gap + yield_slip
    if (offset >= limit and velocity > 0.0) or (offset <= -limit and velocity < 0.0):
        return 0.0
    return velocity
