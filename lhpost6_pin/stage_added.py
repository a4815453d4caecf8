"""Laws beyond the report, as the stage calls them: force, rate and step of hidden states of one row of the table."""

from .compiled import compiled
from .law_table import CONSTANT

__all__ = ["added_force", "added_rates", "advance_added"]


@compiled
def added_force(rows, i, s, sd, z):
    """Force of row i on its port and on its second port [N or N m]."""
    row = rows[i]
    p = row.p
    if row.law == CONSTANT:
        return p[0], 0.0
    return 0.0, 0.0


@compiled
def added_rates(rows, i, s, sd, z, zd):
    """Fill the rates of row i's hidden states."""


@compiled
def advance_added(rows, i, s, ds, dt, z):
    """Advance row i's hidden states over one step in which the ports move by ds from s."""
