"""The oil of an altered actuator: flows, stiffness, and the step and rates of its hidden states.

The report's actuators keep the shorter way through `stage`; where none of these alterations is in force, both agree.
p is a row's numbers, double whether it has a chamber B (else P_B = 0), high and low supply and return pressure [Pa].
"""

import math

from ..core.compiled import compiled
from ..laws.bulk import air_modulus, enthalpy_of, void_share
from ..laws.chamber import flow_enthalpy, piston_force, pressure_rises, side_shares
from ..laws.leaks import null_leak, turbulent_leak
from ..laws.lines import line_step
from ..laws.orifice import opening, port_flow
from ..laws.play import play_energy, play_slope, play_travel
from ..laws.spool import corrected_opening, dead_zone
from .registry import (
    AIR,
    AIR_INDEX,
    CURVE_ERROR,
    CURVE_POWER,
    CURVE_SIDE,
    DEADBAND,
    EXTERNAL,
    EXTERNAL_SIDE,
    FEED_DAMPING,
    FEED_FREQUENCY,
    FEED_INERTANCE,
    HYDRAULIC_DOUBLE,
    LINE_DAMPING,
    LINE_TIME,
    NULL_BIAS,
    NULL_LEAKAGE,
    NULL_WIDTH,
    PLAY,
    PLAY_FORCE,
    TURBULENT,
    VAPOUR,
    VOIDS,
)

__all__ = [
    "advance_line",
    "advance_oil",
    "at_valve",
    "bulk_modulus",
    "exchanged",
    "leak_flows",
    "net_flows",
    "oil_power",
]
__all__ += ["oil_rates", "rod_advance", "rod_ahead", "rods_ahead", "start_line", "valve_flows"]


@compiled
def _opened(p, spool):
    opened = opening(dead_zone(spool + p[NULL_BIAS], p[DEADBAND]), p[6])
    if p[CURVE_ERROR] != 0.0:
        opened = corrected_opening(opened, p[CURVE_ERROR], p[CURVE_SIDE], p[CURVE_POWER])
    return opened


@compiled
def _null(p, spool, pressure, high, low):
    if p[NULL_LEAKAGE] == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    return null_leak(spool + p[NULL_BIAS], pressure, p[NULL_LEAKAGE], p[NULL_WIDTH], high, low, p[11])


@compiled
def valve_flows(p, double, spool, pressure_a, pressure_b, high, low):
    """Flows from the valve into chambers A and B [m3/s] and their slopes [m3/s/Pa]: orifices and null leakage."""
    opened = _opened(p, spool)
    flow_a, slope_a = port_flow(opened, p[2], p[4], high, low, pressure_a, p[11])
    into, out, slope_in, slope_out = _null(p, spool, pressure_a, high, low)
    flow_a += into - out
    slope_a -= slope_in + slope_out
    if not double:
        return flow_a, 0.0, slope_a, 0.0
    flow_b, slope_b = port_flow(-opened, p[5], p[3], high, low, pressure_b, p[11])
    into, out, slope_in, slope_out = _null(p, spool, pressure_b, high, low)
    return flow_a, flow_b + into - out, slope_a, slope_b - slope_in - slope_out


@compiled
def exchanged(p, double, spool, pressure_a, pressure_b, high, low):
    """Flows drawn from the supply and given to the return [m3/s], and their slopes [m3/s/Pa].

    Slopes are by the supply's pressure and, sign reversed, by the return's: neither is below zero.
    """
    opened = _opened(p, spool)
    drawn, returned, slope_drawn, slope_returned = _null(p, spool, pressure_a, high, low)
    flow, slope = port_flow(opened, p[2], p[4], high, low, pressure_a, p[11])
    if opened >= 0.0:
        drawn, slope_drawn = drawn + flow, slope_drawn - slope
    else:
        returned, slope_returned = returned - flow, slope_returned - slope
    if double:
        into, out, slope_in, slope_out = _null(p, spool, pressure_b, high, low)
        drawn, returned = drawn + into, returned + out
        slope_drawn, slope_returned = slope_drawn + slope_in, slope_returned + slope_out
        flow, slope = port_flow(-opened, p[5], p[3], high, low, pressure_b, p[11])
        if opened <= 0.0:
            drawn, slope_drawn = drawn + flow, slope_drawn - slope
        else:
            returned, slope_returned = returned - flow, slope_returned - slope
    return drawn, returned, slope_drawn, slope_returned


