"""The fused engine: the whole run in one compiled loop, for fits, ensembles and long records.

Its stages are those of the per-step engine; its rigid-body algebra is its own (a platen without articulated specimen),
tested against Pinocchio.
"""

from typing import NamedTuple

import numpy as np

from ..control.loop import control_sample
from ..control.tables import unpack_control, unpack_scratch
from ..core.arrays import Array
from ..core.compiled import (
    BOOLEAN,
    INTEGER,
    MATRIX,
    SCALAR,
    VECTOR,
    compiled,
    compiled_inline,
    compiled_source,
    copy_scaled,
    tuple_type,
)
from ..mechanics.forward_dynamics import platen_acceleration
from ..mechanics.moving_parts import bodies_acceleration
from ..mechanics.schemes import DQ, TAU, V_SEEN, A, V, dexp_inverse, kick, open_step, rates_stage, staggered_stage
from ..mechanics.spatial import integrate
from ..mechanics.tables import unpack_tables
from ..mechanics.workspace import unpack_workspace

__all__ = ["LOG_TYPES", "RUN_TYPES", "Log", "Signals", "Span", "explicit_run", "log_packed", "staggered_run"]


class Span(NamedTuple):
    """Samples of one call, scheme and steps."""

    scheme: int  # 0 semi_implicit, 1 euler, 2 rk4
    first: int  # controller samples first..last (exclusive)
    last: int
    dt: float  # of a model step [s]
    closed: bool  # loop closed by the controller; else recorded spools
    every: int  # samples per row of the log


class Signals(NamedTuple):
    """Inputs of a run, and its commands."""

    drive: Array  # (n, columns) of the controller's reference generators, closed loop
    memory: Array  # of the controller
    command: Array  # (n, n_actuators) of every sample, closed loop
    spool: Array  # (n * k, n_actuators) of every sample, k rows each, open loop
    window: Array  # (steps, n_actuators) of the last sample
    scratch: Array  # of the controller, packed


class Log(NamedTuple):
    """Results of a run, one row per recorded sample."""

    q: Array  # (n, nq)
    v: Array  # (n, nv)
    a: Array  # (n, nv)
    z: Array  # (n, n_states)
    spool: Array  # (n, n_actuators) mean over the sample


@compiled_inline
def _forward(tables, ws, work, a):
    """Forward dynamics: fill a (n_axes,) from the torque, pose and twist in ws; work (9, 6) is scratch."""
    if tables.inertia[0].bodies == 0:
        platen_acceleration(tables.inertia, tables.axes, ws.frame, ws.motion[TAU], work, a)
    else:
        bodies_acceleration(tables, ws.frame, ws.motion[TAU], work, a)


@compiled
def _accelerate(tables, ws, a):
    """Fill a (n_axes,) from the torque, pose and twist in ws."""
    _forward(tables, ws, np.empty((9, 6)), a)


@compiled
def _euler_step(dt, tables, ws, spool):
    motion, q, z = ws.motion, ws.q, ws.z
    copy_scaled(1.0, motion[V], motion[V_SEEN])
    status = rates_stage(q, z, tables, ws, spool)
    if status != 0:
        return status
    _accelerate(tables, ws, motion[A])
    copy_scaled(dt, motion[V], motion[DQ])
    integrate(q, motion[DQ], tables.axes, q)
    for k in range(motion.shape[1]):
        motion[V, k] += dt * motion[A, k]
    for k in range(z.size):
        z[k] += dt * ws.zd[k]
    return 0


@compiled
def _rk4_step(dt, tables, ws, spool):
    motion, q, z, zd, axes = ws.motion, ws.q, ws.z, ws.zd, tables.axes
    n = motion.shape[1]
    v0, z0, q_at = motion[V].copy(), z.copy(), q.copy()
    z_at = z.copy()
    sum_q, sum_v, sum_z = np.zeros(n), np.zeros(n), np.zeros(z.size)
    step, dv = np.zeros(n), np.zeros(n)
    for stage in range(4):
        reach = (0.0, 0.5, 0.5, 1.0)[stage]
        weight = (1.0, 2.0, 2.0, 1.0)[stage] / 6.0
        if stage > 0:
            for k in range(n):
                motion[DQ, k] = reach * dt * step[k]
            integrate(q, motion[DQ], axes, q_at)
            for k in range(z.size):
                z_at[k] = z0[k] + reach * dt * zd[k]
        else:
            motion[DQ, :] = 0.0
        for k in range(n):
            motion[V_SEEN, k] = v0[k] + reach * dt * dv[k]
        status = rates_stage(q_at, z_at, tables, ws, spool)
        if status != 0:
            return status
        if n == 6:
            dexp_inverse(motion[DQ], motion[V_SEEN], step)
        else:
            copy_scaled(1.0, motion[V_SEEN], step)
        _accelerate(tables, ws, dv)
        if stage == 0:
            copy_scaled(1.0, dv, motion[A])
        for k in range(n):
            sum_q[k] += weight * step[k]
            sum_v[k] += weight * dv[k]
        for k in range(z.size):
            sum_z[k] += weight * zd[k]
    copy_scaled(dt, sum_q, motion[DQ])
    integrate(q, motion[DQ], axes, q)
    for k in range(n):
        motion[V, k] = v0[k] + dt * sum_v[k]
    for k in range(z.size):
        z[k] = z0[k] + dt * sum_z[k]
    return 0


