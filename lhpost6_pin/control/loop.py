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
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.compiled import INTEGER, MATRIX, VECTOR, compiled, compiled_inline, compiled_source
from ..core.names import SAMPLE_RATE
from ..core.packed import array_view, table_view
from ..laws.orifice import spool_for_opening
from ..mechanics.accelerometers import composed_acceleration
from ..mechanics.pose import gauss_newton_step, leg_jacobian, pose_acceleration
from ..mechanics.schemes import A, S, V
from ..mechanics.tables import unpack_tables
from ..mechanics.valve_delay import delayed_spools
from ..mechanics.workspace import unpack_workspace
from .filters import NOTCHES

__all__ = ["ACTUATOR", "AXIS", "CANCELLER", "CONTROL_TYPES", "FEEDBACK", "FORCE", "GENERATOR", "MEMORY_ROWS", "POSE"]
__all__ += ["ControlTables", "Feedback", "control_packed", "control_sample", "control_step", "pack_control", "sense"]
__all__ += ["sense_packed", "step_packed"]

AXIS = np.dtype(
    [
        ("displacement_feedforward", np.float64),  # Kxf [1/s]
        ("velocity_feedforward", np.float64),  # Kvf [1]
        ("acceleration_feedforward", np.float64),  # Kaf [s]
        ("jerk_feedforward", np.float64),  # Kjf [s2]
        ("displacement_gain", np.float64),  # Kx [1/s]
        ("velocity_gain", np.float64),  # Kv [1]
        ("acceleration_gain", np.float64),  # Ka [s]
        ("reset_gain", np.float64),  # Ki per sample [1/s]
        ("reset_limit", np.float64),  # [m/s, rad/s]
        ("force_gain", np.float64),  # KF [m/s/N, rad/s/(N m)]
        ("high_pass", np.float64),  # pole of the force high-pass per sample
        ("master_gain", np.float64),  # Km [1]
        ("generator_a", np.float64, (4, 4)),  # reference generator: x+ = a x + b u, (xr vr ar jr) = c x + d u
        ("generator_b", np.float64, 4),
        ("generator_c", np.float64, (4, 4)),
        ("generator_d", np.float64, 4),
        ("feedback_a", np.float64, (3, 3)),  # feedback generator: inputs xs, as; outputs xf, vf, af
        ("feedback_b", np.float64, (3, 2)),
        ("feedback_c", np.float64, (3, 3)),
        ("feedback_d", np.float64, (3, 2)),
        ("notch", np.float64, (NOTCHES, 5)),  # b0 b1 b2 a1 a2 of each second-order section
        ("notches", np.float64),  # number of active sections
    ]
)
"""Table row of a free axis."""

ACTUATOR = np.dtype(
    [
        ("extend", np.float64),  # unloaded speed at full opening [m/s]
        ("retract", np.float64),
        ("flow_curve", np.float64),  # lambda [1]
        ("bias", np.float64),  # opening at rest [1]
        ("force", np.float64),  # force at rest [N]
        ("limit", np.float64),  # largest spool command [1]
    ]
)
"""Table row of an actuator."""

CANCELLER = np.dtype(
    [
        ("axis", np.float64),  # index among the free axes
        ("turn", np.float64),  # phase per sample [rad]
        ("cosine", np.float64),  # of the phase of the path from drive to feedback at this frequency
        ("sine", np.float64),
        ("rate", np.float64),  # adaptation per sample over the gain of that path
    ]
)
"""Table row of a sine canceller: one harmonic of one axis."""


class ControlTables(NamedTuple):
    """Tables of a controller; treat the arrays as read only."""

    packed: Array  # all the following, concatenated
    axis: NDArray[np.void]  # AXIS, one row per free axis
    actuator: NDArray[np.void]  # ACTUATOR
    balance: Array  # (n_actuators, n_actuators) leg rate [m/s] per force [N] in the null space of the motion
    canceller: NDArray[np.void]  # CANCELLER, empty but in sine tests


class Feedback(NamedTuple):
    """Sensors at one sample. A run reuses the same arrays for every sample: copy what must be kept."""

    displacement: Array  # (n_actuators,) from the zero-position [m]
    acceleration: Array  # (6,) of C in {s} and Euler angles, as accelerometers give it if there are any [m/s2, rad/s2]
    force: Array  # (n_actuators,) [N]