@compiled
def at_valve(row, z, high):
    """Supply pressure at a row's valve [Pa], behind its line."""
    return high + z[row.feed] if row.feed >= 0 else high


@compiled
def leak_flows(p, double, pressure_a, pressure_b, low):
    """Leaks [m3/s]: across the piston with its slope [m3/s/Pa], and out of chambers A and B with theirs."""
    across = p[7] * (pressure_a - pressure_b)
    slope = p[7]
    if p[TURBULENT] != 0.0:
        more, steeper = turbulent_leak(pressure_a - pressure_b, p[TURBULENT], p[11])
        across, slope = across + more, slope + steeper
    share_a, share_b = side_shares(p[EXTERNAL_SIDE])
    slope_a = p[EXTERNAL] * share_a
    slope_b = p[EXTERNAL] * share_b if double else 0.0
    return across, slope, slope_a * (pressure_a - low), slope_b * (pressure_b - low), slope_a, slope_b


@compiled
def net_flows(rows, i, spool, pressure_a, pressure_b, high, low, z):
    """Flows into chambers A and B of row i [m3/s], their slopes but for the leak across the piston, and its slope."""
    row = rows[i]
    p = row.p
    double = row.law == HYDRAULIC_DOUBLE
    if p[LINE_TIME] > 0.0:
        k = row.more
        flow_a, flow_b, slope_a, slope_b = z[k], z[k + 2], 0.0, 0.0
    else:
        fed = at_valve(row, z, high)
        flow_a, flow_b, slope_a, slope_b = valve_flows(p, double, spool, pressure_a, pressure_b, fed, low)
    across, cross, out_a, out_b, steep_a, steep_b = leak_flows(p, double, pressure_a, pressure_b, low)
    return flow_a - across - out_a, flow_b + across - out_b, slope_a - steep_a, slope_b - steep_b, cross


@compiled
def bulk_modulus(p, pressure):
    """Bulk modulus at a pressure [Pa], and the share of it that voids leave."""
    modulus, left = p[10], 1.0
    if p[AIR] != 0.0:
        modulus = air_modulus(pressure, modulus, p[AIR], p[AIR_INDEX], p[11])
    if p[VOIDS] != 0.0:
        left = void_share(pressure, p[VAPOUR], p[VOIDS])
    return modulus, left


@compiled
def _enthalpy(p, pressure):
    if p[AIR] == 0.0 and p[VOIDS] == 0.0:
        return flow_enthalpy(pressure, p[10])
    index = p[AIR_INDEX] if p[AIR] != 0.0 else 1.0
    return enthalpy_of(pressure, p[10], p[AIR], index, p[VAPOUR], p[VOIDS], p[11])


@compiled
def rod_ahead(p, pressure_a, pressure_b):
    """Rod ahead of the platen [m]."""
    if p[PLAY] == 0.0:
        return 0.0
    return play_travel(piston_force(pressure_a, pressure_b, p[0], p[1]), p[PLAY], p[PLAY_FORCE])


@compiled
def rods_ahead(rows, z, ahead):
    """Fill ahead (n, n_actuators) [m] from hidden states z (n, n_states); rows are the actuators'."""
    for k in range(z.shape[0]):
        for i in range(rows.size):
            row = rows[i]
            pressure_b = z[k, row.state + 1] if row.law == HYDRAULIC_DOUBLE else 0.0
            ahead[k, i] = rod_ahead(row.p, z[k, row.state], pressure_b)


@compiled
def rod_advance(p, pressure_a, pressure_b, change_a, change_b):
    """By how much more the rod gets ahead while pressures change [m]; with their rates, its rate [m/s]."""
    if p[PLAY] == 0.0:
        return 0.0
    force = piston_force(pressure_a, pressure_b, p[0], p[1])
    return play_slope(force, p[PLAY], p[PLAY_FORCE]) * piston_force(change_a, change_b, p[0], p[1])


@compiled
def _shared(p, pressure_a, pressure_b, change_a, change_b, fall_a, fall_b):
    """The same where the rod's own stroke is felt: changes but for it, and falls of pressure per unit of it."""
    ahead = rod_advance(p, pressure_a, pressure_b, change_a, change_b)
    return ahead / (1.0 + rod_advance(p, pressure_a, pressure_b, fall_a, fall_b))


