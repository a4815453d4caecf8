"""A force that a table gives by the coordinate of its port (`tabulated`)."""

from ..core.compiled import compiled
from .contract import Law
from .tabulated import Table, table_force

__all__ = ["LAW", "force"]

LAW = Law(Table)


@compiled
def force(p: Table, s: float) -> float:
    """Force [N]."""
    return p.share * table_force(s, p.first, p.last, p.force)
