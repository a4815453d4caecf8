"""A spring that begins at a distance from the middle of the stroke.

    f = -F ((|s| - s_0)_+ / d)^n sgn s     nothing within s_0; F [N] at d = 0.1 m beyond it

s [m or rad], n [1] >= 1; with s_0 = 0, n = 3 a cubic spring. Stored energy: F d / (n + 1) ((|s| - s_0)_+ / d)^(n + 1).
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "REACH", "EndStop", "force", "power"]

REACH = 0.1
"""Stroke beyond the start of an end stop at which its force is stated [m]."""


class EndStop(NamedTuple):
    """Parameters."""

    force: Annotated[float, "N"]
    start: Annotated[float, "m"]  # s_0
    exponent: Annotated[float, "1"]


LAW = Law(EndStop, stores_energy=True)


@compiled
def force(p: EndStop, s: float) -> float:
    """Force [N]."""
    beyond = (abs(s) - p.start) / REACH
    if beyond <= 0.0:
        return 0.0
    return -math.copysign(p.force * beyond**p.exponent, s)


@compiled
def power(p: EndStop, s: float) -> tuple[float, float]:
    """Dissipated power [W], none, and stored energy [J]."""
    beyond = (abs(s) - p.start) / REACH
    if beyond <= 0.0:
        return 0.0, 0.0
    return 0.0, p.force * REACH / (p.exponent + 1.0) * beyond ** (p.exponent + 1.0)
