"""Friction behind a loose joint: after each reversal the joint's gap is crossed before anything rubs.

    de/dt = v while |e| < g + Y, else zero outwards;  f = -F/Y dz(e, g)

e [m] what the joint has moved since it was centred, g [m] half its gap, Y [m] elastic slip, F [N] sliding force,
dz(e, g) = e beyond +-g, zero within. Moving on, the contact slides at |e| = g + Y with |f| = F; a reversal unloads it,
then crosses 2 g without any force. With g = 0 it is an elastic, perfectly plastic friction.
Stored energy: F dz^2 / (2 Y). Source: play and dead zone in series with Coulomb friction, elementary.
"""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "Backlash", "advance", "force", "power", "rates"]


class Backlash(NamedTuple):
    """Parameters."""

    friction: Annotated[float, "N"]  # sliding force F
    yield_slip: Annotated[float, "m"]
    gap: Annotated[float, "m"]  # half of what is loose, g


LAW = Law(Backlash, states=("offset",), amplitude=("friction",), stores_energy=True)


@compiled
def force(p: Backlash, offset: float) -> float:
    """Force [N] of the joint: -F/Y dz(e, g)."""
    beyond = max(0.0, offset - p.gap) + min(0.0, offset + p.gap)
    return -p.friction / p.yield_slip * beyond


@compiled
def rates(p: Backlash, v: float, offset: float) -> float:
    """Rate [m/s] of the offset: the slip's but for outwards at a limit."""
    limit = p.gap + p.yield_slip
    if (offset >= limit and v > 0.0) or (offset <= -limit and v < 0.0):
        return 0.0
    return v


@compiled
def advance(p: Backlash, d: float, offset: float) -> float:
    """Offset e [m] after a slip [m]: exact."""
    limit = p.gap + p.yield_slip
    return min(limit, max(-limit, offset + d))


@compiled
def power(p: Backlash, offset: float, work: float) -> tuple[float, float]:
    """Dissipated power [W] and elastic energy F dz^2 / (2 Y) [J]: sliding at the limit all work is lost."""
    beyond = max(0.0, offset - p.gap) + min(0.0, offset + p.gap)
    slides = abs(offset) >= p.yield_slip + p.gap and work < 0.0
    return -work if slides else 0.0, 0.5 * p.friction / p.yield_slip * beyond * beyond
