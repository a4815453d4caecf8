"""Between what a plant integrates and what a record holds, for whole records at once; and forward kinematics.

A plant's q holds the position of B and a quaternion, v the twist of B in platen axes, linear first. A record holds the
displacement of C in {s} and Euler angles alpha, beta, gamma with s_R_b = Rz(gamma) Ry(beta) Rx(alpha) (Eq. 3-5), and
their derivatives. Of a guided platen q and v are the displacements along its guides and their rates.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.cholesky import solve_positive
from ..core.compiled import compiled, compiled_inline
from ..core.errors import RecordError
from ..core.threads import fill_by_threads
from .plant import Plant
from .ports import evaluate_ports, platen_pose
from .spatial import (
    cross,
    from_body,
    matrix_to_rpy,
    rpy_acceleration,
    rpy_rate,
    rpy_to_matrix,
    rpy_to_quaternion,
    to_body,
    turning,
    turning_rate,
)

__all__ = [
    "PlantMotion",
    "PlatenMotion",
    "forward_kinematics",
    "kinematic_jacobian",
    "leg_displacements",
    "plant_motion",
    "platen_motion",
    "rotation",
]


class PlatenMotion(NamedTuple):
    """Motion of C in {s} with Euler angles and their derivatives, each (n, 6) [m, rad and per s, s2]."""

    displacement: Array
    velocity: Array
    acceleration: Array


class PlantMotion(NamedTuple):
    """Motion in a plant's coordinates: q (n, nq), v (n, nv), a (n, nv), platen joint only."""

    q: Array
    v: Array
    a: Array


def rotation(euler: Array) -> Array:
    """Rotation matrices s_R_b (n, 3, 3) of Euler angles (n, 3) alpha, beta, gamma [rad] (Eq. 3-5)."""
    out = np.zeros((len(euler), 3, 3))
    _rotations(np.ascontiguousarray(euler, float), out)
    return out


@compiled
def _rotations(euler, out):
    for k in range(len(out)):
        rpy_to_matrix(euler[k], out[k])


def platen_motion(plant: Plant, q: Array, v: Array, a: Array) -> PlatenMotion:
    """Motion of C and Euler angles, each (n, 6), from a plant's q (n, nq), v (n, nv), a (n, nv) (Eqs. 3-11, 3-18)."""
    motion = PlatenMotion(*np.zeros((3, len(q), 6)))
    moved = PlantMotion(*(np.ascontiguousarray(x, float) for x in (q, v, a)))

    def fill(rows: slice) -> None:
        some, out = PlantMotion(*(x[rows] for x in moved)), PlatenMotion(*(x[rows] for x in motion))
        _platen_motion(some, plant.axes, plant.body, out)

    fill_by_threads(fill, len(q))
    return motion


@compiled
def _platen_motion(moved, axes, body, motion):
    q, v, a = moved
    displacement, velocity, acceleration = motion
    frame = np.zeros((8, 3))
    for k in range(len(q)):
        if axes.size != 6:
            for j in range(axes.size):
                displacement[k, axes[j]], velocity[k, axes[j]] = q[k, j], v[k, j]
        else:
            rho, linear, omega = body[0].rho_c, v[k], v[k, 3:6]
            platen_pose(q[k], axes, body, frame)
            _set(frame[3], displacement[k])
            _add(from_body(frame, rho), displacement[k])
            _set(matrix_to_rpy(frame), displacement[k, 3:])
            tx, ty, tz = cross(omega, rho)
            _set(from_body(frame, (linear[0] + tx, linear[1] + ty, linear[2] + tz)), velocity[k])
            _set(rpy_rate(frame, omega), velocity[k, 3:])
        pose_acceleration(frame, body, axes, v[k], a[k], acceleration[k])


@compiled_inline
def _set(x, out):
    out[0], out[1], out[2] = x[0], x[1], x[2]


@compiled_inline
def _add(x, out):
    out[0] += x[0]
    out[1] += x[1]
    out[2] += x[2]


def plant_motion(plant: Plant, motion: PlatenMotion) -> PlantMotion:
    """Inverse of `platen_motion`: q, v, a of the platen joint from the motion of C and Euler angles."""
    if plant.axes.size != 6:
        return PlantMotion(*(m[:, plant.axes] for m in motion))
    n = len(motion.displacement)
    found = PlantMotion(np.zeros((n, 7)), np.zeros((n, 6)), np.zeros((n, 6)))
    _plant_motion(PlatenMotion(*(np.ascontiguousarray(x, float) for x in motion)), plant.body, found)
    return found


