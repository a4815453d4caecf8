"""Leakage of an actuator: the report's across the piston (Eq. 4-3), and what the library adds.

across the piston   Q = C_L (P_A - P_B)                                      the report's, laminar
across the piston   Q = c root(P_A - P_B)                                    a gap worn wide: turbulent
out of a chamber    Q = c (P - P_R)                                          past the rod, or a fitting
past a worn spool   Q = g_0 exp(-|x|/w) (root(P_S - P) - root(P - P_R))      into a chamber, near the valve's null

Q [m3/s], P [Pa] chamber, P_S supply, P_R return; x [1] spool over stroke, w [1] width; roots as `orifice.signed_root`.
Stored energy: none; leaks dissipate. Source: Merritt (1967), Sections 3.4 and 5.6.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law
from .orifice import signed_root

__all__ = ["ExternalLeakage", "ExtraLeakage", "LAWS", "NullLeakage", "TurbulentLeakage"]
__all__ += ["laminar_leak", "null_leak", "turbulent_leak"]


class ExtraLeakage(NamedTuple):
    """Parameters of more laminar leakage across the piston."""

    leakage: Annotated[float, "m3/s/Pa"]


class TurbulentLeakage(NamedTuple):
    """Parameters of turbulent leakage across the piston."""

    coefficient: Annotated[float, "m3/s/Pa^0.5"]


class ExternalLeakage(NamedTuple):
    """Parameters of laminar leakage out of the chambers."""

    leakage: Annotated[float, "m3/s/Pa"]
    side: Annotated[float, "1"]  # 0 both chambers, 1 A alone, -1 B alone; of no meaning without B


class NullLeakage(NamedTuple):
    """Parameters of leakage past a worn spool."""

    leakage: Annotated[float, "m3/s/Pa^0.5"]
    width: Annotated[float, "1"]


LAWS = {
    "extra_leakage": Law(ExtraLeakage, modifies="oil", fields=("leakage",)),
    "turbulent_leakage": Law(TurbulentLeakage, modifies="oil", fields=("turbulent",)),
    "external_leakage": Law(ExternalLeakage, modifies="oil", fields=("external", "external_side")),
    "null_leakage": Law(NullLeakage, modifies="oil", fields=("null_leakage", "null_width")),
}


@compiled
def laminar_leak(drop: float, coefficient: float) -> tuple[float, float]:
    """Flow [m3/s] down a drop [Pa] and its slope [m3/s/Pa]; coefficient C_L [m3/s/Pa]."""
    return coefficient * drop, coefficient


@compiled
def turbulent_leak(drop: float, coefficient: float, linear_below: float) -> tuple[float, float]:
    """Flow [m3/s] down a drop [Pa] and its slope [m3/s/Pa]; coefficient [m3/s/sqrt(Pa)]."""
    root, slope = signed_root(drop, linear_below)
    return coefficient * root, coefficient * slope


@compiled
def null_leak(
    spool: float, chamber: float, leakage: float, width: float, supply: float, back: float, linear_below: float
) -> tuple[float, float, float, float]:
    """Flows supply to chamber and chamber to return [m3/s], and their slopes with the drop [m3/s/Pa].

    spool [1], chamber, supply and back are pressures [Pa]; leakage [m3/s/sqrt(Pa)] at null, width [1] of spool.
    """
    k = leakage * math.exp(-abs(spool) / width)
    into, slope_in = signed_root(supply - chamber, linear_below)
    out, slope_out = signed_root(chamber - back, linear_below)
    return k * into, k * out, k * slope_in, k * slope_out
