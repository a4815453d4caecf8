"""Actuators at work: the step, rates and power of a row, with the lines before and behind its valve.

The physics is in `laws.hydraulic`; here it meets the effect table: where a row keeps its pressures and the states of
its lines. high, low [Pa] are supply and return pressure, z (n_states,) the hidden states.
"""

from ..core.compiled import compiled, compiled_inline
from ..laws.hydraulic import (
    exchanged_flows,
    leak_flows,
    oil_enthalpy,
    pressure_rates,
    rod_travel,
    step_pressures,
    stored_energy,
    supply_line_impedance,
    valve_flows,
)
from ..laws.lines import line_step
from .views import view_hydraulic

__all__ = ["advance_actuator", "advance_line", "advance_modified", "fill_rates", "oil_power", "pressures_of"]
__all__ += ["rod_travels", "start_line", "supplied", "valve_pressure"]


@compiled_inline
def pressures_of(row, p, z):
    """Pressures of chambers A and B [Pa], zero without chamber B."""
    return z[row.state], (z[row.state + 1] if p.area_b > 0.0 else 0.0)


@compiled_inline
def valve_pressure(row, z, high):
    """Supply pressure at a row's valve [Pa], behind its line."""
    return high + z[row.supply_line_state] if row.supply_line_state >= 0 else high


@compiled_inline
def supplied(row, modified, spool, pressure_a, pressure_b, high, low, z):
    """Flows from the valve into the chambers and their slopes (`hydraulic.valve_flows`), behind its lines if any."""
    p = view_hydraulic(row.numbers)
    if modified and p.line_time > 0.0:
        return z[row.line_state], z[row.line_state + 2], 0.0, 0.0
    if modified:
        high = valve_pressure(row, z, high)
    return valve_flows(p, modified, spool, pressure_a, pressure_b, high, low)


@compiled_inline
def advance_actuator(row, modified, s, ds, dt, spool, supply, z):
    """Advance a row's pressures, and its lines by half a step before it and half a step behind it.

    supply holds the supply and return pressure [Pa].
    """
    high, low = supply
    p, x = view_hydraulic(row.numbers), spool[row.spool]
    pressure_a, pressure_b = pressures_of(row, p, z)
    if modified:
        advance_line(row, x, pressure_a, pressure_b, high, low, 0.5 * dt, z)
    valve = supplied(row, modified, x, pressure_a, pressure_b, high, low, z)
    after_a, after_b = step_pressures(p, modified, valve, (pressure_a, pressure_b), low, s[row.port], ds[row.port], dt)
    z[row.state] = after_a
    if p.area_b > 0.0:
        z[row.state + 1] = after_b
    if modified:
        advance_line(row, x, after_a, after_b, high, low, 0.5 * dt, z)


@compiled
def advance_modified(row, s, ds, dt, spool, supply, z):
    """`advance_actuator` with all that modifiers add."""
    advance_actuator(row, True, s, ds, dt, spool, supply, z)


@compiled
def fill_rates(row, s, sd, spool, high, low, z, zd):
    """Fill the rates of a row's pressures and lines."""
    p, x = view_hydraulic(row.numbers), spool[row.spool]
    pressure_a, pressure_b = pressures_of(row, p, z)
    valve = supplied(row, True, x, pressure_a, pressure_b, high, low, z)
    rate_a, rate_b = pressure_rates(p, True, valve, pressure_a, pressure_b, low, s[row.port], sd[row.port])
    zd[row.state] = rate_a
    if p.area_b > 0.0:
        zd[row.state + 1] = rate_b
    if row.supply_line_state >= 0:
        k = row.supply_line_state
        taken, _, _, _ = exchanged_flows(p, x, pressure_a, pressure_b, high + z[k], low)
        turn, impedance = supply_line_impedance(p)
        zd[k] = turn * impedance * (z[k + 1] - taken)
        zd[k + 1] = -z[k] / p.supply_inertance - 2.0 * p.supply_damping * turn * (z[k + 1] - taken)
    if p.line_time > 0.0:
        k = row.line_state
        fed = valve_pressure(row, z, high)
        flow_a, flow_b, _, _ = valve_flows(p, True, x, pressure_a, pressure_b, fed, low)
        zd[k], zd[k + 2] = z[k + 1] / p.line_time, z[k + 3] / p.line_time
        zd[k + 1] = (flow_a - z[k] - 2.0 * p.line_damping * z[k + 1]) / p.line_time
        zd[k + 3] = (flow_b - z[k + 2] - 2.0 * p.line_damping * z[k + 3]) / p.line_time


@compiled
def advance_line(row, spool, pressure_a, pressure_b, high, low, dt, z):
    """Advance the lines of a row, if it has any, by dt [s] at these pressures: before the valve, then behind it.

    Before it, what oscillates is the pressure, and by how much more flows in than the valve takes.
    """
    p = view_hydraulic(row.numbers)
    if row.supply_line_state >= 0:
        k = row.supply_line_state
        taken, _, _, _ = exchanged_flows(p, spool, pressure_a, pressure_b, high + z[k], low)
        turn, impedance = supply_line_impedance(p)
        z[k], more = line_step(z[k], impedance * (z[k + 1] - taken), 0.0, dt, 1.0 / turn, p.supply_damping)
        z[k + 1] = taken + more / impedance
    if p.line_time <= 0.0:
        return
    k = row.line_state
    flow_a, flow_b, _, _ = valve_flows(p, True, spool, pressure_a, pressure_b, valve_pressure(row, z, high), low)
    z[k], z[k + 1] = line_step(z[k], z[k + 1], flow_a, dt, p.line_time, p.line_damping)
    z[k + 2], z[k + 3] = line_step(z[k + 2], z[k + 3], flow_b, dt, p.line_time, p.line_damping)


@compiled
def start_line(row, spool, pressure_a, pressure_b, high, low, z):
    """Put the lines of a row, if it has any, at rest in what flows through them."""
    p = view_hydraulic(row.numbers)
    if row.supply_line_state >= 0:
        k = row.supply_line_state
        z[k] = 0.0
        z[k + 1], _, _, _ = exchanged_flows(p, spool, pressure_a, pressure_b, high, low)
    if p.line_time <= 0.0:
        return
    k = row.line_state
    z[k], z[k + 2], _, _ = valve_flows(p, True, spool, pressure_a, pressure_b, high, low)
    z[k + 1] = z[k + 3] = 0.0


@compiled
def oil_power(row, s, z, spool, high, low):
    """Inflow through the valve and power lost in leaks [W], and energy stored [J], of one row at coordinate s."""
    p = view_hydraulic(row.numbers)
    pressure_a, pressure_b = pressures_of(row, p, z)
    flow_a, flow_b, _, _ = supplied(row, True, spool, pressure_a, pressure_b, high, low, z)
    across, _, out_a, out_b, _, _ = leak_flows(p, True, pressure_a, pressure_b, low)
    h_a, h_b = oil_enthalpy(p, pressure_a), oil_enthalpy(p, pressure_b)
    lost = (h_a - h_b) * across + h_a * out_a + h_b * out_b
    return h_a * flow_a + h_b * flow_b, lost, stored_energy(p, pressure_a, pressure_b, s)


@compiled
def rod_travels(rows, z, ahead):
    """Fill ahead (n, n_actuators) [m], rods ahead of the platen, of actuator rows at hidden states z (n, n_states)."""
    for k in range(z.shape[0]):
        for i in range(rows.size):
            p = view_hydraulic(rows[i].numbers)
            pressure_a, pressure_b = pressures_of(rows[i], p, z[k])
            ahead[k, i] = rod_travel(p, True, pressure_a, pressure_b)
