"""Between what a plant integrates and what a record holds, for whole records at once; and forward kinematics.

A plant's q holds the position of B and a quaternion, v the twist of B in platen axes, linear first. A record holds the
displacement of C in {s} and Euler angles alpha, beta, gamma with s_R_b = Rz(gamma) Ry(beta) Rx(alpha) (Eq. 3-5), and
their derivatives. A guided platen has one displacement.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled, compiled_inline
from ..core.errors import RecordError
from .plant import Plant
from .ports import evaluate_ports

__all__ = [
    "PlantMotion",
    "PlatenMotion",
    "forward_kinematics",
    "leg_displacements",
    "plant_motion",
    "platen_motion",
    "rotation",
]

Array = NDArray[np.float64]


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
    """Rotation matrices s_R_b (..., 3, 3) of Euler angles (..., 3) alpha, beta, gamma [rad] (Eq. 3-5)."""
    euler = np.asarray(euler, float)
    ca, cb, cg = np.moveaxis(np.cos(euler), -1, 0)
    sa, sb, sg = np.moveaxis(np.sin(euler), -1, 0)
    out = np.empty((*euler.shape[:-1], 3, 3))
    out[..., 0, 0], out[..., 0, 1], out[..., 0, 2] = cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa
    out[..., 1, 0], out[..., 1, 1], out[..., 1, 2] = sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa
    out[..., 2, 0], out[..., 2, 1], out[..., 2, 2] = -sb, cb * sa, cb * ca
    return out


def _euler_map(euler: Array) -> Array:
    """Matrix b_J_E (..., 3, 3) from Euler angle rates to the angular velocity in platen axes (Eq. 3-11)."""
    out = np.zeros((*euler.shape[:-1], 3, 3))
    ca, sa = np.cos(euler[..., 0]), np.sin(euler[..., 0])
    cb, sb = np.cos(euler[..., 1]), np.sin(euler[..., 1])
    out[..., 0, 0], out[..., 0, 2] = 1.0, -sb
    out[..., 1, 1], out[..., 1, 2] = ca, cb * sa
    out[..., 2, 1], out[..., 2, 2] = -sa, cb * ca
    return out


def _euler_map_rate(euler: Array, rates: Array) -> Array:
    """Time derivative of `_euler_map`."""
    out = np.zeros((*euler.shape[:-1], 3, 3))
    ca, sa = np.cos(euler[..., 0]), np.sin(euler[..., 0])
    cb, sb = np.cos(euler[..., 1]), np.sin(euler[..., 1])
    da, db = rates[..., 0], rates[..., 1]
    out[..., 0, 2] = -cb * db
    out[..., 1, 1], out[..., 1, 2] = -sa * da, cb * ca * da - sb * sa * db
    out[..., 2, 1], out[..., 2, 2] = -ca * da, -cb * sa * da - sb * ca * db
    return out


def _turn(matrix: Array, vector: Array) -> Array:
    return np.einsum("...ij,...j->...i", matrix, vector)


def platen_motion(plant: Plant, q: Array, v: Array, a: Array) -> PlatenMotion:
    """Motion of C and Euler angles, each (n, 6), from a plant's q (n, nq), v (n, nv), a (n, nv) (Eqs. 3-11, 3-18)."""
    n = len(q)
    if plant.axes.size != 6:
        motion = [np.zeros((n, 6)) for _ in range(3)]
        for out, column in zip(motion, (q, v, a), strict=True):
            out[:, plant.axes[0]] = column[:, 0]
        return PlatenMotion(*motion)
    x, y, z, w = q[:, 3:7].T
    r = np.empty((n, 3, 3))
    r[:, 0, 0], r[:, 0, 1], r[:, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    r[:, 1, 0], r[:, 1, 1], r[:, 1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    r[:, 2, 0], r[:, 2, 1], r[:, 2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    euler = np.stack(
        [
            np.arctan2(r[:, 2, 1], r[:, 2, 2]),
            -np.arcsin(np.clip(r[:, 2, 0], -1, 1)),
            np.arctan2(r[:, 1, 0], r[:, 0, 0]),
        ],
        axis=1,
    )
    rho = plant.body[0]["rho_c"]
    linear, omega = v[:, :3], v[:, 3:6]
    euler_map = _euler_map(euler)
    rates = np.asarray(np.linalg.solve(euler_map, omega[..., None])[..., 0], np.float64)
    turning = a[:, 3:6] - _turn(_euler_map_rate(euler, rates), rates)
    seconds = np.linalg.solve(euler_map, turning[..., None])[..., 0]
    velocity_c = linear + np.cross(omega, rho)
    acceleration_c = a[:, :3] + np.cross(a[:, 3:6], rho) + np.cross(omega, velocity_c)
    return PlatenMotion(
        np.hstack([q[:, :3] + r @ rho, euler]),
        np.hstack([_turn(r, velocity_c), rates]),
        np.hstack([_turn(r, acceleration_c), seconds]),
    )


def plant_motion(plant: Plant, motion: PlatenMotion) -> PlantMotion:
    """Inverse of `platen_motion`: q, v, a of the platen joint from the motion of C and Euler angles."""
    if plant.axes.size != 6:
        return PlantMotion(*(m[:, plant.axes] for m in motion))
    euler, rates, seconds = (m[:, 3:] for m in motion)
    r = rotation(euler)
    rho = plant.body[0]["rho_c"]
    euler_map = _euler_map(euler)
    omega = _turn(euler_map, rates)
    alpha = _turn(euler_map, seconds) + _turn(_euler_map_rate(euler, rates), rates)
    back = np.swapaxes(r, 1, 2)
    velocity_c = _turn(back, motion.velocity[:, :3])
    linear = velocity_c - np.cross(omega, rho)
    rise = _turn(back, motion.acceleration[:, :3]) - np.cross(omega, velocity_c) - np.cross(alpha, rho)
    return PlantMotion(
        np.hstack([motion.displacement[:, :3] - r @ rho, _quaternion(euler)]),
        np.hstack([linear, omega]),
        np.hstack([rise, alpha]),
    )


def _quaternion(euler: Array) -> Array:
    """Unit quaternions (n, 4) as x, y, z, w of Euler angles (n, 3)."""
    ca, cb, cg = np.cos(0.5 * euler).T
    sa, sb, sg = np.sin(0.5 * euler).T
    return np.stack(
        [
            sa * cb * cg - ca * sb * sg,
            ca * sb * cg + sa * cb * sg,
            ca * cb * sg - sa * sb * cg,
            ca * cb * cg + sa * sb * sg,
        ],
        axis=1,
    )


@compiled
def frame_of_pose(pose, body, frame):
    """Rows 0 to 3 of frame from pose (6,): displacement of C and Euler angles (Eqs. 3-5, 3-12)."""
    ca, cb, cg = np.cos(pose[3]), np.cos(pose[4]), np.cos(pose[5])
    sa, sb, sg = np.sin(pose[3]), np.sin(pose[4]), np.sin(pose[5])
    frame[0, 0], frame[0, 1], frame[0, 2] = cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa
    frame[1, 0], frame[1, 1], frame[1, 2] = sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa
    frame[2, 0], frame[2, 1], frame[2, 2] = -sb, cb * sa, cb * ca
    for k in range(3):
        lever = 0.0
        for j in range(3):
            lever += frame[k, j] * body[0].rho_c[j]
        frame[3, k] = pose[k] - lever


@compiled
def pose_jacobian(pose, body, frame, J, out):
    """Rates of legs per rate of pose, out (n_legs, 6) (Eq. 3-33), from their rows J per body twist (in frame)."""
    ca, sa, cb, sb = np.cos(pose[3]), np.sin(pose[3]), np.cos(pose[4]), np.sin(pose[4])
    rho = body[0].rho_c
    for i in range(out.shape[0]):
        for k in range(3):
            out[i, k] = J[i, 0] * frame[k, 0] + J[i, 1] * frame[k, 1] + J[i, 2] * frame[k, 2]
        # a turn about B moves C: v_B = v_C - omega x rho, so omega sees moment - rho x force
        mx = J[i, 3] - (rho[1] * J[i, 2] - rho[2] * J[i, 1])
        my = J[i, 4] - (rho[2] * J[i, 0] - rho[0] * J[i, 2])
        mz = J[i, 5] - (rho[0] * J[i, 1] - rho[1] * J[i, 0])
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

    v, a (nv,) as a plant integrates them, frame its pose. What accelerometers on the platen tell its controller;
    `platen_motion` does the same for whole records (Eqs. 3-11, 3-18).
    """
    if axes.size != 6:
        out[:] = 0.0
        out[axes[0]] = a[0]
        return
    rho = body[0].rho_c
    wx, wy, wz = v[3], v[4], v[5]
    cx = v[0] + wy * rho[2] - wz * rho[1]
    cy = v[1] + wz * rho[0] - wx * rho[2]
    cz = v[2] + wx * rho[1] - wy * rho[0]
    ax = a[0] + a[4] * rho[2] - a[5] * rho[1] + wy * cz - wz * cy
    ay = a[1] + a[5] * rho[0] - a[3] * rho[2] + wz * cx - wx * cz
    az = a[2] + a[3] * rho[1] - a[4] * rho[0] + wx * cy - wy * cx
    for k in range(3):
        out[k] = frame[k, 0] * ax + frame[k, 1] * ay + frame[k, 2] * az
    sb = -frame[2, 0]
    cb = np.sqrt(1.0 - sb * sb)
    sa, ca = frame[2, 1] / cb, frame[2, 2] / cb
    dg = (sa * wy + ca * wz) / cb
    db = ca * wy - sa * wz
    da = wx + sb * dg
    # alpha - (d b_J_E/dt) rates, then b_J_E solved for the second derivatives
    tx = a[3] + cb * db * dg
    ty = a[4] + sa * da * db - (cb * ca * da - sb * sa * db) * dg
    tz = a[5] + ca * da * db + (cb * sa * da + sb * ca * db) * dg
    out[5] = (sa * ty + ca * tz) / cb
    out[4] = ca * ty - sa * tz
    out[3] = tx + sb * out[5]


@compiled
def _solve(matrix, right):
    """Solution of a small positive definite system by Cholesky; not finite where it is singular."""
    n = right.size
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(total) if i == j else total / matrix[j, j]
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    return right


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
            for b in range(free):
                normal[a, b] += K[i, axes[a]] * K[i, axes[b]]
    step = _solve(normal, right)
    largest = 0.0
    for a in range(free):
        pose[axes[a]] -= step[a]
        largest = max(largest, abs(step[a]))
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
def _track(displacement, axes, legs, body, n_ports, steps, tolerance, pose, residual):
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
    _track(measured, plant.axes, plant.legs, plant.body, len(plant.ports), steps, tolerance, pose, residual)
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
    _lengths(pose, plant.legs, plant.body, len(plant.ports), out, rates, speed)
    return out, rates
