"""The fused engine: the whole run in one compiled loop, for fits, ensembles and long records.

It calls the same stages as the per-step engine; only the rigid-body algebra is its own (a platen without articulated
specimen), and Pinocchio is its oracle.
"""

import numpy as np
from numpy.typing import NDArray

from ..control.loop import control_sample
from ..core.compiled import compiled, compiled_inline
from ..core.errors import SimulationError
from ..mechanics.plant import Plant
from ..mechanics.platen_steps import integrate_platen
from ..mechanics.rigid_body import platen_inertia
from ..mechanics.schemes import DQ, TAU, V_SEEN, A, V, dexp_inverse, kick, open_step, rates_stage, staggered_stage

__all__ = ["INERTIA", "inertia_table", "platen_acceleration", "refuse_joints", "run_fused"]

Array = NDArray[np.float64]

INERTIA = np.dtype(
    [
        ("plain", np.float64, (6, 6)),  # spatial inertia of the platen body at B, linear first
        ("inverse", np.float64, (6, 6)),  # of plain plus directional mass, on the free axes, zero elsewhere
        ("gravity", np.float64),  # [m/s2]
    ]
)


def refuse_joints(plant: Plant) -> None:
    """Raise SimulationError for a specimen with free joints."""
    if plant.articulated:
        raise SimulationError(
            "the fused engine takes a platen with a rigid specimen at most; take the engine pinocchio for free joints "
            "(--engine pinocchio), or lock them (--locked)"
        )


def inertia_table(plant: Plant) -> NDArray[np.void]:
    """Table (one row) of the rigid body; raises SimulationError for an articulated specimen."""
    refuse_joints(plant)
    plain, full = platen_inertia(plant.model, plant.machine)
    table = np.zeros(1, INERTIA)
    table["plain"] = plain
    block = np.ix_(plant.axes, plant.axes)
    inverse = np.zeros((6, 6))
    inverse[block] = np.linalg.inv(full[block])
    table["inverse"] = inverse
    table["gravity"] = plant.machine.platen.gravity
    return table


@compiled_inline
def platen_acceleration(inertia, axes, frame, tau, work, a):
    """Forward dynamics of the platen body: fill a (n_axes,) from tau at the pose and twist in frame (ABA's oracle).

    M a = tau + I g_b - v x* (I v), g_b gravity in platen axes, I the Inertia's part of M. work (2, 6) is scratch.
    """
    plain = inertia[0].plain
    inverse = inertia[0].inverse
    g = inertia[0].gravity
    momentum, total = work[0], work[1]
    v0, v1, v2 = frame[4, 0], frame[4, 1], frame[4, 2]
    w0, w1, w2 = frame[5, 0], frame[5, 1], frame[5, 2]
    gx, gy, gz = -g * frame[2, 0], -g * frame[2, 1], -g * frame[2, 2]
    for i in range(6):
        momentum[i] = (
            plain[i, 0] * v0
            + plain[i, 1] * v1
            + plain[i, 2] * v2
            + plain[i, 3] * w0
            + plain[i, 4] * w1
            + plain[i, 5] * w2
        )
        total[i] = plain[i, 0] * gx + plain[i, 1] * gy + plain[i, 2] * gz
    for k in range(axes.size):
        total[axes[k]] += tau[k]
    p0, p1, p2 = momentum[0], momentum[1], momentum[2]
    h0, h1, h2 = momentum[3], momentum[4], momentum[5]
    total[0] -= w1 * p2 - w2 * p1
    total[1] -= w2 * p0 - w0 * p2
    total[2] -= w0 * p1 - w1 * p0
    total[3] -= w1 * h2 - w2 * h1 + v1 * p2 - v2 * p1
    total[4] -= w2 * h0 - w0 * h2 + v2 * p0 - v0 * p2
    total[5] -= w0 * h1 - w1 * h0 + v0 * p1 - v1 * p0
    for k in range(axes.size):
        i = axes[k]
        value = 0.0
        for j in range(6):
            value += inverse[i, j] * total[j]
        a[k] = value


@compiled
def _euler_step(
    q,
    dt,
    axes,
    legs,
    body,
    rows,
    damping,
    spool,
    supply,
    frame,
    port,
    JB,
    z,
    zd,
    force,
    motion,
    inertia,
    work,
):
    motion[V_SEEN] = motion[V]
    status = rates_stage(q, axes, legs, body, rows, damping, spool, supply, frame, port, JB, z, zd, force, motion)
    if status != 0:
        return status
    platen_acceleration(inertia, axes, frame, motion[TAU], work, motion[A])
    motion[DQ] = dt * motion[V]
    integrate_platen(q, motion[DQ], axes, q)
    for k in range(motion.shape[1]):
        motion[V, k] += dt * motion[A, k]
    for k in range(z.size):
        z[k] += dt * zd[k]
    return 0


