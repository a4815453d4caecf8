"""Motion of the legs' joints that follows from the platen's, and the projection of their dynamics, compiled.

The joints are those of `leg_model`: of a leg on swivels turn and tilt from its direction in the zero-position, and its
length; of a bearing actuator its length. Their velocities are G V, their accelerations G dV/dt + G' V.
"""

import math

import numpy as np

from ..core.cholesky import solve_positive
from ..core.compiled import compiled, compiled_source, copy_scaled
from .ports import platen_pose
from .schemes import set_twist
from .spatial import cross, from_body, to_body
from .tables import unpack_tables

__all__ = ["follow_platen", "leg_joints", "solve_projected"]


@compiled
def _set_row(G, n, frame, rho, scale, axis, e):
    """Row n of G: scale times the velocity of the point at rho along e, a direction in the leg's axes."""
    ex = axis[0, 0] * e[0] + axis[0, 1] * e[1] + axis[0, 2] * e[2]
    ey = axis[1, 0] * e[0] + axis[1, 1] * e[1] + axis[1, 2] * e[2]
    ez = axis[2, 0] * e[0] + axis[2, 1] * e[1] + axis[2, 2] * e[2]
    x, y, z = to_body(frame, (ex, ey, ez))
    G[n, 0], G[n, 1], G[n, 2] = scale * x, scale * y, scale * z
    G[n, 3], G[n, 4], G[n, 5] = cross(rho, (scale * x, scale * y, scale * z))


@compiled_source
def leg_joints(buffer):
    """Positions, velocities and bias accelerations (n,), and the Jacobian (n, 6), of a buffer of 9 n numbers."""
    n = buffer.size // 9
    return buffer[:n], buffer[n : 2 * n], buffer[2 * n : 3 * n], buffer[3 * n :].reshape((n, 6))


@compiled
def follow_platen(q, v, packed, zero, buffer):
    """Fill the legs' joints in buffer (`leg_joints`) from pose and twist; packed is `Tables.packed`."""
    tables = unpack_tables(packed)
    legs, body = tables.legs, tables.body
    x, rate, bias, G = leg_joints(buffer)
    frame = np.zeros((8, 3))
    platen_pose(q, tables.axes, body, frame)
    set_twist(v, tables.axes, frame)
    twist = np.empty(6)
    copy_scaled(1.0, frame[4], twist[:3])
    copy_scaled(1.0, frame[5], twist[3:])
    n = 0
    for i in range(legs.size):
        leg = legs[i]
        if leg.bearing == 1:
            _follow_bearing(frame, leg, body[0].plane, n, x, G, bias)
            n += 1
            continue
        axis = zero[i]
        gx, gy, gz = from_body(frame, leg.rho)
        ax = frame[3, 0] + gx - leg.base_point[0]
        ay = frame[3, 1] + gy - leg.base_point[1]
        az = frame[3, 2] + gz - leg.base_point[2]
        d0 = axis[0, 0] * ax + axis[1, 0] * ay + axis[2, 0] * az
        d1 = axis[0, 1] * ax + axis[1, 1] * ay + axis[2, 1] * az
        d2 = axis[0, 2] * ax + axis[1, 2] * ay + axis[2, 2] * az
        length = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        turn, tilt = math.atan2(d1, d0), -math.asin(d2 / length)
        ca, sa, cb, sb = math.cos(turn), math.sin(turn), math.cos(tilt), math.sin(tilt)
        x[n], x[n + 1], x[n + 2] = turn, tilt, length
        # directions in which turn, tilt and length move the platen point, and what they divide by
        _set_row(G, n, frame, leg.rho, 1.0 / (length * cb), axis, (-sa, ca, 0.0))
        _set_row(G, n + 1, frame, leg.rho, 1.0 / length, axis, (-sb * ca, -sb * sa, -cb))
        _set_row(G, n + 2, frame, leg.rho, 1.0, axis, (cb * ca, cb * sa, -sb))
        a, b, c = 0.0, 0.0, 0.0
        for j in range(6):
            a += G[n, j] * twist[j]
            b += G[n + 1, j] * twist[j]
            c += G[n + 2, j] * twist[j]
        spin = cross(frame[5], leg.rho)
        onward = cross(frame[5], (frame[4, 0] + spin[0], frame[4, 1] + spin[1], frame[4, 2] + spin[2]))
        for k in range(3):  # acceleration of the platen point with dV/dt = 0, along the three directions
            bias[n + k] = G[n + k, 0] * onward[0] + G[n + k, 1] * onward[1] + G[n + k, 2] * onward[2]
        bias[n] += 2.0 * a * b * sb / cb - 2.0 * c * a / length
        bias[n + 1] -= 2.0 * c * b / length + a * a * sb * cb
        bias[n + 2] += length * (b * b + a * a * cb * cb)
        n += 3
    for k in range(n):
        rate[k] = 0.0
        for j in range(6):
            rate[k] += G[k, j] * twist[j]


