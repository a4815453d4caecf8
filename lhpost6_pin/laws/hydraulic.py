"""An actuator: its servovalve, its chambers, and all that modifies their oil (Eqs. 4-1 to 4-6).

One law for actuators with a four-way valve and two chambers, and for those with a three-way valve and chamber A alone:
area_b is then zero, two ports of the valve are closed (w2 = w4 = 0) and P_B = 0, so that the leak is C_L P_A.

Flow into chamber A: orifices and null leakage of the valve, less the leak across the piston and out of the chamber.
`modified` is true where a parameter beyond the report's acts; it is a constant of the calling code, so that the
compiler removes those terms from the report's own actuators. high, low [Pa] are supply and return pressure.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled, compiled_inline
from .bulk import air_modulus, enthalpy_of, void_share
from .chamber import flow_enthalpy, piston_force, pressure_rises, side_shares
from .contract import Law
from .leaks import laminar_leak, null_leak, turbulent_leak
from .orifice import opening, port_flow
from .play import play_energy, play_slope, play_travel
from .spool import corrected_opening, dead_zone

__all__ = [
    "LAW",
    "Hydraulic",
    "exchanged_flows",
    "force",
    "leak_flows",
    "oil_enthalpy",
    "oil_modulus",
    "pressure_rates",
    "rod_travel",
    "rod_velocity",
    "step_pressures",
    "stored_energy",
    "supply_line_impedance",
    "valve_flows",
]


class Hydraulic(NamedTuple):
    """Parameters of an actuator: the report's, then those that effects add."""

    area_a: Annotated[float, "m2"]
    area_b: Annotated[float, "m2"]  # zero without chamber B
    flow_pa: Annotated[float, "m3/s/Pa^0.5"]  # flow paths: supply to A
    flow_bt: Annotated[float, "m3/s/Pa^0.5"]  # B to return
    flow_at: Annotated[float, "m3/s/Pa^0.5"]  # A to return
    flow_pb: Annotated[float, "m3/s/Pa^0.5"]  # supply to B
    flow_curve: Annotated[float, "1"]  # lambda
    leakage: Annotated[float, "m3/s/Pa"]  # C_L
    chamber_a: Annotated[float, "m"]
    chamber_b: Annotated[float, "m"]
    bulk_modulus: Annotated[float, "Pa"]
    root_regularisation: Annotated[float, "Pa"]
    turbulent: Annotated[float, "m3/s/Pa^0.5"] = 0.0
    external: Annotated[float, "m3/s/Pa"] = 0.0
    external_side: Annotated[float, "1"] = 0.0
    null_leakage: Annotated[float, "m3/s/Pa^0.5"] = 0.0
    null_width: Annotated[float, "1"] = 0.0
    null_bias: Annotated[float, "1"] = 0.0
    overlap: Annotated[float, "1"] = 0.0
    overlap_rounding: Annotated[float, "1"] = 0.0
    air: Annotated[float, "1"] = 0.0
    air_index: Annotated[float, "1"] = 0.0
    voids: Annotated[float, "1"] = 0.0
    vapour_pressure: Annotated[float, "Pa"] = 0.0
    curve_error: Annotated[float, "1"] = 0.0
    curve_side: Annotated[float, "1"] = 0.0
    curve_power: Annotated[float, "1"] = 0.0
    line_time: Annotated[float, "s"] = 0.0
    line_damping: Annotated[float, "1"] = 0.0
    play: Annotated[float, "m"] = 0.0
    play_force: Annotated[float, "N"] = 0.0
    supply_inertance: Annotated[float, "Pa s2/m3"] = 0.0
    supply_frequency: Annotated[float, "Hz"] = 0.0
    supply_damping: Annotated[float, "1"] = 0.0
    one_way: Annotated[float, "1"] = 0.0  # above zero: no flow back through ports P and T


LAW = Law(
    Hydraulic,
    states=("pressure_a", "pressure_b"),
    state_needs=(("pressure_b", "area_b"),),
    stores_energy=True,
    takes_spool=True,
    inlined=True,
)