@compiled
def _rk4_step(
    q,
    dt,
    axes,
    legs,
    body,
    rows,
    damping,
    spool,
    supply,
    frame,
    port,
    JB,
    z,
    zd,
    force,
    motion,
    inertia,
    work,
):
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
            integrate_platen(q, motion[DQ], axes, q_at)
            for k in range(z.size):
                z_at[k] = z0[k] + reach * dt * zd[k]
        else:
            motion[DQ, :] = 0.0
        for k in range(n):
            motion[V_SEEN, k] = v0[k] + reach * dt * dv[k]
        status = rates_stage(
            q_at, axes, legs, body, rows, damping, spool, supply, frame, port, JB, z_at, zd, force, motion
        )
        if status != 0:
            return status
        if n == 6:
            dexp_inverse(motion[DQ], motion[V_SEEN], step)
        else:
            step[:] = motion[V_SEEN]
        platen_acceleration(inertia, axes, frame, motion[TAU], work, dv)
        if stage == 0:
            motion[A] = dv
        for k in range(n):
            sum_q[k] += weight * step[k]
            sum_v[k] += weight * dv[k]
        for k in range(z.size):
            sum_z[k] += weight * zd[k]
    motion[DQ] = dt * sum_q
    integrate_platen(q, motion[DQ], axes, q)
    for k in range(n):
        motion[V, k] = v0[k] + dt * sum_v[k]
    for k in range(z.size):
        z[k] = z0[k] + dt * sum_z[k]
    return 0


@compiled
def run_fused(
    scheme,
    first,
    last,
    steps,
    dt,
    axes,
    legs,
    body,
    rows,
    damping,
    supply,
    delays,
    inertia,
    q,
    z,
    zd,
    motion,
    port,
    JB,
    frame,
    force,
    fed,
    closed,
    axis,
    actuator,
    balance,
    canceller,
    memory,
    drive,
    command,
    spool,
    every,
    out_q,
    out_v,
    out_a,
    out_z,
    out_spool,
):
    """Run controller samples first..last (exclusive) of `steps` model steps each.

    scheme 0 semi_implicit, 1 euler, 2 rk4. closed: the controller (axis, actuator, balance, canceller, memory) fills
    command (n, nu) from drive and spool (steps, nu) holds those of the last sample; otherwise spool (n * k, nu) drives,
    k rows a sample. fed (nu,) are the actuators' rows.
    Every `every`-th sample is written to out_*. The other arrays are those of `Plant` and `Workspace`.
    Returns (status, samples done, commands clipped).
    """
    nu = command.shape[1]
    window = spool if closed else np.zeros((steps, nu))
    work = np.zeros((2, 6))
    a = np.zeros(motion.shape[1])
    per_sample = spool.shape[0] // max(1, command.shape[0])
    clipped = 0
    if scheme == 0:
        open_step(motion, dt)
    for sample in range(first, last):
        if closed:
            if scheme != 0:  # the other schemes leave the ports of their last stage behind
                motion[V_SEEN] = motion[V]
                rates_stage(
                    q,
                    axes,
                    legs,
                    body,
                    rows,
                    damping,
                    window[0],
                    supply,
                    frame,
                    port,
                    JB,
                    z,
                    zd,
                    force,
                    motion,
                )
                platen_acceleration(inertia, axes, frame, motion[TAU], work, motion[A])
            clipped += control_sample(
                sample,
                drive,
                port,
                force,
                fed,
                frame,
                motion,
                legs,
                body,
                axes,
                axis,
                actuator,
                balance,
                canceller,
                memory,
                command,
                delays,
                1.0 / (steps * dt),
                window,
            )
        else:
            for j in range(steps):
                row = sample * per_sample + j * per_sample // steps
                for i in range(nu):
                    window[j, i] = spool[row, i]
        if sample % every == 0:
            at = sample // every
            out_q[at] = q
            out_v[at] = motion[V]
            out_a[at] = motion[A]
            out_z[at] = z
            for i in range(nu):
                out_spool[at, i] = window[:, i].sum() / steps
        status = 0
        for j in range(steps):
            if scheme == 0:
                integrate_platen(q, motion[DQ], axes, q)
                status = staggered_stage(
                    q, dt, axes, legs, body, rows, damping, window[j], supply, frame, port, JB, z, force, motion
                )
                if status != 0:
                    break
                platen_acceleration(inertia, axes, frame, motion[TAU], work, a)
                kick(motion, a, dt)
            elif scheme == 1:
                status = _euler_step(
                    q, dt, axes, legs, body, rows, damping, window[j], supply, frame, port, JB, z, zd, force, motion,
                    inertia, work,
                )  # fmt: skip
            else:
                status = _rk4_step(
                    q, dt, axes, legs, body, rows, damping, window[j], supply, frame, port, JB, z, zd, force, motion,
                    inertia, work,
                )  # fmt: skip
            if status != 0:
                break
        if status != 0:
            return status, sample + 1, clipped
    return 0, last, clipped
