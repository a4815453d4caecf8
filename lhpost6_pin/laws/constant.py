"""A constant force, such as weight that the model lacks: f = F. Stored energy: none is declared."""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "Constant", "force"]


class Constant(NamedTuple):
    """Parameters."""

    force: Annotated[float, "N | N m"]


LAW = Law(Constant)


@compiled
def force(p: Constant) -> float:
    """The force [N] (or moment [N m])."""
    return p.force
