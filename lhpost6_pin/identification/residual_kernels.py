"""Residuals sample by sample, the compiled part: wrenches on the platen, and the mass balance of chambers.

Wrenches are at B in platen axes on the platen's free axes until they are summed; results are at C in {c}. Of the oil,
pressures and spools are measured; flow through lines and from the supply is marched along them by the simulation's
kernels.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.compiled import compiled, compiled_inline, copy_scaled
from ..effects.actuator import advance_line, start_line, supplied
from ..effects.evaluate import apply_forces
from ..effects.registry import PORTS
from ..effects.supply import close_supply, flows_exchanged, shared_states, steady_supply, supply_pressures
from ..effects.views import view_hydraulic
from ..laws.hydraulic import leak_flows, oil_modulus, rod_travel, rod_velocity
from ..laws.supply import varies
from ..mechanics.plant import Plant
from ..mechanics.port_path import PortPath
from ..simulation.ledger import add_at_c, add_row_at_c

__all__ = ["MeasuredOil", "oil_residuals", "part_pressures", "row_wrenches", "wrench_residual"]


def wrench_residual(
    plant: Plant, ports: PortPath, required: Array, z: Array, measured: Array, rows: NDArray[np.void] | None = None
) -> Array:
    """Required wrench (n, 6) at C in {c} less that of the plant's laws and of measured forces [N, N m].

    required is that of `required_wrench`, z (n, n_states) hidden states, measured (n, n_actuators) forces [N]; the laws
    are those of some `rows` of the plant alone, if given.
    """
    if rows is None:
        rows = plant.rows[plant.rows["spool"] < 0]
    out = np.zeros((len(z), 6))
    _residual(rows, plant.tables, ports, required, z, np.ascontiguousarray(measured), out)
    return out


@compiled
def _residual(rows, tables, ports, required, z, measured, out):
    s, axes, column = ports.s, tables.axes, ports.column
    force, port_force = np.zeros((rows.size, len(PORTS))), np.zeros(s.shape[1])
    frame, rest = np.zeros((8, 3)), np.zeros((1, 6))
    for k in range(s.shape[0]):
        apply_forces(rows, s[k], ports.rate[k], z[k], force, port_force)
        for i in range(measured.shape[1]):
            port_force[i] += measured[k, i]
        for j in range(axes.size):
            given = 0.0
            for i in range(port_force.size):
                given += column[k, i, axes[j]] * port_force[i]
            rest[0, axes[j]] = required[k, axes[j]] - given
        for i in range(3):
            copy_scaled(1.0, ports.turn[k, i], frame[i])
        add_at_c(1.0, rest, 0, tables.body[0].rho_c, frame, out[k])


def row_wrenches(plant: Plant, ports: PortPath, z: Array, rows: NDArray[np.void]) -> Array:
    """Wrenches (n, k, 6) at C in {c} [N, N m] of k rows of the plant's effects that take no spool."""
    out = np.zeros((len(z), len(rows), 6))
    _row_wrenches(np.ascontiguousarray(rows), plant.body, ports, z, out)
    return out


@compiled
def _row_wrenches(rows, body, ports, z, out):
    s = ports.s
    force, port_force = np.zeros((rows.size, len(PORTS))), np.zeros(s.shape[1])
    frame, rho = np.zeros((8, 3)), body[0].rho_c
    for k in range(s.shape[0]):
        apply_forces(rows, s[k], ports.rate[k], z[k], force, port_force)
        for i in range(3):
            copy_scaled(1.0, ports.turn[k, i], frame[i])
        for i in range(rows.size):
            add_row_at_c(force[i], ports.column[k], rows[i], rho, frame, out[k, i])


class MeasuredOil(NamedTuple):
    """What is measured of the oil along a test of n samples."""

    chamber: NDArray[np.int64]  # (n_actuators, 2) columns of pressure, -1 without chamber B
    pressure: Array  # (n, n_chambers) [Pa]
    pressure_rate: Array  # (n, n_chambers) [Pa/s]
    spool: Array  # (n, n_actuators) [1]
    side: Array  # (n, n_actuators) of its play on which a loose pin stands [1]; NaN or empty: that of the oil's force
    side_rate: Array  # (n, n_actuators) [1/s]
    dt: float  # [s]


