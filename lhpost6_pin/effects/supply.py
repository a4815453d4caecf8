"""Supply and return pressure where flow changes them: hidden states that all actuators share (`laws.supply`).

Where a time constant is zero the state is the flow itself, which depends on it by the pressures: Newton's method.
"""

from ..core.compiled import compiled, compiled_inline
from ..laws.hydraulic import exchanged_flows
from ..laws.lines import filter_shares
from ..laws.supply import pressures
from .actuator import pressures_of, valve_pressure
from .registry import HYDRAULIC
from .views import view_hydraulic

__all__ = [
    "close_supply",
    "drawn_flows",
    "flows_exchanged",
    "open_supply",
    "shared_states",
    "steady_supply",
    "supply_pressures",
    "supply_rates",
]

_NEWTON = 3
"""Iterations: they start one step away from where they end."""

_QUICKEST = 1e-3
"""Time constant [s] below which rates (schemes `euler` and `rk4`) count as this: they need a state that has one."""


@compiled_inline
def shared_states(supply, z):
    """Filtered flows drawn and returned [m3/s]; zero where the machine has no such state."""
    at, back = int(supply.drawn), int(supply.returned)
    return (z[at] if at >= 0 else 0.0), (z[back] if back >= 0 else 0.0)


@compiled_inline
def supply_pressures(supply, z):
    """Supply and return pressure [Pa] in the state z."""
    drawn, returned = shared_states(supply, z)
    return pressures(supply, drawn, returned)


@compiled
def flows_exchanged(rows, spool, supply, z):
    """Flows of all actuators drawn from the supply and given to the return [m3/s], with their slopes."""
    high, low = supply_pressures(supply, z)
    drawn = returned = slope_drawn = slope_returned = 0.0
    for i in range(rows.size):
        row = rows[i]
        if row.law != HYDRAULIC:
            continue
        p = view_hydraulic(row.numbers)
        pressure_a, pressure_b = pressures_of(row, p, z)
        fed = valve_pressure(row, z, high)
        out, back, slope_out, slope_back = exchanged_flows(p, spool[row.spool], pressure_a, pressure_b, fed, low)
        weight = supply.weight if p.area_b > 0.0 else 1.0
        drawn += weight * out
        returned += back
        slope_drawn += weight * slope_out
        slope_returned += slope_back
    return drawn, returned, slope_drawn, slope_returned


@compiled
def drawn_flows(rows, spool, supply, z, out):
    """Fill the flow (n,) [m3/s] that all actuators draw from the supply, with spools (n, a) and states (n, k)."""
    for i in range(len(out)):
        out[i] = flows_exchanged(rows, spool[i], supply, z[i])[0]


@compiled
def _solve(rows, spool, supply, z, kept_drawn, share_drawn, kept_returned, share_returned):
    """Put both states where Y = kept + share times flow, the flow being that at Y."""
    at, back = int(supply.drawn), int(supply.returned)
    for _ in range(_NEWTON):
        drawn, returned, slope_drawn, slope_returned = flows_exchanged(rows, spool, supply, z)
        if at >= 0:
            miss = z[at] - kept_drawn - share_drawn * drawn
            z[at] -= miss / (1.0 + share_drawn * supply.droop * slope_drawn)
        if back >= 0:
            miss = z[back] - kept_returned - share_returned * returned
            z[back] -= miss / (1.0 + share_returned * 2.0 * supply.rise * abs(z[back]) * slope_returned)


@compiled
def steady_supply(rows, spool, supply, z):
    """Put both states at what flows in the state z."""
    _solve(rows, spool, supply, z, 0.0, 1.0, 0.0, 1.0)


@compiled
def open_supply(rows, spool, supply, dt, z):
    """Put both states at mid-step, flows held as they are at its start; returns what `close_supply` needs of that."""
    drawn, returned = shared_states(supply, z)
    flow, flow_back, _, _ = flows_exchanged(rows, spool, supply, z)
    at, back = int(supply.drawn), int(supply.returned)
    stay, first, last = filter_shares(0.5 * dt, supply.droop_time)
    kept = stay * z[at] if at >= 0 else 0.0
    stay_back, first_back, last_back = filter_shares(0.5 * dt, supply.rise_time)
    kept_back = stay_back * z[back] if back >= 0 else 0.0
    _solve(rows, spool, supply, z, kept, first + last, kept_back, first_back + last_back)
    return drawn, returned, flow, flow_back


@compiled
def close_supply(rows, spool, supply, dt, before, z):
    """Put both states at the step's end, from states and flows before it (drawn, returned, flow, flow back) [m3/s].

    Flows go straight to those of the pressures and spools in z and spool.
    """
    drawn, returned, flow, flow_back = before
    stay, first, last = filter_shares(dt, supply.droop_time)
    stay_back, first_back, last_back = filter_shares(dt, supply.rise_time)
    kept, kept_back = stay * drawn + first * flow, stay_back * returned + first_back * flow_back
    _solve(rows, spool, supply, z, kept, last, kept_back, last_back)


@compiled
def supply_rates(rows, spool, supply, z, zd):
    """Fill the rates of both states."""
    at, back = int(supply.drawn), int(supply.returned)
    drawn, returned, _, _ = flows_exchanged(rows, spool, supply, z)
    if at >= 0:
        zd[at] = (drawn - z[at]) / max(supply.droop_time, _QUICKEST)
    if back >= 0:
        zd[back] = (returned - z[back]) / max(supply.rise_time, _QUICKEST)