@compiled
def _follow_bearing(frame, leg, plane, n, x, G, bias):
    """Position, Jacobian row and bias acceleration of a bearing actuator's length."""
    e, v, w = frame[2], frame[4], frame[5]
    away = (frame[3, 0] - leg.base_point[0], frame[3, 1] - leg.base_point[1], frame[3, 2] - leg.base_point[2])
    b = to_body(frame, away)
    length = (b[2] + plane) / e[2]
    x[n] = length
    G[n, 0] = G[n, 1] = G[n, 5] = 0.0
    G[n, 2], G[n, 3], G[n, 4] = 1.0 / e[2], (length * e[1] - b[1]) / e[2], (b[0] - length * e[0]) / e[2]
    rate = G[n, 2] * v[2] + G[n, 3] * w[0] + G[n, 4] * w[1]
    # L n_z = (B - A) . n + plane, differentiated twice; n' = w x z, n'' = w x (w x z) in platen axes
    first = (w[1], -w[0], 0.0)
    second = cross(w, first)
    curve = cross(w, v)[2] + 2.0 * (v[0] * first[0] + v[1] * first[1])
    curve += b[0] * second[0] + b[1] * second[1] + b[2] * second[2]
    curve -= 2.0 * rate * (e[0] * first[0] + e[1] * first[1])
    curve -= length * (e[0] * second[0] + e[1] * second[1] + e[2] * second[2])
    bias[n] = curve / e[2]


@compiled
def solve_projected(M, h, legs, force, buffer, packed, q, v, tau):
    """Acceleration (nv,) of platen and specimen joints; M, the model's own mass matrix, is overwritten.

    h (nv,) are the model's own bias and weight, legs (n, n) and force (n,) of the legs' joints in buffer.
    """
    tables = unpack_tables(packed)
    axes, extra, n = tables.axes, tables.inertia[0].extra, tau.size
    _, _, _, G = leg_joints(buffer)
    a, frame = np.empty(n), np.zeros((8, 3))
    platen_pose(q, axes, tables.body, frame)
    set_twist(v, axes, frame)
    moved, momentum, total = np.zeros((G.shape[0], 6)), np.zeros(6), np.zeros(6)
    for i in range(G.shape[0]):
        for j in range(G.shape[0]):
            mass = legs[min(i, j), max(i, j)]  # the upper triangle
            if mass != 0.0:
                for k in range(6):
                    moved[i, k] += mass * G[j, k]
        for k in range(6):
            total[k] += G[i, k] * force[i]
    for i in range(6):
        for j in range(3):
            momentum[i] += extra[i, j] * frame[4, j] + extra[i, 3 + j] * frame[5, j]
    bend, drift = cross(frame[5], momentum), cross(frame[4], momentum)
    turning = cross(frame[5], momentum[3:])
    for i in range(3):
        total[i] += bend[i]
        total[3 + i] += turning[i] + drift[i]
    for i in range(n):
        a[i] = tau[i] - h[i]
        for j in range(i):
            M[i, j] = M[j, i]
    for i in range(axes.size):
        a[i] -= total[axes[i]]
        for j in range(axes.size):
            more = extra[axes[i], axes[j]]
            for k in range(G.shape[0]):
                more += G[k, axes[i]] * moved[k, axes[j]]
            M[i, j] += more
    solve_positive(M, a[:n])
    return a
