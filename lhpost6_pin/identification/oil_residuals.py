"""Mass balance of chambers along a measured test, sample by sample: the compiled part of the residual `flow`.

Pressures and spools are measured; what else the oil remembers, flow through lines and from the supply, is marched along
them by the simulation's kernels.
"""

import numpy as np

from ..core.compiled import compiled
from ..effects.actuator import advance_line, bulk_modulus, net_flows, rod_advance, rod_ahead, start_line
from ..effects.registry import HYDRAULIC_DOUBLE
from ..effects.supply import close_supply, flows_exchanged, shared_states, steady_supply, supply_pressures
from ..laws.chamber import chamber_rate, flows_double, flows_single
from ..laws.orifice import opening

__all__ = ["oil_misses"]


@compiled
def oil_misses(rows, chamber, pressure, pressure_rate, spool, supply, s, rate, states, dt, drooped, flow):
    """Fill drooped (n,), the supply's pressure [Pa], and flow (n, n_chambers) [m3/s], which may have no columns.

    rows are the actuators', chamber (n_actuators, 2) their columns of pressure (n, n_chambers); s and rate (n, n_ports)
    the path of the ports, states the number of the plant's hidden states.
    """
    z, last = np.zeros(states), np.zeros(4)
    for k in range(s.shape[0]):
        high, low = _follow_supply(k, rows, chamber, pressure, spool, supply, dt, z, last)
        drooped[k] = high
        if flow.shape[1] > 0:
            _flow_misses(k, rows, chamber, pressure, pressure_rate, spool, high, low, dt, s[k], rate[k], z, flow)


@compiled
def _follow_supply(k, fed, chamber, pressure, spool, supply, dt, z, last):
    """Put the oil of sample k into z (n_states,), pressures as measured; returns supply and return pressure [Pa].

    fed are the actuators' rows, chamber (n_actuators, 2) their columns of pressure (n, n_chambers); last (4,) keeps
    the supply's flows for the next sample.
    """
    for i in range(fed.size):
        z[fed[i].state] = pressure[k, chamber[i, 0]]
        if chamber[i, 1] >= 0:
            z[fed[i].state + 1] = pressure[k, chamber[i, 1]]
    if supply.size > 2:
        if k == 0:
            steady_supply(fed, spool[k], supply, z)
        else:
            close_supply(fed, spool[k], supply, dt, (last[0], last[1], last[2], last[3]), z)
        last[0], last[1] = shared_states(supply, z)
        last[2], last[3], _, _ = flows_exchanged(fed, spool[k], supply, z)
    return supply_pressures(supply, z)


@compiled
def _flow_misses(k, fed, chamber, pressure, pressure_rate, spool, high, low, dt, s, sd, z, flow):
    """Fill row k of flow (n, n_chambers) from the oil in z: V / beta dP/dt + A dL/dt - Q, per chamber [m3/s]."""
    for i in range(fed.size):
        row = fed[i]
        p = row.p
        at, speed = s[row.port], sd[row.port]
        at_a, at_b = chamber[i, 0], chamber[i, 1]
        x = spool[k, row.input]
        pressure_a = pressure[k, at_a]
        pressure_b = pressure[k, at_b] if at_b >= 0 else 0.0
        if row.altered != 0:
            if k == 0:
                start_line(fed, i, x, pressure_a, pressure_b, high, low, z)
            else:
                advance_line(fed, i, x, pressure_a, pressure_b, high, low, 0.5 * dt, z)
            q_a, q_b, _, _, _ = net_flows(fed, i, x, pressure_a, pressure_b, high, low, z)
            rate_b = pressure_rate[k, at_b] if at_b >= 0 else 0.0
            at += rod_ahead(p, pressure_a, pressure_b)
            speed += rod_advance(p, pressure_a, pressure_b, pressure_rate[k, at_a], rate_b)
            bulk, left = bulk_modulus(p, pressure_a)
            flow[k, at_a] = pressure_rate[k, at_a] * p[0] * (p[8] + at) / bulk - left * (q_a - p[0] * speed)
            if at_b >= 0:
                bulk, left = bulk_modulus(p, pressure_b)
                flow[k, at_b] = pressure_rate[k, at_b] * p[1] * (p[9] - at) / bulk - left * (q_b + p[1] * speed)
            advance_line(fed, i, x, pressure_a, pressure_b, high, low, 0.5 * dt, z)
            continue
        opened = opening(x, p[6])
        if row.law == HYDRAULIC_DOUBLE:
            q_a, q_b, _, _ = flows_double(
                opened, pressure_a, pressure_b, p[2], p[3], p[4], p[5], p[7], high, low, p[11]
            )
            rate = chamber_rate(q_b, p[1], -speed, p[9] - at, p[10])
            flow[k, at_b] = (pressure_rate[k, at_b] - rate) * p[1] * (p[9] - at) / p[10]
        else:
            q_a, _ = flows_single(opened, pressure_a, p[2], p[4], p[7], high, low, p[11])
        rate = chamber_rate(q_a, p[0], speed, p[8] + at, p[10])
        flow[k, at_a] = (pressure_rate[k, at_a] - rate) * p[0] * (p[8] + at) / p[10]
