"""Three-variable control, one compiled step at the controller's rate.

The velocity command of each degree of freedom is (report, Chapter 5)

    u = Km N1..N5 [ Kxf xr + Kvf vr + Kaf ar + Kjf jr + Kx (xr - xf) + Kv (vr - vf) + Ka (ar - af)
                    + sat(Ki int (xr - xf)) - KF HP(f) ]

xr, vr, ar, jr are outputs of the reference generator, xf, vf, af of the feedback generator (`filters`). Inputs of the
feedback generator are the displacement xs, computed from those of the actuators by forward kinematics (one Gauss-Newton
step per sample), and the acceleration as of the platen, its own or computed from accelerometers
(`mechanics.accelerometers`). f is the actuators' force on that degree of freedom, HP a
first-order high-pass, N five notches. The actuator velocities follow by the kinematic Jacobian (Eq. 3-33) at the xs of
the preceding sample. In the null space of the motion an added velocity reduces internal forces. The spool command is
the inverse of the valve's flow curve (Eq. 4-2) at the actuator velocity over its unloaded velocity; an opening at rest
supplies the leakage.

For sine tests a canceller adds harmonics to the drive before the reference generator (`sine`).
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.compiled import INTEGER, MATRIX, VECTOR, compiled, compiled_inline, compiled_source
from ..core.names import SAMPLE_RATE
from ..laws.orifice import spool_for_opening
from ..mechanics.accelerometers import composed_acceleration
from ..mechanics.pose import gauss_newton_step, leg_jacobian, pose_acceleration
from ..mechanics.schemes import A, S, V
from ..mechanics.tables import unpack_tables
from ..mechanics.valve_delay import delayed_spools
from ..mechanics.workspace import unpack_workspace
from .filters import NOTCHES
from .tables import unpack_control, unpack_scratch

__all__ = ["CONTROL_TYPES", "FEEDBACK", "FORCE", "GENERATOR", "MEMORY_ROWS", "POSE", "Feedback", "cancel"]
__all__ += ["control_packed", "control_sample", "control_step", "sense", "sense_packed", "step_packed"]


class Feedback(NamedTuple):
    """Sensors at one sample. A run reuses the same arrays for every sample: copy what must be kept."""

    displacement: Array  # (n_actuators,) from the zero-position [m]
    acceleration: Array  # (6,) of C in {s} and Euler angles, as accelerometers give it if there are any [m/s2, rad/s2]
    force: Array  # (n_actuators,) [N]


POSE, RESET, FORCE, HIGH_PASSED, CLIPPED = range(5)
GENERATOR, FEEDBACK, NOTCH = 5, 9, 12
MEMORY_ROWS = NOTCH + 2 * NOTCHES
"""Rows of the memory: pose estimate, reset integral, force at the last sample, its high-passed value, number of clipped
commands at the last sample, states of the reference generator (4), of the feedback generator (3) and of the notches (2
each); then two weights per canceller."""


@compiled_inline
def generate(row, drive, state, k, out):
    """Reference generator of one axis: fill out (4,) xr vr ar jr and advance column k of state (4, ...)."""
    for i in range(4):
        total = row.generator_d[i] * drive
        for j in range(4):
            total += row.generator_c[i, j] * state[j, k]
        out[i] = total
    s0, s1, s2, s3 = state[0, k], state[1, k], state[2, k], state[3, k]
    for i in range(4):
        state[i, k] = (
            row.generator_a[i, 0] * s0
            + row.generator_a[i, 1] * s1
            + row.generator_a[i, 2] * s2
            + row.generator_a[i, 3] * s3
            + row.generator_b[i] * drive
        )


@compiled_inline
def compose(row, displacement, acceleration, state, k, out):
    """Feedback generator of one axis: fill out (3,) xf vf af and advance column k of state (3, ...)."""
    s0, s1, s2 = state[0, k], state[1, k], state[2, k]
    for i in range(3):
        out[i] = (
            row.feedback_c[i, 0] * s0
            + row.feedback_c[i, 1] * s1
            + row.feedback_c[i, 2] * s2
            + row.feedback_d[i, 0] * displacement
            + row.feedback_d[i, 1] * acceleration
        )
    for i in range(3):
        state[i, k] = (
            row.feedback_a[i, 0] * s0
            + row.feedback_a[i, 1] * s1
            + row.feedback_a[i, 2] * s2
            + row.feedback_b[i, 0] * displacement
            + row.feedback_b[i, 1] * acceleration
        )


@compiled_inline
def cancel(canceller, sample, a, error, level, weights):
    """Correction of the drive of free axis a at a sample; updates the weights (n, ...) by least mean squares (LMS).

    Each row adds level (w_c cos(theta) + w_s sin(theta)); its weights follow the negative gradient of the squared
    error, with the phase of the path from drive to feedback.
    """
    correction = 0.0
    for h in range(canceller.size):
        row = canceller[h]
        if int(row.axis) != a:
            continue
        c, s = np.cos(row.turn * sample), np.sin(row.turn * sample)
        weights[h, 0] += row.rate * error * (c * row.cosine - s * row.sine)
        weights[h, 1] += row.rate * error * (s * row.cosine + c * row.sine)
        correction += level * (weights[h, 0] * c + weights[h, 1] * s)
    return correction


@compiled_source
def control_step(sample, drive, feedback, tables, control, memory, scratch, command):
    """Fill command (n_actuators,) of one sample; memory is the controller's state, changed in place.

    drive (n, 6 or 13): input of the reference generators, in the quantity of their mode; for cancellers columns 6 to 11
    hold the wanted acceleration and column 12 their level, 0 to 1. Cancellers do not learn while commands are clipped.
    feedback (`Feedback`), tables of the plant, control of the controller (`ControlTables`), `Scratch`. Commands beyond
    their limit are clipped to it; returns their number.
    """
    legs, body, axes = tables.legs, tables.body, tables.axes
    axis, actuator, balance, canceller = control.axis, control.actuator, control.balance, control.canceller
    displacement, acceleration, force = feedback.displacement, feedback.acceleration, feedback.force
    K, reference, measured, rate = scratch.K, scratch.reference, scratch.measured, scratch.rate
    n = command.size
    pose = memory[POSE]
    leg_jacobian(pose, legs, body, scratch.port, scratch.J, scratch.B, scratch.frame, K)
    gauss_newton_step(displacement, scratch.port, K, axes, pose)
    for i in range(n):
        rate[i] = 0.0
    for a in range(axes.size):
        k = axes[a]
        row = axis[a]
        compose(row, pose[k], acceleration[k], memory[FEEDBACK:], a, measured)
        wanted = drive[sample, k]
        if canceller.size > 0:
            level = drive[sample, 12]
            scaled_error = level * (drive[sample, 6 + k] - measured[2]) if memory[CLIPPED, 0] == 0.0 else 0.0
            wanted += cancel(canceller, sample, a, scaled_error, level, memory[MEMORY_ROWS:])
        generate(row, wanted, memory[GENERATOR:], a, reference)
        total = 0.0
        for i in range(n):
            total += K[i, k] * (force[i] - actuator[i].force)
        passed = row.high_pass * (memory[HIGH_PASSED, a] + total - memory[FORCE, a])
        memory[FORCE, a] = total
        memory[HIGH_PASSED, a] = passed
        error = reference[0] - measured[0]
        reset = memory[RESET, a] + row.reset_gain * error
        reset = min(row.reset_limit, max(-row.reset_limit, reset))
        memory[RESET, a] = reset
        speed = (
            row.displacement_feedforward * reference[0]
            + row.velocity_feedforward * reference[1]
            + row.acceleration_feedforward * reference[2]
            + row.jerk_feedforward * reference[3]
            + row.displacement_gain * error
            + row.velocity_gain * (reference[1] - measured[1])
            + row.acceleration_gain * (reference[2] - measured[2])
            + reset
            - row.force_gain * passed
        )
        for j in range(int(row.notches)):
            at = NOTCH + 2 * j
            out = row.notch[j, 0] * speed + memory[at, a]
            memory[at, a] = row.notch[j, 1] * speed - row.notch[j, 3] * out + memory[at + 1, a]
            memory[at + 1, a] = row.notch[j, 2] * speed - row.notch[j, 4] * out
            speed = out
        speed *= row.master_gain
        for i in range(n):
            rate[i] += K[i, k] * speed
    clipped = 0
    for i in range(n):
        for j in range(n):
            rate[i] -= balance[i, j] * (force[j] - actuator[j].force)
        row = actuator[i]
        # the sign of the opening selects the orifices, and so the velocity at full opening; the bias feeds the leakage
        flow = rate[i] + row.bias * (row.extend if row.bias >= 0.0 else row.retract)
        spool = spool_for_opening(flow / (row.extend if flow >= 0.0 else row.retract), row.flow_curve)
        if abs(spool) > row.limit:
            clipped += 1
            spool = row.limit if spool > 0.0 else -row.limit
        command[i] = spool
    memory[CLIPPED, 0] = clipped
    return clipped


@compiled
def sense(tables, ws, feedback):
    """Fill the sensors (`Feedback`) of a running plant from its workspace."""
    for i in range(tables.actuators.size):
        feedback.displacement[i] = ws.port[S, i]
        feedback.force[i] = ws.force[tables.actuators[i], 0]
    v, a = ws.motion[V], ws.motion[A]
    pose_acceleration(ws.frame, tables.body, tables.axes, v, a, feedback.acceleration)
    if tables.accelerometers.size > 0:
        gravity = tables.inertia[0].gravity
        composed_acceleration(tables.accelerometers, ws.frame, tables.axes, v, a, gravity, feedback.acceleration)


@compiled_source
def control_sample(sample, drive, tables, ws, control, memory, scratch, command, window):
    """One controller sample of a run: sensors, command, and the delayed spools of its model steps.

    Fills row `sample` of command (n, n_actuators) and window (n_steps, n_actuators). Returns the number of commands
    clipped.
    """
    feedback = Feedback(scratch.displacement, scratch.acceleration, scratch.force)
    sense(tables, ws, feedback)
    clipped = control_step(sample, drive, feedback, tables, control, memory, scratch, command[sample])
    delayed_spools(command, 0, sample, tables.delays, float(SAMPLE_RATE), window)
    return clipped


# Called once per sample from Python, with tables and workspace packed: a single array is cheaper to pass.


@compiled
def control_packed(sample, drive, tables, buffer, control, memory, scratch, command, window):
    """`control_sample` with its tables, workspace and scratch packed."""
    plant, ws, own = unpack_tables(tables), unpack_workspace(buffer), unpack_scratch(scratch)
    return control_sample(sample, drive, plant, ws, unpack_control(control), memory, own, command, window)


CONTROL_TYPES = INTEGER, MATRIX, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR, MATRIX, MATRIX
"""Types of the arguments of `control_packed`."""


@compiled
def step_packed(sample, drive, displacement, acceleration, force, tables, control, memory, scratch, command):
    """`control_step` with its sensors as arrays, its tables and scratch packed."""
    sensors, plant, own = Feedback(displacement, acceleration, force), unpack_tables(tables), unpack_scratch(scratch)
    return control_step(sample, drive, sensors, plant, unpack_control(control), memory, own, command)


@compiled
def sense_packed(tables, buffer, displacement, acceleration, force):
    """`sense` with tables and workspace packed."""
    sense(unpack_tables(tables), unpack_workspace(buffer), Feedback(displacement, acceleration, force))