@compiled_inline
def _log_sample(at, ws, window, log):
    """Fill row `at` of the log from the workspace and the window (steps, n_actuators) of a sample's spools."""
    motion, steps = ws.motion, window.shape[0]
    for k in range(ws.q.size):
        log.q[at, k] = ws.q[k]
    for k in range(motion.shape[1]):
        log.v[at, k] = motion[V, k]
        log.a[at, k] = motion[A, k]
    for k in range(ws.z.size):
        log.z[at, k] = ws.z[k]
    for i in range(window.shape[1]):
        total = 0.0
        for j in range(steps):
            total += window[j, i]
        log.spool[at, i] = total / steps


@compiled_inline
def log_packed(at, buffer, window, q, v, a, z, spool):
    """`_log_sample` with workspace packed and the log as arrays, which are cheaper to pass from Python."""
    _log_sample(at, unpack_workspace(buffer), window, Log(q, v, a, z, spool))


LOG_TYPES = INTEGER, VECTOR, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX
"""Types of the arguments of `log_packed`."""


@compiled_inline
def _semi_implicit_step(dt, tables, ws, window, j, work, a):
    """A step with row j of window (n_steps, n_actuators); without reference counts, which the loop around it has."""
    motion, q = ws.motion, ws.q
    integrate(q, motion[DQ], tables.axes, q)
    status = staggered_stage(q, dt, tables, ws, window[j])
    if status == 0:
        _forward(tables, ws, work, a)
        kick(motion, a, dt)
    return status


@compiled_source
def _fill_window(sample, span, tables, ws, control, scratch, signals, window):
    """Fill the spools (n_steps, n_actuators) of a sample's steps, by the controller or from those of a record.

    Returns the number of commands clipped.
    """
    if span.closed:
        return control_sample(
            sample, signals.drive, tables, ws, control, signals.memory, scratch, signals.command, window
        )
    rows, steps = signals.spool.shape[0] // signals.command.shape[0], window.shape[0]
    for j in range(steps):
        row = sample * rows + j * rows // steps
        for i in range(window.shape[1]):
            window[j, i] = signals.spool[row, i]
    return 0


@compiled
def staggered_run(span, packed, buffer, controller, signals, log):
    """Run the samples of a span with the staggered scheme; tables, workspace and the controller's tables packed.

    Returns (status, samples done, commands clipped).
    """
    tables, ws, control = unpack_tables(packed), unpack_workspace(buffer), unpack_control(controller)
    scratch, motion, window = unpack_scratch(signals.scratch), ws.motion, signals.window
    work, a = np.zeros((9, 6)), np.zeros(motion.shape[1])
    clipped = 0
    open_step(motion, span.dt)
    for sample in range(span.first, span.last):
        clipped += _fill_window(sample, span, tables, ws, control, scratch, signals, window)
        if sample % span.every == 0:
            _log_sample(sample // span.every, ws, window, log)
        for j in range(window.shape[0]):
            status = _semi_implicit_step(span.dt, tables, ws, window, j, work, a)
            if status != 0:
                return status, sample + 1, clipped
    return 0, span.last, clipped


@compiled
def explicit_run(span, packed, buffer, controller, signals, log):
    """`staggered_run` with one of the other two schemes, whose code is longer than that of the default."""
    tables, ws, control = unpack_tables(packed), unpack_workspace(buffer), unpack_control(controller)
    scratch, motion, window = unpack_scratch(signals.scratch), ws.motion, signals.window
    clipped = 0
    for sample in range(span.first, span.last):
        if span.closed:  # these schemes leave the ports of their last stage
            copy_scaled(1.0, motion[V], motion[V_SEEN])
            rates_stage(ws.q, ws.z, tables, ws, window[0])
            _accelerate(tables, ws, motion[A])
        clipped += _fill_window(sample, span, tables, ws, control, scratch, signals, window)
        if sample % span.every == 0:
            _log_sample(sample // span.every, ws, window, log)
        for j in range(window.shape[0]):
            if span.scheme == 1:
                status = _euler_step(span.dt, tables, ws, window[j])
            else:
                status = _rk4_step(span.dt, tables, ws, window[j])
            if status != 0:
                return status, sample + 1, clipped
    return 0, span.last, clipped


RUN_TYPES = (
    tuple_type(Span, *[INTEGER] * 3, SCALAR, BOOLEAN, INTEGER),
    VECTOR,
    VECTOR,
    VECTOR,
    tuple_type(Signals, *[MATRIX] * 5, VECTOR),
    tuple_type(Log, *[MATRIX] * 5),
)
"""Types of the arguments of both."""