@compiled_inline
def force(p: Hydraulic, pressure_a: float, pressure_b: float) -> float:
    """Force of the oil [N], positive when it lengthens the actuator (Eq. 4-6)."""
    return piston_force(pressure_a, pressure_b, p.area_a, p.area_b)


@compiled_inline
def _opened(p, modified, spool):
    """Signed opening of the valve."""
    if not modified:
        return opening(spool, p.flow_curve)
    spool += p.null_bias
    if p.overlap != 0.0:
        spool = dead_zone(spool, p.overlap, p.overlap_rounding)
    opened = opening(spool, p.flow_curve)
    if p.curve_error != 0.0:
        opened = corrected_opening(opened, p.curve_error, p.curve_side, p.curve_power)
    return opened


@compiled_inline
def _null_flows(p, spool, pressure, high, low):
    if p.null_leakage == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    into, out, slope_in, slope_out = null_leak(
        spool + p.null_bias, pressure, p.null_leakage, p.null_width, high, low, p.root_regularisation
    )
    if p.one_way > 0.0:
        into, slope_in = (into, slope_in) if into > 0.0 else (0.0, 0.0)
        out, slope_out = (out, slope_out) if out > 0.0 else (0.0, 0.0)
    return into, out, slope_in, slope_out


@compiled_inline
def _port_flow(p, modified, opened, k_supply, k_return, high, low, pressure):
    """`orifice.port_flow`; with one-way ports, none into P (supply) or out of T (return)."""
    flow, slope = port_flow(opened, k_supply, k_return, high, low, pressure, p.root_regularisation)
    if modified and p.one_way > 0.0 and flow * opened < 0.0:
        flow = slope = 0.0
    return flow, slope


@compiled_inline
def valve_flows(p, modified, spool, pressure_a, pressure_b, high, low):
    """Flows from the valve into chambers A and B [m3/s] and their slopes with the chambers' pressures [m3/s/Pa]."""
    opened = _opened(p, modified, spool)
    flow_a, slope_a = _port_flow(p, modified, opened, p.flow_pa, p.flow_at, high, low, pressure_a)
    flow_b = slope_b = 0.0
    if p.area_b > 0.0:
        flow_b, slope_b = _port_flow(p, modified, -opened, p.flow_pb, p.flow_bt, high, low, pressure_b)
    if modified:
        into, out, slope_in, slope_out = _null_flows(p, spool, pressure_a, high, low)
        flow_a += into - out
        slope_a -= slope_in + slope_out
        if p.area_b > 0.0:
            into, out, slope_in, slope_out = _null_flows(p, spool, pressure_b, high, low)
            flow_b += into - out
            slope_b -= slope_in + slope_out
    return flow_a, flow_b, slope_a, slope_b


@compiled
def exchanged_flows(p, spool, pressure_a, pressure_b, high, low):
    """Flows drawn from the supply and given to the return [m3/s], and their slopes [m3/s/Pa].

    Slopes are by the supply's pressure and, sign reversed, by the return's: neither is below zero.
    """
    opened = _opened(p, True, spool)
    drawn, returned, slope_drawn, slope_returned = _null_flows(p, spool, pressure_a, high, low)
    flow, slope = _port_flow(p, True, opened, p.flow_pa, p.flow_at, high, low, pressure_a)
    if opened >= 0.0:
        drawn, slope_drawn = drawn + flow, slope_drawn - slope
    else:
        returned, slope_returned = returned - flow, slope_returned - slope
    if p.area_b > 0.0:
        into, out, slope_in, slope_out = _null_flows(p, spool, pressure_b, high, low)
        drawn, returned = drawn + into, returned + out
        slope_drawn, slope_returned = slope_drawn + slope_in, slope_returned + slope_out
        flow, slope = _port_flow(p, True, -opened, p.flow_pb, p.flow_bt, high, low, pressure_b)
        if opened <= 0.0:
            drawn, slope_drawn = drawn + flow, slope_drawn - slope
        else:
            returned, slope_returned = returned - flow, slope_returned - slope
    return drawn, returned, slope_drawn, slope_returned


