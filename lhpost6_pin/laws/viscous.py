"""Linear viscous damping (Eq. 4-19): f = -C_v v, C_v [N s/m], v [m/s]. Stored energy: none; dissipates C_v v^2."""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "Viscous", "force"]


class Viscous(NamedTuple):
    """Parameters."""

    coefficient: Annotated[float, "N s/m"]


LAW = Law(Viscous, inlined=True)


@compiled
def force(p: Viscous, v: float) -> float:
    """Viscous force [N] (or [N m] on a rotation) (Eq. 4-19)."""
    return -p.coefficient * v