@compiled
def part_pressures(rows, oil, ports, room):
    """Add to the chamber pressures and rates of `oil`, in place, the mean pressure that their difference brings.

    Both chambers were set to one mean, from which it is `room` [Pa] to the supply and to the return. Off mid-stroke
    their volumes differ: compressed by the same flow Q, the smaller one changes more, and the valve's ports restore the
    mean e at the pace at which pressure drops share the flow:

        de/dt = (V_B - V_A) / (2 (V_A + V_B)) d(P_A - P_B)/dt - r e,   r = beta |Q| / (4 drop) (1 / V_A + 1 / V_B)

    Q follows from continuity of the difference. Derived from Eqs. 4-3 to 4-5 to first order in e.
    """
    for i in range(rows.size):
        p, port = view_hydraulic(rows[i].numbers), rows[i].port
        a, b = oil.chamber[rows[i].spool]
        mean, pull = 0.0, 0.0
        for k in range(oil.pressure.shape[0]):
            at, speed = ports.s[k, port], ports.rate[k, port]
            long_a, long_b = p.chamber_a + at, p.chamber_b - at
            apart, rate = oil.pressure[k, a] - oil.pressure[k, b], oil.pressure_rate[k, a] - oil.pressure_rate[k, b]
            bulk = oil_modulus(p, True, 0.5 * (oil.pressure[k, a] + oil.pressure[k, b]))[0]
            stiffness = bulk / p.area_a * (1.0 / long_a + 1.0 / long_b)  # of both chambers [Pa/m3]
            flow = p.area_a * speed + p.leakage * apart + rate / stiffness
            drop = max(room - 0.5 * math.copysign(apart, apart * flow), 0.05 * room)
            pace = 0.25 * abs(flow) / drop * stiffness
            before, pull = pull, 0.5 * rate * (long_b - long_a) / (long_a + long_b)
            if k > 0:
                kept = math.exp(-pace * oil.dt)
                held = -math.expm1(-pace * oil.dt) / pace if pace > 0.0 else oil.dt
                mean = kept * mean + 0.5 * (before + pull) * held
            for side in (a, b):
                oil.pressure[k, side] += mean
                oil.pressure_rate[k, side] += pull - pace * mean


@compiled
def oil_residuals(rows, supply, oil, ports, z, drooped, flow, valve):
    """Fill drooped (n,), the supply's pressure [Pa], flow (n, n_chambers) [m3/s], which may have no columns, and valve.

    rows are the actuators', oil is `MeasuredOil`, ports the path of the ports, z (n_states,) scratch. valve, as large
    as flow, is what the valves give into each chamber [m3/s].
    """
    last = np.zeros(4)
    for k in range(oil.pressure.shape[0]):
        high, low = _follow_supply(k, rows, oil, supply, z, last)
        drooped[k] = high
        if flow.shape[1] > 0:
            for i in range(rows.size):
                at, speed = ports.s[k, rows[i].port], ports.rate[k, rows[i].port]
                _flow_residuals(k, rows[i], oil, (high, low), (at, speed), z, (flow[k], valve[k]))


@compiled_inline
def _follow_supply(k, rows, oil, supply, z, last):
    """Set the oil of sample k in z (n_states,), pressures as measured; returns supply and return pressure [Pa].

    last (4,) keeps the supply's flows for the next sample.
    """
    for i in range(rows.size):
        a, b = oil.chamber[rows[i].spool]
        z[rows[i].state] = oil.pressure[k, a]
        if b >= 0:
            z[rows[i].state + 1] = oil.pressure[k, b]
    if varies(supply):
        if k == 0:
            steady_supply(rows, oil.spool[k], supply, z)
        else:
            close_supply(rows, oil.spool[k], supply, oil.dt, (last[0], last[1], last[2], last[3]), z)
        last[0], last[1] = shared_states(supply, z)
        last[2], last[3], _, _ = flows_exchanged(rows, oil.spool[k], supply, z)
    return supply_pressures(supply, z)


@compiled_inline
def _flow_residuals(k, row, oil, supply, rod, z, filled):
    """Fill a row's chambers in flow and valve (n_chambers,): V / beta dP/dt + A dL/dt - Q, and of Q the valve's part.

    supply holds its two pressures [Pa], rod its actuator's elongation [m] and velocity [m/s]; flows are in [m3/s].
    """
    p, x, i = view_hydraulic(row.numbers), oil.spool[k, row.spool], row.spool
    (high, low), (at, speed), (flow, valve) = supply, rod, filled
    at_a, at_b = oil.chamber[i, 0], oil.chamber[i, 1]
    pressure_a, rate_a = oil.pressure[k, at_a], oil.pressure_rate[k, at_a]
    pressure_b = rate_b = 0.0
    if at_b >= 0:
        pressure_b, rate_b = oil.pressure[k, at_b], oil.pressure_rate[k, at_b]
    modified = row.modified != 0
    if modified and k == 0:
        start_line(row, x, pressure_a, pressure_b, high, low, z)
    elif modified:
        advance_line(row, x, pressure_a, pressure_b, high, low, 0.5 * oil.dt, z)
    flow_a, flow_b, _, _ = supplied(row, modified, x, pressure_a, pressure_b, high, low, z)
    across, _, out_a, out_b, _, _ = leak_flows(p, modified, pressure_a, pressure_b, low)
    if oil.side.size == 0 or math.isnan(oil.side[k, i]):
        at += rod_travel(p, modified, pressure_a, pressure_b)
        speed += rod_velocity(p, modified, pressure_a, pressure_b, rate_a, rate_b)
    else:
        at += p.play * oil.side[k, i]
        speed += p.play * oil.side_rate[k, i]
    bulk, left = oil_modulus(p, modified, pressure_a)
    net = flow_a - across - out_a
    flow[at_a] = rate_a * p.area_a * (p.chamber_a + at) / bulk - left * (net - p.area_a * speed)
    valve[at_a] = flow_a
    if at_b >= 0:
        bulk, left = oil_modulus(p, modified, pressure_b)
        net = flow_b + across - out_b
        flow[at_b] = rate_b * p.area_b * (p.chamber_b - at) / bulk - left * (net + p.area_b * speed)
        valve[at_b] = flow_b
    if modified:
        advance_line(row, x, pressure_a, pressure_b, high, low, 0.5 * oil.dt, z)
