"""A force that a table gives by a fading memory of positions (`tabulated`): T dy/dt + y = s.

It depends on what the memory holds, y, or on s - y; T [s].
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled
from .contract import Law
from .lines import filter_shares
from .tabulated import NODES, table_force

__all__ = ["LAW", "MemoryTable", "advance", "force", "rates"]


class MemoryTable(NamedTuple):
    """Parameters."""

    share: Annotated[float, "1"]
    first: Annotated[float, "m"]
    last: Annotated[float, "m"]
    force: Annotated[NDArray[np.float64], "N", NODES]
    memory: Annotated[float, "s"]  # T
    past: Annotated[float, "1"]  # 1: by y, 0: by s - y


LAW = Law(MemoryTable, states=("past_position",), amplitude=("share", "first", "last", "force", "past"))


@compiled
def force(p: MemoryTable, s: float, past_position: float) -> float:
    """Force [N]."""
    x = p.past * past_position + (1.0 - p.past) * (s - past_position)
    return p.share * table_force(x, p.first, p.last, p.force)


@compiled
def rates(p: MemoryTable, s: float, past_position: float) -> float:
    """Rate [m/s] of the remembered position."""
    return (s - past_position) / p.memory


@compiled
def advance(p: MemoryTable, s: float, d: float, dt: float, past_position: float) -> float:
    """Remembered position [m] after a straight step [m] in dt [s]: exact."""
    stay, first, last = filter_shares(dt, p.memory)
    return stay * past_position + first * s + last * (s + d)