@compiled
def oil_power(row, s, z, spool, high, low):
    """Inflow through the valve and power lost in leaks [W], and energy stored in the chambers [J], of one row."""
    p = row.p
    k = row.state
    double = row.law == HYDRAULIC_DOUBLE
    pressure_a = z[k]
    pressure_b = z[k + 1] if double else 0.0
    if p[LINE_TIME] > 0.0:
        flow_a, flow_b = z[row.more], z[row.more + 2]
    else:
        fed = at_valve(row, z, high)
        flow_a, flow_b, _, _ = valve_flows(p, double, spool, pressure_a, pressure_b, fed, low)
    across, _, out_a, out_b, _, _ = leak_flows(p, double, pressure_a, pressure_b, low)
    h_a, h_b = _enthalpy(p, pressure_a), _enthalpy(p, pressure_b)
    s += rod_ahead(p, pressure_a, pressure_b)
    stored = p[0] * (p[8] + s) * (h_a - pressure_a)
    if double:
        stored += p[1] * (p[9] - s) * (h_b - pressure_b)
    if p[PLAY] != 0.0:
        stored += play_energy(piston_force(pressure_a, pressure_b, p[0], p[1]), p[PLAY], p[PLAY_FORCE])
    return h_a * flow_a + h_b * flow_b, (h_a - h_b) * across + h_a * out_a + h_b * out_b, stored


@compiled
def _feed(p):
    """Circular frequency [rad/s] of the line before the valve, and its impedance there [Pa s/m3]."""
    turn = 2.0 * math.pi * p[FEED_FREQUENCY]
    return turn, turn * p[FEED_INERTANCE]


@compiled
def advance_line(rows, i, spool, pressure_a, pressure_b, high, low, dt, z):
    """Advance the lines of row i, if it has any, by dt [s] at these pressures: before the valve, then behind it.

    Before it, what oscillates is the pressure, and by how much more flows in than the valve takes.
    """
    row = rows[i]
    p = row.p
    double = row.law == HYDRAULIC_DOUBLE
    if row.feed >= 0:
        k = row.feed
        taken, _, _, _ = exchanged(p, double, spool, pressure_a, pressure_b, high + z[k], low)
        turn, impedance = _feed(p)
        z[k], more = line_step(z[k], impedance * (z[k + 1] - taken), 0.0, dt, 1.0 / turn, p[FEED_DAMPING])
        z[k + 1] = taken + more / impedance
    if p[LINE_TIME] <= 0.0:
        return
    k = row.more
    flow_a, flow_b, _, _ = valve_flows(p, double, spool, pressure_a, pressure_b, at_valve(row, z, high), low)
    z[k], z[k + 1] = line_step(z[k], z[k + 1], flow_a, dt, p[LINE_TIME], p[LINE_DAMPING])
    z[k + 2], z[k + 3] = line_step(z[k + 2], z[k + 3], flow_b, dt, p[LINE_TIME], p[LINE_DAMPING])


@compiled
def start_line(rows, i, spool, pressure_a, pressure_b, high, low, z):
    """Put the lines of row i, if it has any, at rest in what flows through them."""
    row = rows[i]
    p = row.p
    double = row.law == HYDRAULIC_DOUBLE
    if row.feed >= 0:
        z[row.feed] = 0.0
        z[row.feed + 1], _, _, _ = exchanged(p, double, spool, pressure_a, pressure_b, high, low)
    if p[LINE_TIME] <= 0.0:
        return
    k = row.more
    z[k], z[k + 2], _, _ = valve_flows(p, double, spool, pressure_a, pressure_b, high, low)
    z[k + 1] = z[k + 3] = 0.0


