"""Actuator chambers: compressible oil between valve and piston (Eqs. 4-3 to 4-6).

dP/dt = beta / L_c (Q/A - dL_c/dt),  f = P_A A_1 - P_B A_2

P [Pa] pressure, beta [Pa] effective bulk modulus, L_c [m] instantaneous chamber length, Q [m3/s] flow into the
chamber, A [m2] piston area, f [N] force that lengthens the actuator. Leakage across the piston C_L (P_A - P_B).

Stored energy: with constant beta the oil's density grows as exp(P/beta). Oil that flows in brings
h(P) = beta (exp(P/beta) - 1) [J/m3], near P; a chamber of volume V holds V (h(P) - P) [J]. With these
dE/dt = h(P) Q - P A dL_c/dt exactly. Source: report Section 4.1.3; energy derived here.
"""

import math

from ..core.compiled import compiled, compiled_inline
from .orifice import port_flow

__all__ = [
    "advance_double",
    "advance_single",
    "chamber_energy",
    "chamber_rate",
    "flow_enthalpy",
    "flows_double",
    "flows_single",
    "piston_force",
    "pressure_rises",
    "side_shares",
]


@compiled
def chamber_rate(flow: float, area: float, length_rate: float, length: float, bulk: float) -> float:
    """Rate of pressure [Pa/s] of one chamber (Eq. 4-5): beta / L_c (Q/A - dL_c/dt)."""
    return bulk / length * (flow / area - length_rate)


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
def flows_double(
    opened: float,
    pressure_a: float,
    pressure_b: float,
    k_pa: float,
    k_bt: float,
    k_at: float,
    k_pb: float,
    leakage: float,
    supply: float,
    back: float,
    linear_below: float,
) -> tuple[float, float, float, float]:
    """Net flows into chambers A and B of a 4-way valve's actuator, and the valve's slopes (Eqs. 4-2, 4-3).

    Returns (Q_A, Q_B) [m3/s] with the leak counted, and dQ_A/dP_A, dQ_B/dP_B of the orifices alone [m3/s/Pa].
    k_* [m3/s/sqrt(Pa)] are the four flow paths: supply to A, B to return, A to return, supply to B.
    """
    flow_a, slope_a = port_flow(opened, k_pa, k_at, supply, back, pressure_a, linear_below)
    flow_b, slope_b = port_flow(-opened, k_pb, k_bt, supply, back, pressure_b, linear_below)
    leak = leakage * (pressure_a - pressure_b)
    return flow_a - leak, flow_b + leak, slope_a, slope_b


@compiled
def flows_single(
    opened: float,
    pressure_a: float,
    k_pa: float,
    k_at: float,
    leakage: float,
    supply: float,
    back: float,
    linear_below: float,
) -> tuple[float, float]:
    """Net flow into chamber A of a 3-way valve's actuator [m3/s] and the orifice's slope [m3/s/Pa].

    A 3-way valve is Eq. 4-3 with w1 = w3, w2 = w4 = 0 and P_B = 0, so the leak is C_L P_A.
    """
    flow, slope = port_flow(opened, k_pa, k_at, supply, back, pressure_a, linear_below)
    return flow - leakage * pressure_a, slope


@compiled
def side_shares(side: float) -> tuple[float, float]:
    """Shares of chambers A and B in what has a side: 0 is both in full, 1 is A alone, -1 is B alone."""
    return min(1.0, 1.0 + side), min(1.0, 1.0 - side)


@compiled_inline
def pressure_rises(
    flow_a: float,
    flow_b: float,
    slope_a: float,
    slope_b: float,
    across: float,
    stroke: float,
    dt: float,
    area_a: float,
    area_b: float,
    rise_per_oil_a: float,
    rise_per_oil_b: float,
) -> tuple[float, float]:
    """Rises of both pressures over one linearly implicit step [Pa].

    Flows into the chambers [m3/s] at the step's start; slope_* [m3/s/Pa] theirs with their own pressure, but for the
    leak across the piston, whose slope is `across`; rise_per_oil_* [Pa/m3] at mid-step, zero for a chamber not there.
    """
    rise_a = rise_per_oil_a * (dt * flow_a - area_a * stroke)
    rise_b = rise_per_oil_b * (dt * flow_b + area_b * stroke)
    half_a = 0.5 * dt * rise_per_oil_a
    half_b = 0.5 * dt * rise_per_oil_b
    # (I - dt/2 J) rise = dt rate, J = d(rates)/d(pressures)
    m_aa = 1.0 - half_a * (slope_a - across)
    m_ab = -half_a * across
    m_ba = -half_b * across
    m_bb = 1.0 - half_b * (slope_b - across)
    scale = 1.0 / (m_aa * m_bb - m_ab * m_ba)
    return scale * (m_bb * rise_a - m_ab * rise_b), scale * (m_aa * rise_b - m_ba * rise_a)


@compiled
def advance_double(
    opened: float,
    pressure_a: float,
    pressure_b: float,
    length_a: float,
    length_b: float,
    stroke: float,
    dt: float,
    area_a: float,
    area_b: float,
    k_pa: float,
    k_bt: float,
    k_at: float,
    k_pb: float,
    leakage: float,
    bulk: float,
    supply: float,
    back: float,
    linear_below: float,
) -> tuple[float, float]:
    """Pressures of chambers A and B one step on [Pa], while the piston moves by `stroke` [m].

    Linearly implicit midpoint (one-stage Rosenbrock, order 2, A-stable for a linear orifice) on Eq. 4-5, with chamber
    lengths at mid-step; length_a, length_b [m] are those at the start of the step. On the square root of a vanishing
    drop it may flutter within some (dt beta k / (L A))^2 / 10, a few kPa at 1/2048 s.
    """
    q_a, q_b, slope_a, slope_b = flows_double(
        opened, pressure_a, pressure_b, k_pa, k_bt, k_at, k_pb, leakage, supply, back, linear_below
    )
    rise_a, rise_b = pressure_rises(
        q_a,
        q_b,
        slope_a,
        slope_b,
        leakage,
        stroke,
        dt,
        area_a,
        area_b,
        bulk / (area_a * (length_a + 0.5 * stroke)),
        bulk / (area_b * (length_b - 0.5 * stroke)),
    )
    return pressure_a + rise_a, pressure_b + rise_b


@compiled
def advance_single(
    opened: float,
    pressure_a: float,
    length_a: float,
    stroke: float,
    dt: float,
    area_a: float,
    k_pa: float,
    k_at: float,
    leakage: float,
    bulk: float,
    supply: float,
    back: float,
    linear_below: float,
) -> float:
    """Pressure of the only chamber one step on [Pa]; the step rule of `advance_double` with P_B = 0."""
    q_a, slope = flows_single(opened, pressure_a, k_pa, k_at, leakage, supply, back, linear_below)
    rise_per_oil = bulk / (area_a * (length_a + 0.5 * stroke))
    rise = rise_per_oil * (dt * q_a - area_a * stroke)
    return pressure_a + rise / (1.0 - 0.5 * dt * rise_per_oil * (slope - leakage))
