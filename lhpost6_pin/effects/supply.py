"""Supply and return pressure, where flow changes them: states that all actuators share.

P_S = P_S0 - k Y,   T dY/dt + Y = sum of flows drawn from the supply, those of double-acting actuators times a weight
P_R = P_R0 + k Y|Y|, T dY/dt + Y = sum of flows given to the return

supply holds a machine's numbers in the places that `law_table` names; a machine without these has two, P_S0 and P_R0.
T = 0 is possible: Y is then the flow itself, which depends on Y by the pressures, and is found by Newton's method.
"""

from ..core.compiled import compiled
from ..laws.lines import filter_shares
from .actuator import at_valve, exchanged
from .registry import BACK, BACK_TIME, DRAWN, DROOP, DROOP_TIME, HYDRAULIC_DOUBLE, RETURN, RETURNED, SUPPLY, WEIGHT

__all__ = ["close_supply", "flows_exchanged", "open_supply", "shared_states", "steady_supply", "supply_pressures"]
__all__ += ["supply_rates"]

_NEWTON = 3
"""Iterations: they start one step away from where they end."""

_QUICKEST = 1e-3
"""Time constant [s] below which rates (schemes `euler` and `rk4`) count as this: they need a state that has one."""


@compiled
def supply_pressures(supply, z):
    """Supply and return pressure [Pa] in the state z."""
    high, low = supply[SUPPLY], supply[RETURN]
    if supply.size > 2:
        at, back = int(supply[DRAWN]), int(supply[RETURNED])
        if at >= 0:
            high -= supply[DROOP] * z[at]
        if back >= 0:
            low += supply[BACK] * z[back] * abs(z[back])
    return high, low


@compiled
def shared_states(supply, z):
    """Filtered flows drawn and returned [m3/s]; zero where the machine has no such state."""
    at, back = int(supply[DRAWN]), int(supply[RETURNED])
    return (z[at] if at >= 0 else 0.0), (z[back] if back >= 0 else 0.0)


@compiled
def flows_exchanged(rows, spool, supply, z):
    """Flows of all actuators drawn from the supply and given to the return [m3/s], with their slopes (`exchanged`)."""
    high, low = supply_pressures(supply, z)
    drawn = returned = slope_drawn = slope_returned = 0.0
    for i in range(rows.size):
        row = rows[i]
        if row.input < 0:
            continue
        double = row.law == HYDRAULIC_DOUBLE
        k = row.state
        pressure_b = z[k + 1] if double else 0.0
        fed = at_valve(row, z, high)
        out, back, slope_out, slope_back = exchanged(row.p, double, spool[row.input], z[k], pressure_b, fed, low)
        weight = supply[WEIGHT] if double else 1.0
        drawn += weight * out
        returned += back
        slope_drawn += weight * slope_out
        slope_returned += slope_back
    return drawn, returned, slope_drawn, slope_returned


@compiled
def _solve(rows, spool, supply, z, kept_drawn, share_drawn, kept_returned, share_returned):
    """Put both states where Y = kept + share times flow, the flow being that at Y."""
    at, back = int(supply[DRAWN]), int(supply[RETURNED])
    for _ in range(_NEWTON):
        drawn, returned, slope_drawn, slope_returned = flows_exchanged(rows, spool, supply, z)
        if at >= 0:
            miss = z[at] - kept_drawn - share_drawn * drawn
            z[at] -= miss / (1.0 + share_drawn * supply[DROOP] * slope_drawn)
        if back >= 0:
            miss = z[back] - kept_returned - share_returned * returned
            z[back] -= miss / (1.0 + share_returned * 2.0 * supply[BACK] * abs(z[back]) * slope_returned)


@compiled
def steady_supply(rows, spool, supply, z):
    """Put both states at what flows in the state z."""
    _solve(rows, spool, supply, z, 0.0, 1.0, 0.0, 1.0)


@compiled
def open_supply(rows, spool, supply, dt, z):
    """Put both states at mid-step, flows held as they are at its start; returns what `close_supply` needs of that."""
    drawn, returned = shared_states(supply, z)
    flow, flow_back, _, _ = flows_exchanged(rows, spool, supply, z)
    at, back = int(supply[DRAWN]), int(supply[RETURNED])
    stay, first, last = filter_shares(0.5 * dt, supply[DROOP_TIME])
    kept = stay * z[at] if at >= 0 else 0.0
    stay_back, first_back, last_back = filter_shares(0.5 * dt, supply[BACK_TIME])
    kept_back = stay_back * z[back] if back >= 0 else 0.0
    _solve(rows, spool, supply, z, kept, first + last, kept_back, first_back + last_back)
    return drawn, returned, flow, flow_back


@compiled
def close_supply(rows, spool, supply, dt, before, z):
    """Put both states at the step's end, from states and flows before it (drawn, returned, flow, flow back) [m3/s].

    Flows go straight to those of the pressures and spools in z and spool.
    """
    drawn, returned, flow, flow_back = before
    stay, first, last = filter_shares(dt, supply[DROOP_TIME])
    stay_back, first_back, last_back = filter_shares(dt, supply[BACK_TIME])
    kept, kept_back = stay * drawn + first * flow, stay_back * returned + first_back * flow_back
    _solve(rows, spool, supply, z, kept, last, kept_back, last_back)


@compiled
def supply_rates(rows, spool, supply, z, zd):
    """Fill the rates of both states."""
    at, back = int(supply[DRAWN]), int(supply[RETURNED])
    drawn, returned, _, _ = flows_exchanged(rows, spool, supply, z)
    if at >= 0:
        zd[at] = (drawn - z[at]) / max(supply[DROOP_TIME], _QUICKEST)
    if back >= 0:
        zd[back] = (returned - z[back]) / max(supply[BACK_TIME], _QUICKEST)