@compiled
def _plant_motion(motion, body, found):
    displacement, velocity, acceleration = motion
    q, v, a = found
    frame, rho = np.zeros((8, 3)), body[0].rho_c
    for k in range(len(q)):
        euler, rates = displacement[k, 3:], velocity[k, 3:]
        frame_of_pose(displacement[k], body, frame)
        _set(frame[3], q[k])
        q[k, 3], q[k, 4], q[k, 5], q[k, 6] = rpy_to_quaternion(euler)
        omega, alpha = turning(euler, rates), turning_rate(euler, rates, acceleration[k, 3:])
        of_c = to_body(frame, velocity[k])
        rise, bend = to_body(frame, acceleration[k]), cross(omega, of_c)
        tx, ty, tz = cross(omega, rho)
        ax, ay, az = cross(alpha, rho)
        _set((of_c[0] - tx, of_c[1] - ty, of_c[2] - tz), v[k])
        _set(omega, v[k, 3:])
        _set((rise[0] - bend[0] - ax, rise[1] - bend[1] - ay, rise[2] - bend[2] - az), a[k])
        _set(alpha, a[k, 3:])


@compiled
def frame_of_pose(pose, body, frame):
    """Rows 0 to 3 of frame from pose (6,): displacement of C and Euler angles (Eqs. 3-5, 3-12)."""
    rpy_to_matrix(pose[3:], frame)
    lever = from_body(frame, body[0].rho_c)
    frame[3, 0], frame[3, 1], frame[3, 2] = pose[0] - lever[0], pose[1] - lever[1], pose[2] - lever[2]


@compiled
def pose_jacobian(pose, body, frame, J, out):
    """Rates of legs per rate of pose, out (n_legs, 6) (Eq. 3-33), from their rows J per body twist (in frame)."""
    ca, sa, cb, sb = np.cos(pose[3]), np.sin(pose[3]), np.cos(pose[4]), np.sin(pose[4])
    rho = body[0].rho_c
    for i in range(out.shape[0]):
        _set(from_body(frame, J[i]), out[i])
        # a turn about B moves C: v_B = v_C - omega x rho, so the column of omega is moment - rho x force
        tx, ty, tz = cross(rho, J[i])
        mx, my, mz = J[i, 3] - tx, J[i, 4] - ty, J[i, 5] - tz
        out[i, 3] = mx
        out[i, 4] = ca * my - sa * mz
        out[i, 5] = -sb * mx + cb * sa * my + cb * ca * mz


@compiled
def leg_jacobian(pose, legs, body, s, J, B, frame, out):
    """Ports s at a pose and the legs' pose Jacobian out (n_legs, 6); J, B, frame are scratch."""
    frame_of_pose(pose, body, frame)
    evaluate_ports(frame, legs, body, s, J, B)
    pose_jacobian(pose, body, frame, J, out)


@compiled_inline
def pose_acceleration(frame, body, axes, v, a, out):
    """Acceleration of C in {s} and of the Euler angles, out (6,), of a platen with velocity v and acceleration a.

    v, a (nv,) as a plant integrates them, frame its pose. What accelerometers on the platen measure;
    `platen_motion` does the same for whole records (Eqs. 3-11, 3-18).
    """
    if axes.size != 6:
        out[:] = 0.0
        for k in range(axes.size):
            out[axes[k]] = a[k]
        return
    rho, omega, alpha = body[0].rho_c, v[3:6], a[3:6]
    tx, ty, tz = cross(omega, rho)
    bx, by, bz = cross(omega, (v[0] + tx, v[1] + ty, v[2] + tz))
    rx, ry, rz = cross(alpha, rho)
    _set(from_body(frame, (a[0] + rx + bx, a[1] + ry + by, a[2] + rz + bz)), out)
    _set(rpy_acceleration(frame, rpy_rate(frame, omega), alpha), out[3:])


@compiled
def gauss_newton_step(displacement, s, K, axes, pose):
    """Improve pose (6,) in place by one step towards legs of `displacement` (n,), from their s and K there (Eq. 3-34).

    Only the components in axes move. Returns the largest component of the step [m, rad].
    """
    free = axes.size
    normal = np.zeros((free, free))
    right = np.zeros(free)
    for i in range(displacement.size):
        miss = s[i] - displacement[i]
        for a in range(free):
            right[a] += K[i, axes[a]] * miss
            for b in range(a + 1):  # `solve_positive` reads the lower triangle
                normal[a, b] += K[i, axes[a]] * K[i, axes[b]]
    solve_positive(normal, right)
    largest = 0.0
    for a in range(free):
        pose[axes[a]] -= right[a]
        largest = max(largest, abs(right[a]))
    return largest


