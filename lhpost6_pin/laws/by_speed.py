"""A force that a table gives by the rate of its port (`tabulated`)."""

from ..core.compiled import compiled
from .contract import Law
from .tabulated import Table, table_force

__all__ = ["LAW", "force"]

LAW = Law(Table)


@compiled
def force(p: Table, v: float) -> float:
    """Force [N]."""
    return p.share * table_force(v, p.first, p.last, p.force)