@compiled_inline
def leak_flows(p, modified, pressure_a, pressure_b, low):
    """Leaks [m3/s]: across the piston with its slope [m3/s/Pa], and out of chambers A and B with theirs."""
    across, slope = laminar_leak(pressure_a - pressure_b, p.leakage)
    if not modified:
        return across, slope, 0.0, 0.0, 0.0, 0.0
    if p.turbulent != 0.0:
        more, steeper = turbulent_leak(pressure_a - pressure_b, p.turbulent, p.root_regularisation)
        across, slope = across + more, slope + steeper
    share_a, share_b = side_shares(p.external_side)
    slope_a = p.external * share_a
    slope_b = p.external * share_b if p.area_b > 0.0 else 0.0
    return across, slope, slope_a * (pressure_a - low), slope_b * (pressure_b - low), slope_a, slope_b


@compiled_inline
def oil_modulus(p, modified, pressure):
    """Bulk modulus at a pressure [Pa], and the share of it that voids leave."""
    modulus, left = p.bulk_modulus, 1.0
    if modified and p.air != 0.0:
        modulus = air_modulus(pressure, modulus, p.air, p.air_index, p.root_regularisation)
    if modified and p.voids != 0.0:
        left = void_share(pressure, p.vapour_pressure, p.voids)
    return modulus, left


@compiled
def oil_enthalpy(p, pressure):
    """Energy that oil carries across a boundary per volume [J/m3]."""
    if p.air == 0.0 and p.voids == 0.0:
        return flow_enthalpy(pressure, p.bulk_modulus)
    index = p.air_index if p.air != 0.0 else 1.0
    return enthalpy_of(pressure, p.bulk_modulus, p.air, index, p.vapour_pressure, p.voids, p.root_regularisation)


@compiled_inline
def rod_travel(p, modified, pressure_a, pressure_b):
    """Rod ahead of the platen [m], within the play of its swivel."""
    if not modified or p.play == 0.0:
        return 0.0
    return play_travel(force(p, pressure_a, pressure_b), p.play, p.play_force)


@compiled_inline
def rod_velocity(p, modified, pressure_a, pressure_b, change_a, change_b):
    """By how much more the rod gets ahead while pressures change [m]; with their rates, its rate [m/s]."""
    if not modified or p.play == 0.0:
        return 0.0
    return play_slope(force(p, pressure_a, pressure_b), p.play, p.play_force) * force(p, change_a, change_b)


@compiled_inline
def _shared(p, pressure_a, pressure_b, change_a, change_b, fall_a, fall_b):
    """Rod's advance [m] from the changes of pressure without it, and the falls of pressure per unit of it."""
    ahead = rod_velocity(p, True, pressure_a, pressure_b, change_a, change_b)
    return ahead / (1.0 + rod_velocity(p, True, pressure_a, pressure_b, fall_a, fall_b))


