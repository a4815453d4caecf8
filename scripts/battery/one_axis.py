"""A one-axis servo-hydraulic table in plain state equations, independent of the package; many runs side by side.

Double-rod cylinder, four-way servovalve behind a delay and a first-order lag, friction by bristles, PID control of
displacement. States of a run: x, v, P_A, P_B, s, u (rows of `y`); runs are columns. SI units; the command and the spool
count one at full opening.

    M dv/dt = A (P_A - P_B) - F,   F = F_c s + F_c Y b ds/dt + c v
    V_A/beta dP_A/dt = Q_A - A v - C (P_A - P_B),   V_B/beta dP_B/dt = Q_B + A v + C (P_A - P_B)
    Q_A = k w root(P_s - P_A) opened to A, k w root(P_A - P_r) opened to B; Q_B likewise, reversed
    w = sign(u + u_0) max(|u + u_0| - d, 0)
    T du/dt = command(t - delay) - u
    ds/dt = v/Y sign(r) |r|^n,   r = 1 - s sign(v) F_c/g(v),   g = F_c + F_s exp(-(v/v_s)^2)

n = 1 is LuGre's friction with damping b of the bristles [s], any other n Dahl's; F_s lets either fall with speed
(Stribeck). Sources: Merritt (1967) for the oil; Canudas de Wit et al. (1995), Dahl (1968) for friction.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from .simulate import RATE

__all__ = ["Control", "Run", "Table", "at_rest", "control_loop", "march", "rates", "stacked", "valve_flows"]

X, V, PA, PB, BRISTLE, SPOOL = range(6)
SUBSTEPS = 4
"""Integration steps in one sample of the controller. A delay is a whole number of them."""

Array = np.ndarray


class Table(NamedTuple):
    """A table's numbers; each a number, or one value for each of several runs (runs,)."""

    mass: Array | float  # [kg] of all that moves
    area: Array | float  # [m2]
    chamber_a: Array | float  # [m] chamber length with the piston in the middle, lines and ports included
    chamber_b: Array | float  # [m]
    bulk: Array | float  # [Pa]
    supply: Array | float  # [Pa]
    back: Array | float  # [Pa]
    valve: Array | float  # [m3/s/Pa^0.5] k, one port wide open
    leakage: Array | float  # [m3/s/Pa] C, across the piston
    lag: Array | float  # [s] T
    delay: Array | float  # [s]
    friction: Array | float  # [N] F_c
    span: Array | float  # [m] Y, by which a bristle bends
    exponent: Array | float = 1.0  # [1] n
    bristle_damping: Array | float = 0.0  # [s] b
    viscous: Array | float = 0.0  # [N s/m] c
    null: Array | float = 0.0  # [1] u_0
    overlap: Array | float = 0.0  # [1] d
    stribeck: Array | float = 0.0  # [N] F_s
    stribeck_speed: Array | float = 1.0  # [m/s] v_s


class Control(NamedTuple):
    """A PID controller of displacement with feed-forward of velocity, as tuned on a nominal table."""

    proportional: Array | float  # [1/s]
    integral: Array | float  # [1/s2]
    derivative: Array | float  # [1]
    low_pass: Array | float  # [Hz] of the error's derivative
    speed: Array | float  # [m/s] that full command gives at no load, as the controller's maker believes
    trim: Array | float = 0.0  # [1] command that the integral has reached before the test


class Run(NamedTuple):
    """Results at the controller's samples (n, runs); `y` are the states (n, 6, runs)."""

    y: Array
    acceleration: Array  # [m/s2]
    command: Array  # [1]


def stacked(tables: Sequence[Table]) -> Table:
    """Several tables as one of arrays (runs,)."""
    return Table(*(np.array(column, dtype=float) for column in zip(*tables, strict=True)))


def at_rest(table: Table, runs: int) -> Array:
    """States at rest (6, runs): both chambers at half the supply, the spool where it is closed."""
    y = np.zeros((6, runs))
    y[PA] = y[PB] = 0.5 * (np.asarray(table.supply) + table.back)
    y[SPOOL] = -np.asarray(table.null)
    return y


@njit(cache=True)
def root(drop: Array) -> Array:
    """Signed square root of a pressure drop."""
    return np.copysign(np.sqrt(np.abs(drop)), drop)


