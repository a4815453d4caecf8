"""What a valve does to its command before the ports see it: a later or slower answer than the machine states.

    delay   x(t) = c(t - tau)             lag   T dx/dt + x = c

Both act on the command path of a valve (`mechanics.valve_delay`). Stored energy: none.
"""

from typing import Annotated, NamedTuple

from .contract import Law

__all__ = ["LAWS", "ValveDelay", "ValveLag"]


class ValveDelay(NamedTuple):
    """Parameters of a longer delay."""

    delay: Annotated[float, "s"]


class ValveLag(NamedTuple):
    """Parameters of a first-order lag."""

    time: Annotated[float, "s"]


LAWS = {
    "valve_delay": Law(ValveDelay, modifies="valve", fields=("delay",)),
    "valve_lag": Law(ValveLag, modifies="valve", fields=("lag",)),
}