def pack_control(
    axis: NDArray[np.void], actuator: NDArray[np.void], balance: Array, canceller: NDArray[np.void]
) -> ControlTables:
    """Tables of a controller, also packed into one array."""
    parts = [np.ascontiguousarray(x) for x in (axis, actuator, balance, canceller)]
    sizes = np.array([len(axis), len(actuator), len(canceller)], float)
    packed = np.concatenate([sizes, *(x.view(float).ravel() for x in parts)])
    return ControlTables._make([packed, *parts])


_AXIS_SIZE, _ACTUATOR_SIZE, _CANCELLER_SIZE = (d.itemsize // 8 for d in (AXIS, ACTUATOR, CANCELLER))


@compiled_inline
def unpack_control(packed):
    """Tables of a controller from `ControlTables.packed`, which the caller holds."""
    axes, n, cancellers = int(packed[0]), int(packed[1]), int(packed[2])
    actuator = 3 + _AXIS_SIZE * axes
    balance = actuator + _ACTUATOR_SIZE * n
    canceller = balance + n * n
    return ControlTables(
        array_view(packed, 0, (packed.size,)),
        table_view(packed, AXIS, 3, actuator),
        table_view(packed, ACTUATOR, actuator, balance),
        array_view(packed, balance, (n, n)),
        table_view(packed, CANCELLER, canceller, canceller + _CANCELLER_SIZE * cancellers),
    )


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
def control_step(sample, drive, feedback, tables, control, memory, command):
    """Fill command (n_actuators,) of one sample; memory is the controller's state, changed in place.

    drive (n, 6 or 13): input of the reference generators, in the quantity of their mode; for cancellers columns 6 to 11
    hold the wanted acceleration and column 12 their level, 0 to 1. Cancellers do not learn while commands are clipped.
    feedback (`Feedback`), tables of the plant, control of the controller (`ControlTables`). Commands beyond their limit
    are clipped to it; returns their number.
    """
    legs, body, axes = tables.legs, tables.body, tables.axes
    axis, actuator, balance, canceller = control.axis, control.actuator, control.balance, control.canceller
    displacement, acceleration, force = feedback.displacement, feedback.acceleration, feedback.force
    n = command.size
    ports = legs.size
    for i in range(legs.size):
        if legs[i].pad >= 0:
            ports = max(ports, legs[i].pad + 2)
    pose = memory[POSE]
    s = np.empty(ports)
    J = np.empty((ports, 6))
    B = np.empty((ports, 6))
    K = np.empty((legs.size, 6))
    frame = np.empty((8, 3))
    reference = np.empty(4)
    measured = np.empty(3)
    leg_jacobian(pose, legs, body, s, J, B, frame, K)
    gauss_newton_step(displacement, s, K, axes, pose)
    rate = np.zeros(n)
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
def control_sample(sample, drive, tables, ws, control, memory, command, window):
    """One controller sample of a run: sensors, command, and the delayed spools of its model steps.

    Fills row `sample` of command (n, n_actuators) and window (n_steps, n_actuators). Returns the number of commands
    clipped.
    """
    n = tables.actuators.size
    feedback = Feedback(np.empty(n), np.empty(6), np.empty(n))
    sense(tables, ws, feedback)
    clipped = control_step(sample, drive, feedback, tables, control, memory, command[sample])
    delayed_spools(command, 0, sample, tables.delays, float(SAMPLE_RATE), window)
    return clipped


# Called once per sample from Python, with tables and workspace packed: a single array is cheaper to pass.


@compiled
def control_packed(sample, drive, tables, buffer, control, memory, command, window):
    """`control_sample` with its tables and workspace packed."""
    plant, ws = unpack_tables(tables), unpack_workspace(buffer)
    return control_sample(sample, drive, plant, ws, unpack_control(control), memory, command, window)


CONTROL_TYPES = INTEGER, MATRIX, VECTOR, VECTOR, VECTOR, MATRIX, MATRIX, MATRIX
"""Types of the arguments of `control_packed`."""


@compiled
def step_packed(sample, drive, displacement, acceleration, force, tables, control, memory, command):
    """`control_step` with its sensors as arrays and its tables packed."""
    sensors, plant = Feedback(displacement, acceleration, force), unpack_tables(tables)
    return control_step(sample, drive, sensors, plant, unpack_control(control), memory, command)


@compiled
def sense_packed(tables, buffer, displacement, acceleration, force):
    """`sense` with tables and workspace packed."""
    sense(unpack_tables(tables), unpack_workspace(buffer), Feedback(displacement, acceleration, force))