@njit(cache=True)
def valve_flows(table: Table, spool: Array, a: Array, b: Array) -> tuple[Array, Array]:
    """Flows from the valve into chambers A and B [m3/s] at their pressures a, b [Pa]."""
    x = spool + table.null
    opened = table.valve * np.copysign(np.maximum(np.abs(x) - table.overlap, 0.0), x)
    to_a = x > 0.0
    drop_a = np.where(to_a, table.supply - a, a - table.back)
    drop_b = np.where(to_a, b - table.back, table.supply - b)
    return opened * root(drop_a), -opened * root(drop_b)


@njit(cache=True)
def slip(table: Table, v: Array, s: Array) -> Array:
    """Rate of a bristle's bend [1/s]."""
    faster = v / table.stribeck_speed
    left = 1.0 - s * np.sign(v) / (1.0 + table.stribeck / table.friction * np.exp(-faster * faster))
    return v / table.span * np.copysign(np.abs(left) ** table.exponent, left)


@njit(cache=True)
def rates(table: Table, y: Array, command: Array) -> Array:
    """Rates of all states (6, runs) at a command that has arrived at the valve."""
    x, v, a, b, s, spool = y[X], y[V], y[PA], y[PB], y[BRISTLE], y[SPOOL]
    flow_a, flow_b = valve_flows(table, spool, a, b)
    bend = slip(table, v, s)
    drag = table.friction * (s + table.span * table.bristle_damping * bend) + table.viscous * v
    leak = table.leakage * (a - b)
    oil = table.bulk / table.area
    dy = np.empty_like(y)
    dy[X] = v
    dy[V] = (table.area * (a - b) - drag) / table.mass
    dy[PA] = oil / (table.chamber_a + x) * (flow_a - table.area * v - leak)
    dy[PB] = oil / (table.chamber_b - x) * (flow_b + table.area * v + leak)
    dy[BRISTLE] = bend
    dy[SPOOL] = (command - spool) / table.lag
    return dy


def march(table: Table, y: Array, samples: int, law: Callable[[int, Array], Array], *, substeps: int = SUBSTEPS) -> Run:
    """Classical Runge-Kutta steps from states y (6, runs).

    law(k, y) gives the command (runs,) of controller sample k, which is held until the next one and arrives at the
    valve after the delay; before that arrives the first one.
    """
    runs, h = y.shape[1], 1.0 / (RATE * substeps)
    table = Table(*(np.broadcast_to(number, runs).astype(float) for number in table))
    late = np.round(table.delay / h).astype(int)
    found = Run(np.empty((samples, 6, runs)), np.empty((samples, runs)), np.empty((samples, runs)))
    y = np.array(y)
    for k in range(samples):
        found.y[k], found.command[k] = y, law(k, y)
        found.acceleration[k] = _advance(table, y, found.command, late, k * substeps, substeps)
    return found


@njit(cache=True)
def _advance(table: Table, y: Array, command: Array, late: Array, begun: int, substeps: int) -> Array:
    """Advance states y (6, runs) in place over one sample; the acceleration (runs,) at its start."""
    h, arrived = 1.0 / (RATE * substeps), np.empty(y.shape[1])
    acceleration = np.empty(y.shape[1])
    for step in range(substeps):
        for run in range(len(arrived)):
            arrived[run] = command[max((begun + step - late[run]) // substeps, 0), run]
        first = rates(table, y, arrived)
        if step == 0:
            acceleration[:] = first[V]
        second = rates(table, y + 0.5 * h * first, arrived)
        third = rates(table, y + 0.5 * h * second, arrived)
        fourth = rates(table, y + h * third, arrived)
        y += h / 6.0 * (first + 2.0 * (second + third) + fourth)
    return acceleration


def control_loop(control: Control, reference: Array) -> Callable[[int, Array], Array]:
    """The command law of a controller that follows a reference displacement (n, runs) at its samples [m]."""
    velocity = np.gradient(reference, 1.0 / RATE, axis=0)
    keep = np.exp(-2.0 * np.pi * np.asarray(control.low_pass) / RATE)
    total, before, slope = np.zeros(reference.shape[1]), np.zeros(reference.shape[1]), np.zeros(reference.shape[1])

    def law(k: int, y: Array) -> Array:
        error = reference[k] - y[X]
        slope[:] = keep * slope + (1.0 - keep) * (error - before) * RATE
        before[:] = error
        total[:] += error / RATE
        asked = velocity[k] + control.proportional * error + control.integral * total + control.derivative * slope
        return np.clip(control.trim + asked / control.speed, -1.0, 1.0)

    return law