@compiled_inline
def step_pressures(p, modified, valve, chambers, low, at, stroke, dt):
    """Pressures of chambers A and B one step on from `chambers` [Pa], while the piston moves by `stroke` from `at` [m].

    valve holds the flows from the valve into A and B at the step's start and their slopes. Linearly implicit midpoint
    (one-stage Rosenbrock, order 2, A-stable for a linear orifice) on Eq. 4-5, with chamber lengths at mid-step; on the
    square root of a vanishing drop it may flutter within some (dt beta k / (L A))^2 / 10, a few kPa at 1/2048 s. A
    modulus that depends on the pressure is that at mid-step, found in a first pass, and so is the rod's travel in its
    play: a rod that runs ahead of the platen by d makes pressures fall by `fall` d, and d follows from what is left of
    their rise.
    """
    flow_a, flow_b, slope_a, slope_b = valve
    pressure_a, pressure_b = chambers
    across, cross, out_a, out_b, steep_a, steep_b = leak_flows(p, modified, pressure_a, pressure_b, low)
    flow_a, flow_b = flow_a - across - out_a, flow_b + across - out_b
    slopes, areas = (slope_a - steep_a, slope_b - steep_b), (p.area_a, p.area_b)
    middle = at + 0.5 * stroke
    passes = 2 if modified and (p.air != 0.0 or p.voids != 0.0 or p.play != 0.0) else 1
    rise_a = rise_b = 0.0
    for _ in range(passes):
        half_a, half_b = pressure_a + 0.5 * rise_a, pressure_b + 0.5 * rise_b
        bulk_a, left_a = oil_modulus(p, modified, half_a)
        bulk_b, left_b = oil_modulus(p, modified, half_b)
        rod = middle + rod_travel(p, modified, half_a, half_b)
        per_oil = (
            left_a * bulk_a / (p.area_a * (p.chamber_a + rod)),
            left_b * bulk_b / (p.area_b * (p.chamber_b - rod)) if p.area_b > 0.0 else 0.0,
        )
        rise_a, rise_b = pressure_rises((flow_a, flow_b), slopes, cross, stroke, dt, areas, per_oil)
        if modified and p.play != 0.0:
            fall_a, fall_b = pressure_rises((0.0, 0.0), slopes, cross, -1.0, dt, areas, per_oil)
            ahead = _shared(p, half_a, half_b, rise_a, rise_b, fall_a, fall_b)
            rise_a, rise_b = rise_a - ahead * fall_a, rise_b - ahead * fall_b
    return pressure_a + rise_a, pressure_b + rise_b


@compiled_inline
def pressure_rates(p, modified, valve, pressure_a, pressure_b, low, at, velocity):
    """Rates of both pressures [Pa/s] (Eq. 4-5), valve as in `step_pressures`, the piston at `at` [m]."""
    flow_a, flow_b, _, _ = valve
    across, _, out_a, out_b, _, _ = leak_flows(p, modified, pressure_a, pressure_b, low)
    flow_a, flow_b = flow_a - across - out_a, flow_b + across - out_b
    rod = at + rod_travel(p, modified, pressure_a, pressure_b)
    bulk, left = oil_modulus(p, modified, pressure_a)
    fall_a, fall_b, rate_b = left * bulk / (p.chamber_a + rod), 0.0, 0.0
    rate_a = fall_a * (flow_a / p.area_a - velocity)
    if p.area_b > 0.0:
        bulk, left = oil_modulus(p, modified, pressure_b)
        fall_b = -left * bulk / (p.chamber_b - rod)
        rate_b = -fall_b * (flow_b / p.area_b + velocity)
    if modified and p.play != 0.0:
        ahead = _shared(p, pressure_a, pressure_b, rate_a, rate_b, fall_a, fall_b)
        rate_a, rate_b = rate_a - ahead * fall_a, rate_b - ahead * fall_b
    return rate_a, rate_b


@compiled
def stored_energy(p, pressure_a, pressure_b, at):
    """Energy stored in the oil of both chambers and in the flanks of the play [J], the piston at `at` [m]."""
    rod = at + rod_travel(p, True, pressure_a, pressure_b)
    stored = p.area_a * (p.chamber_a + rod) * (oil_enthalpy(p, pressure_a) - pressure_a)
    if p.area_b > 0.0:
        stored += p.area_b * (p.chamber_b - rod) * (oil_enthalpy(p, pressure_b) - pressure_b)
    if p.play != 0.0:
        stored += play_energy(force(p, pressure_a, pressure_b), p.play, p.play_force)
    return stored


@compiled_inline
def supply_line_impedance(p):
    """Circular frequency [rad/s] of the line before the valve, and its impedance there [Pa s/m3]."""
    turn = 2.0 * math.pi * p.supply_frequency
    return turn, turn * p.supply_inertance
