"""One step of each integration scheme, less the rigid-body algebra: what both engines share.

`semi_implicit`  staggered, second order: half a kick, drift, hidden states along the same slip, forces, half a kick.
                 Velocities sit half a step off between kicks and are handed out synchronised.
`euler`          the report's forward Euler: everything at the rates of the start of the step.
`rk4`            classical Runge-Kutta, the pose in local coordinates.

An engine brings two things: integrate(q, dq), and the forward dynamics a = f(q, v, tau), ABA.

tables are those of the plant (`tables`), ws its `workspace`: motion (7, nv) and port (4, n_ports), whose rows are named
below, JB (2, n_ports, 6) the ports' J and B, frame (8, 3) as in `ports`, force (n_rows, 3) the ledger, external (6,)
a wrench on the platen from outside, modal the scratch of
`modes`. A stage returns 0, or the number (from 1) of a leg out of its stroke, or -1 if not finite.
"""

import math

import numpy as np

from ..core.compiled import compiled, compiled_inline, compiled_source
from ..core.errors import SimulationError, UnknownNameError
from ..core.names import SAMPLE_RATE, SCHEMES
from ..effects.evaluate import advance_states, apply_forces, state_rates, wrench_on_platen
from .modes import add_modal_wrench, advance_modes, modal_rates
from .ports import evaluate_ports, place_ports, platen_pose

__all__ = ["DS", "FORCE", "SD", "A", "DQ", "S", "SPRING", "TAU", "V", "V_MID", "V_SEEN"]
__all__ += ["dexp_inverse", "kick", "open_step", "rates_stage", "set_twist", "staggered_stage", "steps_a_sample"]

V, A, V_MID, V_SEEN, DQ, TAU, SPRING = range(7)
"""Rows of `motion`: velocity, acceleration, velocity at mid-step and as forces see it, step of the pose, torque, and
that of springs in a specimen's joints at the pose."""
S, SD, DS, FORCE = range(4)
"""Rows of `port`: coordinate, rate, increment over the step, force."""


def steps_a_sample(scheme: str, steps_per_second: int) -> int:
    """Model steps in a controller sample; raises UnknownNameError or SimulationError for what no run can step by."""
    if scheme not in SCHEMES:
        raise UnknownNameError("scheme", scheme, SCHEMES)
    if steps_per_second < SAMPLE_RATE or steps_per_second % SAMPLE_RATE:
        nearest = max(1, round(steps_per_second / SAMPLE_RATE)) * SAMPLE_RATE
        raise SimulationError(
            f"steps per second must be a multiple of the controller rate, {SAMPLE_RATE} Hz (got {steps_per_second}); "
            f"nearest: {nearest}"
        )
    return steps_per_second // SAMPLE_RATE


@compiled_inline
def set_twist(v, axes, frame):
    """Scatter the platen's free velocities into the twist, rows 4 and 5 of frame."""
    if axes.size == 6:
        for k in range(3):
            frame[4, k] = v[k]
            frame[5, k] = v[3 + k]
        return
    for k in range(3):
        frame[4, k] = 0.0
        frame[5, k] = 0.0
    for k in range(axes.size):
        frame[4, axes[k]] = v[k]


@compiled_inline
def port_rates(J, frame, out):
    """Port rates J v of the twist in frame."""
    v0, v1, v2 = frame[4, 0], frame[4, 1], frame[4, 2]
    w0, w1, w2 = frame[5, 0], frame[5, 1], frame[5, 2]
    for i in range(out.size):
        out[i] = J[i, 0] * v0 + J[i, 1] * v1 + J[i, 2] * v2 + J[i, 3] * w0 + J[i, 4] * w1 + J[i, 5] * w2


@compiled_inline
def leg_out_of_stroke(legs, s):
    """Number (from 1) of the first leg out of its stroke, -1 if not finite, else 0."""
    for i in range(legs.size):
        if not abs(s[i]) <= legs[i].stroke:
            return i + 1 if math.isfinite(s[i]) else -1
        if not math.isfinite(s[i]):
            return -1
    return 0


@compiled_inline
def forces_stage(tables, ws, z):
    """Forces at the pose and ports in place, for V_SEEN and states z; fills port[SD], port[FORCE], force, TAU."""
    motion, port, frame, external, axes = ws.motion, ws.port, ws.frame, ws.external, tables.axes
    set_twist(motion[V_SEEN], axes, frame)
    port_rates(ws.JB[0], frame, port[SD])
    apply_forces(tables.rows, port[S], port[SD], z, ws.force, port[FORCE])
    wrench_on_platen(frame, tables.body, ws.JB[1], port[FORCE])
    if tables.modes.size > 0:
        add_modal_wrench(tables.modes, tables.coupling, tables.inertia[0].gravity, frame, z, ws.modal)
    if axes.size == 6:
        for k in range(3):
            motion[TAU, k] = frame[6, k] + external[k]
            motion[TAU, 3 + k] = frame[7, k] + external[3 + k]
    else:
        for k in range(axes.size):
            motion[TAU, k] = frame[6, axes[k]] + external[axes[k]]
    for k in range(axes.size, motion.shape[1]):  # specimen joints
        motion[TAU, k] = motion[SPRING, k] - tables.damping[k] * motion[V_SEEN, k]


