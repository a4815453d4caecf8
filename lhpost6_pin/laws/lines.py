"""First- and second-order answers, exact for the input that they assume.

T dy/dt + y = u                                a filter; u straight from u_0 to u_1
tau^2 d2q/dt2 + 2 zeta tau dq/dt + q = u       a line between valve and chamber; u held

y, q, u are flows [m3/s] here, but any unit does. Stored energy: none that is counted.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAWS", "Line", "SupplyLine", "filter_shares", "line_step"]


class Line(NamedTuple):
    """Parameters of lines between valve and chambers."""

    time: Annotated[float, "s"]
    damping: Annotated[float, "1"]


class SupplyLine(NamedTuple):
    """Parameters of the line before a valve."""

    inertance: Annotated[float, "Pa s2/m3"]
    frequency: Annotated[float, "Hz"]
    damping: Annotated[float, "1"]


LAWS = {
    "line": Law(
        Line,
        states=("flow_a", "flow_rate_a", "flow_b", "flow_rate_b"),
        modifies="oil",
        fields=("line_time", "line_damping"),
    ),
    "supply_line": Law(
        SupplyLine,
        states=("line_pressure", "line_flow"),
        modifies="oil",
        fields=("supply_inertance", "supply_frequency", "supply_damping"),
    ),
}


@compiled
def filter_shares(dt: float, time: float) -> tuple[float, float, float]:
    """Shares of y_0, u_0 and u_1 in y after dt [s], for a time constant [s]; with none y is u_1."""
    if time <= 0.0:
        return 0.0, 0.0, 1.0
    x = dt / time
    stay = math.exp(-x)
    mean = -math.expm1(-x) / x
    return stay, mean - stay, 1.0 - mean


@compiled
def line_step(flow: float, rate: float, fed: float, dt: float, time: float, damping: float) -> tuple[float, float]:
    """Flow out of a line and tau times its rate, dt [s] on, while `fed` flows in; time tau [s], damping below 1."""
    root = math.sqrt(1.0 - damping * damping)
    angle = root * dt / time
    stay = math.exp(-damping * dt / time)
    cosine, sine = math.cos(angle), math.sin(angle) / root
    off = flow - fed
    return (
        fed + stay * (cosine * off + sine * (rate + damping * off)),
        stay * (cosine * rate - sine * (off + damping * rate)),
    )
