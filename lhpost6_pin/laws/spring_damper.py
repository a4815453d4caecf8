"""A linear spring and a damper in parallel on a port: f = -k s - c v.

s [m], v [m/s], k [N/m], c [N s/m]. Stored energy: none is declared, all work counts as dissipated (k s^2 / 2 of
it comes back; the damper takes c v^2).
"""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "SpringDamper", "force"]


class SpringDamper(NamedTuple):
    """Parameters."""

    stiffness: Annotated[float, "N/m"]
    damping: Annotated[float, "N s/m"]


LAW = Law(SpringDamper)


@compiled
def force(p: SpringDamper, s: float, v: float) -> float:
    """Force [N]."""
    return -p.stiffness * s - p.damping * v
