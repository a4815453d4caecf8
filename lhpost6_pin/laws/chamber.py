"""Actuator chambers: compressible oil between valve and piston (Eqs. 4-3 to 4-6).

dP/dt = beta / L_c (Q/A - dL_c/dt),  f = P_A A_1 - P_B A_2

P [Pa] pressure, beta [Pa] effective bulk modulus, L_c [m] instantaneous chamber length, Q [m3/s] flow into the
chamber, A [m2] piston area, f [N] force that lengthens the actuator. Leakage across the piston C_L (P_A - P_B).

Stored energy: with constant beta the oil's density grows as exp(P/beta). Oil that flows in brings
h(P) = beta (exp(P/beta) - 1) [J/m3], near P; a chamber of volume V holds V (h(P) - P) [J]. With these
dE/dt = h(P) Q - P A dL_c/dt exactly. Source: report Section 4.1.3; energy derived here.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled, compiled_inline
from .contract import Law

__all__ = [
    "DeadVolume",
    "LAWS",
    "chamber_energy",
    "flow_enthalpy",
    "piston_force",
    "pressure_rises",
    "side_shares",
]


Pair = tuple[float, float]
"""Of chambers A and B."""


class DeadVolume(NamedTuple):
    """Parameters of a volume that adds to the chambers'."""

    volume: Annotated[float, "m3"]
    side: Annotated[float, "1"]  # 0 both chambers, 1 A alone, -1 B alone; of no meaning without B


LAWS = {"dead_volume": Law(DeadVolume, modifies="oil", fields=("dead_volume",))}


@compiled
def piston_force(pressure_a: float, pressure_b: float, area_a: float, area_b: float) -> float:
    """Force of the oil on the piston [N], positive when it lengthens the actuator (Eq. 4-6)."""
    return pressure_a * area_a - pressure_b * area_b


@compiled
def flow_enthalpy(pressure: float, bulk: float) -> float:
    """Energy that oil carries across a boundary per volume [J/m3]: beta (exp(P/beta) - 1)."""
    return bulk * math.expm1(pressure / bulk)


@compiled
def chamber_energy(pressure: float, area: float, length: float, bulk: float) -> float:
    """Elastic energy of the oil in a chamber [J]: V (h(P) - P)."""
    return area * length * (flow_enthalpy(pressure, bulk) - pressure)


@compiled
def side_shares(side: float) -> tuple[float, float]:
    """Shares of chambers A and B in what has a side: 0 is both in full, 1 is A alone, -1 is B alone."""
    return min(1.0, 1.0 + side), min(1.0, 1.0 - side)


@compiled_inline
def pressure_rises(
    flow: Pair, slope: Pair, across: float, stroke: float, dt: float, area: Pair, rise_per_oil: Pair
) -> Pair:
    """Rises of both pressures over one linearly implicit step [Pa].

    flow into the chambers [m3/s] at the step's start; slope [m3/s/Pa] theirs with their own pressure, but for the leak
    across the piston, whose slope is `across`; rise_per_oil [Pa/m3] at mid-step, zero for a chamber not there.
    """
    rise_a = rise_per_oil[0] * (dt * flow[0] - area[0] * stroke)
    rise_b = rise_per_oil[1] * (dt * flow[1] + area[1] * stroke)
    half_a, half_b = 0.5 * dt * rise_per_oil[0], 0.5 * dt * rise_per_oil[1]
    # (I - dt/2 J) rise = dt rate, J = d(rates)/d(pressures)
    m_aa = 1.0 - half_a * (slope[0] - across)
    m_ab = -half_a * across
    m_ba = -half_b * across
    m_bb = 1.0 - half_b * (slope[1] - across)
    scale = 1.0 / (m_aa * m_bb - m_ab * m_ba)
    return scale * (m_bb * rise_a - m_ab * rise_b), scale * (m_aa * rise_b - m_ba * rise_a)
