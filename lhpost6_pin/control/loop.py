"""The displacement loop, one compiled step at the controller's rate.

Per degree of freedom a velocity is asked for,

    u = Kvf vr + Kx (xr - xf) + sat(Ki int (xr - xf)) - KF HP(f)

xr, vr reference displacement and velocity [m, rad and per s], xf the platen's displacement from the actuators' by
forward kinematics (one Gauss-Newton step a sample), f the actuators' force on that degree of freedom, HP a first-order
high-pass. The actuators' rates follow by the kinematic Jacobian at xf (Eq. 3-33). In the directions of force that do
not move the platen a velocity lets internal forces decay. Each rate becomes a spool by the inverse of the valve's flow
curve (Eq. 4-2) and its unloaded speed; a bias feeds the leak at rest.
"""

import numpy as np

from ..compiled import compiled
from ..laws.orifice import spool_for_opening
from ..ports import BODY, LEG
from ..pose import gauss_newton_step, leg_jacobian
from ..schemes import S, spool_windows

__all__ = ["ACTUATOR", "AXIS", "MEMORY_ROWS", "control_sample", "control_sample_flat", "control_step"]

AXIS = np.dtype(
    [
        ("displacement_gain", np.float64),  # Kx [1/s]
        ("velocity_feedforward", np.float64),  # Kvf [1]
        ("reset_gain", np.float64),  # Ki per sample [1/s]
        ("reset_limit", np.float64),  # [m/s, rad/s]
        ("force_gain", np.float64),  # KF [m/s/N, rad/s/(N m)]
        ("high_pass", np.float64),  # pole of the force high-pass per sample
    ]
)
"""Table row of a free axis."""

ACTUATOR = np.dtype(
    [
        ("extend", np.float64),  # unloaded speed at full opening [m/s]
        ("retract", np.float64),
        ("flow_curve", np.float64),  # lambda [1]
        ("bias", np.float64),  # spool at rest [1]
        ("force", np.float64),  # force at rest [N]
    ]
)
"""Table row of an actuator."""

MEMORY_ROWS = 4
_POSE, _RESET, _FORCE, _HIGH_PASSED = range(MEMORY_ROWS)
"""Rows of the memory: pose estimate, reset integral, force of the last sample, its high-passed value."""


@compiled
def control_step(sample, reference, displacement, force, legs, body, axes, axis, actuator, balance, memory, command):
    """Fill command (n_actuators,) of one sample; memory is the controller's state, changed in place.

    reference (n, 12): displacement and velocity of C and Euler angles per sample; displacement (n_ports,) the ports,
    actuators first [m]; force (n_actuators,) [N]. Commands beyond full stroke are clipped to -1..1. Returns how many.
    """
    n = command.size
    ports = displacement.size
    pose = memory[_POSE]
    s = np.empty(ports)
    J = np.empty((ports, 6))
    B = np.empty((ports, 6))
    K = np.empty((legs.size, 6))
    frame = np.empty((8, 3))
    leg_jacobian(pose, legs, body, s, J, B, frame, K)
    gauss_newton_step(displacement[:n], s, K, axes, pose)
    rate = np.zeros(n)
    for a in range(axes.size):
        k = axes[a]
        row = axis[a]
        total = 0.0
        for i in range(n):
            total += K[i, k] * (force[i] - actuator[i].force)
        passed = row.high_pass * (memory[_HIGH_PASSED, a] + total - memory[_FORCE, a])
        memory[_FORCE, a] = total
        memory[_HIGH_PASSED, a] = passed
        error = reference[sample, k] - pose[k]
        reset = memory[_RESET, a] + row.reset_gain * error
        reset = min(row.reset_limit, max(-row.reset_limit, reset))
        memory[_RESET, a] = reset
        speed = (
            row.velocity_feedforward * reference[sample, 6 + k]
            + row.displacement_gain * error
            + reset
            - row.force_gain * passed
        )
        for i in range(n):
            rate[i] += K[i, k] * speed
    clipped = 0
    for i in range(n):
        for j in range(n):
            rate[i] -= balance[i, j] * (force[j] - actuator[j].force)
        row = actuator[i]
        full = row.extend if rate[i] >= 0.0 else row.retract
        spool = spool_for_opening(rate[i] / full, row.flow_curve) + row.bias
        if abs(spool) > 1.0:
            clipped += 1
            spool = 1.0 if spool > 0.0 else -1.0
        command[i] = spool
    return clipped


@compiled
def control_sample(
    sample,
    reference,
    port,
    force,
    fed,
    legs,
    body,
    axes,
    axis,
    actuator,
    balance,
    memory,
    command,
    delays,
    rate,
    window,
):
    """One controller sample of a run: measure, command, and the delayed spools of its model steps.

    port and force are the plant's (see `schemes`, `stage`), fed (n_actuators,) the actuators' rows of force. Fills row
    `sample` of command (n, n_actuators) and window (n_steps, n_actuators). Returns how many commands were clipped.
    """
    measured = np.empty(fed.size)
    for i in range(fed.size):
        measured[i] = force[fed[i], 0]
    clipped = control_step(
        sample, reference, port[S], measured, legs, body, axes, axis, actuator, balance, memory, command[sample]
    )
    spool_windows(command, 0, sample, delays, rate, window)
    return clipped


@compiled
def control_sample_flat(
    sample,
    reference,
    port,
    force,
    fed,
    legs,
    body,
    axes,
    axis,
    actuator,
    balance,
    memory,
    command,
    delays,
    rate,
    window,
):
    """`control_sample` with its tables as plain numbers, which are cheaper to hand over from Python than records."""
    tables = legs.view(LEG), body.view(BODY), axes, axis.view(AXIS), actuator.view(ACTUATOR)
    return control_sample(sample, reference, port, force, fed, *tables, balance, memory, command, delays, rate, window)