@compiled
def gauss_newton(displacement, pose, axes, legs, body, n_ports, steps, tolerance):
    """Improve pose (6,) in place until its legs fit displacement (n,) (Eqs. 3-29, 3-34); returns the residual norm [m].

    Stops after `steps`, or when a step is below `tolerance` [m, rad].
    """
    frame = np.zeros((8, 3))
    s = np.zeros(n_ports)
    J = np.zeros((n_ports, 6))
    B = np.zeros((n_ports, 6))
    K = np.zeros((legs.size, 6))
    for _ in range(steps):
        leg_jacobian(pose, legs, body, s, J, B, frame, K)
        if gauss_newton_step(displacement, s, K, axes, pose) < tolerance:
            break
    leg_jacobian(pose, legs, body, s, J, B, frame, K)
    norm = 0.0
    for i in range(displacement.size):
        norm += (s[i] - displacement[i]) ** 2
    return np.sqrt(norm)


@compiled
def _track(displacement, tables, n_ports, steps, tolerance, pose, residual):
    axes, legs, body = tables.axes, tables.legs, tables.body
    at = np.zeros(6)
    for k in range(displacement.shape[0]):
        residual[k] = gauss_newton(displacement[k], at, axes, legs, body, n_ports, steps, tolerance)
        if not np.isfinite(residual[k]):
            break
        pose[k] = at


def forward_kinematics(
    plant: Plant, displacement: Array, *, steps: int = 30, tolerance: float = 1e-14
) -> tuple[Array, Array]:
    """Platen displacement (n, 6) of C and Euler angles from actuator displacements (n, n_actuators) [m].

    Gauss-Newton on all actuators (Eqs. 3-29 to 3-34), each sample started from the one before, the first from the zero
    position. Returns also the residual norm (n,) [m]: what no pose explains, to be judged beside the sensors' noise.
    Raises RecordError naming the first sample that is not finite, or from which the iteration does not come back.
    """
    measured = np.ascontiguousarray(np.atleast_2d(displacement), float)
    if measured.shape[1] != plant.spools:
        raise RecordError(f"actuator_displacement has {measured.shape[1]} columns; this machine has {plant.spools}")
    bad = np.argwhere(~np.isfinite(measured))
    if bad.size:
        sample, column = bad[0]
        name = plant.machine.actuator_names[column]
        raise RecordError(f"actuator_displacement[{name}] at sample {sample} is not finite; mend or cut the record")
    pose, residual = np.zeros((len(measured), 6)), np.full(len(measured), np.nan)
    _track(measured, plant.tables, len(plant.ports), steps, tolerance, pose, residual)
    lost = np.flatnonzero(~np.isfinite(residual))
    if lost.size:
        raise RecordError(f"actuator_displacement at sample {lost[0]} fits no pose of the platen; check its channels")
    return pose, residual


@compiled
def _lengths(pose, legs, body, n_ports, out, rates, velocity):
    frame = np.zeros((8, 3))
    s = np.zeros(n_ports)
    J = np.zeros((n_ports, 6))
    B = np.zeros((n_ports, 6))
    K = np.zeros((legs.size, 6))
    for k in range(pose.shape[0]):
        leg_jacobian(pose[k], legs, body, s, J, B, frame, K)
        for i in range(legs.size):
            out[k, i] = s[i]
            total = 0.0
            for j in range(6):
                total += K[i, j] * velocity[k, j]
            rates[k, i] = total


def leg_displacements(plant: Plant, displacement: Array, velocity: Array | None = None) -> tuple[Array, Array]:
    """Elongations (n, n_legs) [m] and rates [m/s] of actuators, then struts, of a platen motion (n, 6) (Eq. 3-31)."""
    pose = np.ascontiguousarray(np.atleast_2d(displacement), float)
    speed = np.zeros_like(pose) if velocity is None else np.ascontiguousarray(np.atleast_2d(velocity), float)
    out, rates = np.zeros((len(pose), plant.legs.size)), np.zeros((len(pose), plant.legs.size))

    def fill(rows: slice) -> None:
        _lengths(pose[rows], plant.legs, plant.body, len(plant.ports), out[rows], rates[rows], speed[rows])

    fill_by_threads(fill, len(pose))
    return out, rates


def kinematic_jacobian(plant: Plant) -> Array:
    """Rates of the actuators' lengths per rate of the pose (n_actuators, 6) in the control zero-position (Eq. 3-33)."""
    _, columns = leg_displacements(plant, np.zeros((6, 6)), np.eye(6))
    return columns[:, : plant.spools].T
