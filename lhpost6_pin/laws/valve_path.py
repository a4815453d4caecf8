"""What a valve does to its command before the ports see it, and one-way ports P and T (report Section 4.1.2).

    delay   x(t) = c(t - tau)             lag   T dx/dt + x = c

Both act on the command path of a valve (`mechanics.valve_delay`). With one-way ports, P passes oil from the supply only
and T to the return only (check valves without loss): a flow against these directions is zero. Stored energy: none.
"""

from typing import Annotated, NamedTuple

from .contract import Law

__all__ = ["LAWS", "OneWayPorts", "ValveDelay", "ValveLag"]


class ValveDelay(NamedTuple):
    """Parameters of a longer delay."""

    delay: Annotated[float, "s"]


class ValveLag(NamedTuple):
    """Parameters of a first-order lag."""

    time: Annotated[float, "s"]


class OneWayPorts(NamedTuple):
    """Parameter of one-way ports P and T."""

    one_way: Annotated[float, "1"]  # 1: one way; 0: both


LAWS = {
    "valve_delay": Law(ValveDelay, modifies="valve", fields=("delay",)),
    "valve_lag": Law(ValveLag, modifies="valve", fields=("lag",)),
    "one_way_ports": Law(OneWayPorts, modifies="oil", fields=("one_way",)),
}
