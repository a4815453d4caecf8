"""Servovalve flow through one orifice (Eqs. 4-1 and 4-2).

Q = k g root(dP),  g = 1 - exp(-lambda |x|),  k = q w/w3 / sqrt(P_rated)

q [m3/s] flow at P_rated with the orifice wide open, w/w3 [1] its width ratio, x [1] spool over stroke, dP [Pa] the
drop along the flow. As printed, q (1 - exp(-lambda)) flows at full stroke, 0.65 to 0.73 q on the LHPOST6; read as the
flow at full stroke, q stands for q / (1 - exp(-lambda)). dP can turn negative for an instant: the root is signed, and
smooth through zero.
Stored energy: none; an orifice dissipates. Source: report Section 4.1.2, after Merritt (1967).
"""

import math

from ..core.compiled import compiled

__all__ = ["flow_at_full_stroke", "opening", "port_flow", "signed_root", "spool_for_opening", "width_ratios"]


@compiled
def signed_root(x: float, linear_below: float) -> tuple[float, float]:
    """Signed square root of `x` [sqrt(Pa)] and its slope [1/sqrt(Pa)].

    Below `linear_below` [Pa] an odd cubic that meets the root in value and slope.
    """
    size = abs(x)
    if size >= linear_below:
        root = math.sqrt(size)
        return math.copysign(root, x), 0.5 / root
    ratio = size / linear_below
    scale = 1.0 / math.sqrt(linear_below)
    return x * scale * (1.25 - 0.25 * ratio * ratio), scale * (1.25 - 0.75 * ratio * ratio)


@compiled
def opening(spool: float, flow_curve: float) -> float:
    """Signed opening of the valve, -1..1: sign(x) (1 - exp(-lambda |x|)) (Eq. 4-2); spool [1], lambda [1]."""
    return math.copysign(1.0 - math.exp(-flow_curve * abs(spool)), spool)


@compiled
def port_flow(
    opened: float,
    k_supply: float,
    k_return: float,
    supply: float,
    back: float,
    chamber: float,
    linear_below: float,
) -> tuple[float, float]:
    """Flow from the valve into one chamber [m3/s] and its slope with the chamber's pressure [m3/s/Pa] (Eq. 4-2).

    opened > 0 joins the chamber to the supply through k_supply, opened < 0 to the return through k_return
    [m3/s/sqrt(Pa)]; supply, back, chamber are pressures [Pa].
    """
    if opened >= 0.0:
        root, slope = signed_root(supply - chamber, linear_below)
        k = opened * k_supply
    else:
        root, slope = signed_root(chamber - back, linear_below)
        k = opened * k_return
    return k * root, -abs(k) * slope


def flow_at_full_stroke(flow: float, flow_curve: float) -> float:
    """Factor q of Eq. 4-2 [m3/s] of a valve that passes `flow` at full stroke; flow_curve is lambda [1]."""
    return flow / -math.expm1(-flow_curve)


def width_ratios(area_a: float, area_b: float) -> tuple[float, float, float, float]:
    """Port widths w1, w2, w3, w4 over w3 of a 4-way valve on a single-ended piston (Eq. 4-1)."""
    ratio = area_b / area_a
    return ratio**0.5, ratio**1.5, 1.0, ratio


@compiled
def spool_for_opening(opened: float, flow_curve: float) -> float:
    """Spool [1] that opens the valve by `opened`, the inverse of `opening`; beyond full stroke it exceeds 1."""
    size = min(abs(opened), 1.0 - 1e-12)
    return math.copysign(-math.log1p(-size) / flow_curve, opened)
