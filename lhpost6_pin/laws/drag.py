"""Force against the motion that grows with a power of the speed: f = -F (|v| / v_1)^p sgn v, F [N] at v_1 = 1 m/s.

v [m/s], p [1] > 0: quadratic with p = 2, viscous with p = 1. Stored energy: none, all work is dissipated.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "Drag", "force"]


class Drag(NamedTuple):
    """Parameters."""

    force: Annotated[float, "N"]
    exponent: Annotated[float, "1"]


LAW = Law(Drag)


@compiled
def force(p: Drag, v: float) -> float:
    """Force [N]."""
    return -math.copysign(p.force * abs(v) ** p.exponent, v)
