"""A spool as its ports see it: off its null, overlapped, with a flow curve of its own.

x -> dz(x + x_0),  dz(x) = x + (sqrt((x - d)^2 + r^2) - sqrt((x + d)^2 + r^2)) / 2,  r = rho d
g -> g (1 + e s |g|^m) of the opening g, s the share of the side on which it opens

x [1] spool over stroke, x_0 null bias, d overlap, rho rounding of its edges (with 0, dz is sgn(x) max(|x| - d, 0)),
e relative error of the flow, m its power of the opening.
Stored energy: none. Source: Merritt (1967), Section 5.3 (overlap). Clearance and rounded edges leave such a valve
some flow gain at null, here 1 - 1 / sqrt(1 + rho^2) of that beyond. The curve's error is a first-order correction.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .chamber import side_shares
from .contract import Law

__all__ = ["Deadband", "FlowCurve", "LAWS", "NullBias", "corrected_opening", "dead_zone"]


class NullBias(NamedTuple):
    """Parameters of a spool off its null."""

    bias: Annotated[float, "1"]


class Deadband(NamedTuple):
    """Parameters of an overlapped spool."""

    overlap: Annotated[float, "1"]
    rounding: Annotated[float, "1"]


class FlowCurve(NamedTuple):
    """Parameters of an error of the flow curve."""

    error: Annotated[float, "1"]
    side: Annotated[float, "1"]
    power: Annotated[float, "1"]


LAWS = {
    "null_bias": Law(NullBias, modifies="oil", fields=("null_bias",)),
    "deadband": Law(Deadband, modifies="oil", fields=("overlap", "overlap_rounding")),
    "flow_curve": Law(FlowCurve, modifies="oil", fields=("curve_error", "curve_side", "curve_power")),
}


@compiled
def dead_zone(x: float, overlap: float, rounding: float) -> float:
    """What is left of x [1] beyond an overlap [1] with edges rounded by a share of it."""
    radius = rounding * overlap
    before, behind = math.sqrt((x - overlap) ** 2 + radius**2), math.sqrt((x + overlap) ** 2 + radius**2)
    return x + 0.5 * (before - behind)


@compiled
def corrected_opening(opened: float, error: float, side: float, power: float) -> float:
    """Signed opening with the flow curve's error; side 1: supply to A only, -1: A to return only, 0: both."""
    to_a, to_b = side_shares(side)
    return opened * (1.0 + error * (to_a if opened >= 0.0 else to_b) * abs(opened) ** power)