@compiled
def advance_oil(rows, s, ds, dt, spool, high, low, z):
    """Advance the states of altered rows by one step in which their ports move by ds from s.

    The rule is `chamber.advance_double`'s; lines take half a step before it and half a step behind it. A modulus that
    depends on the pressure is that at mid-step, found in a first pass, and so is what play gives. A rod that runs ahead
    of the platen by d makes pressures fall by `fall` d, and d follows from what is left of their rise.
    """
    for i in range(rows.size):
        row = rows[i]
        if row.input < 0 or row.altered == 0:
            continue
        p = row.p
        k = row.state
        double = row.law == HYDRAULIC_DOUBLE
        x = spool[row.input]
        pressure_a = z[k]
        pressure_b = z[k + 1] if double else 0.0
        advance_line(rows, i, x, pressure_a, pressure_b, high, low, 0.5 * dt, z)
        flow_a, flow_b, slope_a, slope_b, cross = net_flows(rows, i, x, pressure_a, pressure_b, high, low, z)
        middle = s[row.port] + 0.5 * ds[row.port]
        passes = 2 if p[AIR] != 0.0 or p[VOIDS] != 0.0 or p[PLAY] != 0.0 else 1
        rise_a = rise_b = 0.0
        for _ in range(passes):
            half_a, half_b = pressure_a + 0.5 * rise_a, pressure_b + 0.5 * rise_b
            bulk_a, left_a = bulk_modulus(p, half_a)
            bulk_b, left_b = bulk_modulus(p, half_b)
            rod = middle + rod_ahead(p, half_a, half_b)
            per_oil_a = left_a * bulk_a / (p[0] * (p[8] + rod))
            per_oil_b = left_b * bulk_b / (p[1] * (p[9] - rod)) if double else 0.0
            slopes, areas = (slope_a, slope_b, cross), (p[0], p[1])
            rise_a, rise_b = pressure_rises(flow_a, flow_b, *slopes, ds[row.port], dt, *areas, per_oil_a, per_oil_b)
            if p[PLAY] != 0.0:
                fall_a, fall_b = pressure_rises(0.0, 0.0, *slopes, -1.0, dt, *areas, per_oil_a, per_oil_b)
                ahead = _shared(p, half_a, half_b, rise_a, rise_b, fall_a, fall_b)
                rise_a, rise_b = rise_a - ahead * fall_a, rise_b - ahead * fall_b
        z[k] = pressure_a + rise_a
        if double:
            z[k + 1] = pressure_b + rise_b
        advance_line(rows, i, x, pressure_a + rise_a, pressure_b + rise_b, high, low, 0.5 * dt, z)


@compiled
def oil_rates(rows, s, sd, spool, high, low, z, zd):
    """Fill the rates of the states of altered rows."""
    for i in range(rows.size):
        row = rows[i]
        if row.input < 0 or row.altered == 0:
            continue
        p = row.p
        k = row.state
        double = row.law == HYDRAULIC_DOUBLE
        x = spool[row.input]
        pressure_a = z[k]
        pressure_b = z[k + 1] if double else 0.0
        flow_a, flow_b, _, _, _ = net_flows(rows, i, x, pressure_a, pressure_b, high, low, z)
        bulk, left = bulk_modulus(p, pressure_a)
        at, speed = s[row.port] + rod_ahead(p, pressure_a, pressure_b), sd[row.port]
        fall_a, fall_b = left * bulk / (p[8] + at), 0.0
        zd[k] = fall_a * (flow_a / p[0] - speed)
        if double:
            bulk, left = bulk_modulus(p, pressure_b)
            fall_b = -left * bulk / (p[9] - at)
            zd[k + 1] = -fall_b * (flow_b / p[1] + speed)
        if p[PLAY] != 0.0:
            rate_b = zd[k + 1] if double else 0.0
            ahead = _shared(p, pressure_a, pressure_b, zd[k], rate_b, fall_a, fall_b)
            zd[k] -= ahead * fall_a
            if double:
                zd[k + 1] -= ahead * fall_b
        if row.feed >= 0:
            k = row.feed
            taken, _, _, _ = exchanged(p, double, x, pressure_a, pressure_b, high + z[k], low)
            turn, impedance = _feed(p)
            zd[k] = turn * impedance * (z[k + 1] - taken)
            zd[k + 1] = -z[k] / p[FEED_INERTANCE] - 2.0 * p[FEED_DAMPING] * turn * (z[k + 1] - taken)
        if p[LINE_TIME] > 0.0:
            k = row.more
            fed = at_valve(row, z, high)
            flow_a, flow_b, _, _ = valve_flows(p, double, x, pressure_a, pressure_b, fed, low)
            zd[k], zd[k + 2] = z[k + 1] / p[LINE_TIME], z[k + 3] / p[LINE_TIME]
            zd[k + 1] = (flow_a - z[k] - 2.0 * p[LINE_DAMPING] * z[k + 1]) / p[LINE_TIME]
            zd[k + 3] = (flow_b - z[k + 2] - 2.0 * p[LINE_DAMPING] * z[k + 3]) / p[LINE_TIME]
