"""A linear spring on a port, and on a second one by its lever: f = -k (s + b s_2), b f on the second.

s [m or rad], k [N/m or N m/rad], b [m]. Stored energy: k (s + b s_2)^2 / 2, zero at s = 0.
"""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "Spring", "force", "power"]


class Spring(NamedTuple):
    """Parameters."""

    stiffness: Annotated[float, "N/m | N m/rad"]
    lever: Annotated[float, "m"]


LAW = Law(Spring, ports=(1, 2), stores_energy=True)


@compiled
def force(p: Spring, s: float, s_2: float) -> tuple[float, float]:
    """Forces [N or N m]."""
    f = -p.stiffness * (s + p.lever * s_2)
    return f, p.lever * f


@compiled
def power(p: Spring, s: float, s_2: float) -> tuple[float, float]:
    """Dissipated power [W], none, and stored energy [J]."""
    stretch = s + p.lever * s_2
    return 0.0, 0.5 * p.stiffness * stretch * stretch