@compiled_inline
def pose_stage(q, tables, ws):
    """Ports and springs at the pose q; returns the stage's status."""
    platen_pose(q, tables.axes, tables.body, ws.frame)
    for i in range(tables.springs.size):
        spring = tables.springs[i]
        at = q[spring.q] if spring.turns == 0 else math.atan2(q[spring.q + 1], q[spring.q])
        ws.motion[SPRING, spring.v] = spring.stiffness * (spring.rest - at)
    evaluate_ports(ws.frame, tables.legs, tables.body, ws.port[S], ws.JB[0], ws.JB[1])
    if tables.places.size > 0:
        place_ports(ws.frame, tables.places, ws.port[S], ws.JB[0], ws.JB[1])
    return leg_out_of_stroke(tables.legs, ws.port[S])


@compiled
def open_step(motion, dt):
    """Semi-implicit, start of a run: V_MID half a kick on from V, and the drift DQ."""
    for k in range(motion.shape[1]):
        motion[V_MID, k] = motion[V, k] + 0.5 * dt * motion[A, k]
        motion[DQ, k] = dt * motion[V_MID, k]


@compiled_inline
def kick(motion, acceleration, dt):
    """Semi-implicit: close the step with the acceleration at its end (V, A), open the next (V_MID, DQ)."""
    for k in range(motion.shape[1]):
        a = acceleration[k]
        v = motion[V_MID, k] + 0.5 * dt * a
        motion[A, k] = a
        motion[V, k] = v
        motion[V_MID, k] = v + 0.5 * dt * a
        motion[DQ, k] = dt * motion[V_MID, k]


@compiled_source
def staggered_stage(q, dt, tables, ws, spool):
    """Semi-implicit, after the drift to q: hidden states over the step, then forces at its end.

    On entry JB and port[S] are those of the step's start. Each port's slip is the mean of
    its rates at start and end of the step; forces see V_MID extrapolated by dt/2 A to the end.
    """
    motion, port, frame, JB = ws.motion, ws.port, ws.frame, ws.JB
    set_twist(motion[V_MID], tables.axes, frame)
    port_rates(JB[0], frame, port[DS])
    start = port[FORCE]  # free until the forces are known
    for i in range(start.size):
        start[i] = port[S, i]
    status = pose_stage(q, tables, ws)
    if status != 0:
        return status
    port_rates(JB[0], frame, port[SD])
    for i in range(start.size):
        port[DS, i] = 0.5 * dt * (port[DS, i] + port[SD, i])
    advance_states(tables.rows, start, port[DS], dt, spool, tables.supply, ws.z)
    if tables.modes.size > 0:
        advance_modes(tables.modes, tables.coupling, tables.inertia[0].gravity, frame, dt, ws.z, ws.modal)
    for k in range(motion.shape[1]):
        motion[V_SEEN, k] = motion[V_MID, k] + 0.5 * dt * motion[A, k]
    forces_stage(tables, ws, ws.z)
    return 0


@compiled_source
def rates_stage(q, z, tables, ws, spool):
    """Euler, RK4: forces and rates of hidden states at (q, V_SEEN, z), which need not be those of ws."""
    status = pose_stage(q, tables, ws)
    if status != 0:
        return status
    forces_stage(tables, ws, z)
    state_rates(tables.rows, ws.port[S], ws.port[SD], spool, tables.supply, z, ws.zd)
    if tables.modes.size > 0:
        modal_rates(tables.modes, z, ws.modal, ws.zd)
    return 0


@compiled
def dexp_inverse(step, v, out):
    """Rate of the local coordinates `step` whose pose moves with body twist v; six components, linear first.

    The series of the right-trivialised inverse differential of the exponential on SE(3): v + [x, v]/2 + [x, [x, v]]/12;
    its next term is of fourth order in the turn over one step, below 1e-16 for any shake table.
    """
    first = np.empty(6)
    second = np.empty(6)
    _bracket(step, v, first)
    _bracket(step, first, second)
    for k in range(6):
        out[k] = v[k] + 0.5 * first[k] + second[k] / 12.0


@compiled
def _bracket(x, y, out):
    """Lie bracket of twists, linear first: (w_x x v_y + v_x x w_y, w_x x w_y)."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[k] = x[3 + i] * y[j] - x[3 + j] * y[i] + x[i] * y[3 + j] - x[j] * y[3 + i]
        out[3 + k] = x[3 + i] * y[3 + j] - x[3 + j] * y[3 + i]
