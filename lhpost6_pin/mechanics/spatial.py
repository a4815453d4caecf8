"""Spatial algebra in compiled code, on scalars, with the names of Pinocchio's functions, which are its oracle.

Rotations are rows 0 to 2 of a frame (see `ports`), quaternions x, y, z, w; roll, pitch and yaw are the report's Euler
angles alpha, beta, gamma: s_R_b = Rz(yaw) Ry(pitch) Rx(roll) (Eq. 3-5). Angular velocities are in platen axes.
"""

import math

from ..core.compiled import compiled_inline

__all__ = ["act_force", "cross", "difference", "from_body", "integrate", "matrix_to_rpy", "quaternion_to_matrix"]
__all__ += ["rpy_acceleration", "rpy_rate", "rpy_to_matrix", "rpy_to_quaternion", "to_body", "turning", "turning_rate"]


@compiled_inline
def cross(a, b):
    """A x b of three numbers each."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled_inline
def from_body(frame, x):
    """Vector x of three numbers in platen axes, in {s}."""
    return (
        frame[0, 0] * x[0] + frame[0, 1] * x[1] + frame[0, 2] * x[2],
        frame[1, 0] * x[0] + frame[1, 1] * x[1] + frame[1, 2] * x[2],
        frame[2, 0] * x[0] + frame[2, 1] * x[1] + frame[2, 2] * x[2],
    )


@compiled_inline
def to_body(frame, x):
    """Vector x of three numbers in {s}, in platen axes."""
    return (
        frame[0, 0] * x[0] + frame[1, 0] * x[1] + frame[2, 0] * x[2],
        frame[0, 1] * x[0] + frame[1, 1] * x[1] + frame[2, 1] * x[2],
        frame[0, 2] * x[0] + frame[1, 2] * x[1] + frame[2, 2] * x[2],
    )


@compiled_inline
def act_force(frame, rho, force, moment):
    """Wrench at rho from B, in {s}: force and moment, of a wrench at B in platen axes (`pin.SE3.act`, Eq. 4-22)."""
    mx, my, mz = cross(rho, force)
    return from_body(frame, force), from_body(frame, (moment[0] - mx, moment[1] - my, moment[2] - mz))


@compiled_inline
def quaternion_to_matrix(x, y, z, w, frame):
    """Fill the rotation of a unit quaternion (`pin.Quaternion.toRotationMatrix`)."""
    frame[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    frame[0, 1] = 2.0 * (x * y - z * w)
    frame[0, 2] = 2.0 * (x * z + y * w)
    frame[1, 0] = 2.0 * (x * y + z * w)
    frame[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    frame[1, 2] = 2.0 * (y * z - x * w)
    frame[2, 0] = 2.0 * (x * z - y * w)
    frame[2, 1] = 2.0 * (y * z + x * w)
    frame[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@compiled_inline
def rpy_to_matrix(rpy, frame):
    """Fill the rotation of Euler angles (`pin.rpy.rpyToMatrix`, Eq. 3-5)."""
    ca, cb, cg = math.cos(rpy[0]), math.cos(rpy[1]), math.cos(rpy[2])
    sa, sb, sg = math.sin(rpy[0]), math.sin(rpy[1]), math.sin(rpy[2])
    frame[0, 0], frame[0, 1], frame[0, 2] = cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa
    frame[1, 0], frame[1, 1], frame[1, 2] = sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa
    frame[2, 0], frame[2, 1], frame[2, 2] = -sb, cb * sa, cb * ca


@compiled_inline
def matrix_to_rpy(frame):
    """Euler angles of a rotation, pitch below a quarter turn (`pin.rpy.matrixToRpy`)."""
    pitch = -math.asin(min(1.0, max(-1.0, frame[2, 0])))
    return math.atan2(frame[2, 1], frame[2, 2]), pitch, math.atan2(frame[1, 0], frame[0, 0])


@compiled_inline
def rpy_to_quaternion(rpy):
    """Unit quaternion x, y, z, w of Euler angles."""
    ca, cb, cg = math.cos(0.5 * rpy[0]), math.cos(0.5 * rpy[1]), math.cos(0.5 * rpy[2])
    sa, sb, sg = math.sin(0.5 * rpy[0]), math.sin(0.5 * rpy[1]), math.sin(0.5 * rpy[2])
    x, y = sa * cb * cg - ca * sb * sg, ca * sb * cg + sa * cb * sg
    return x, y, ca * cb * sg - sa * sb * cg, ca * cb * cg + sa * sb * sg


@compiled_inline
def turning(rpy, rate):
    """Angular velocity of Euler angle rates, b_J_E rate (`pin.rpy.computeRpyJacobian`, local; Eq. 3-11)."""
    ca, sa, cb, sb = math.cos(rpy[0]), math.sin(rpy[0]), math.cos(rpy[1]), math.sin(rpy[1])
    return rate[0] - sb * rate[2], ca * rate[1] + cb * sa * rate[2], cb * ca * rate[2] - sa * rate[1]


@compiled_inline
def turning_rate(rpy, rate, second):
    """Angular acceleration of Euler angles with these derivatives (`pin.rpy.computeRpyJacobianTimeDerivative`)."""
    ca, sa, cb, sb = math.cos(rpy[0]), math.sin(rpy[0]), math.cos(rpy[1]), math.sin(rpy[1])
    da, db, dg = rate[0], rate[1], rate[2]
    x, y, z = turning(rpy, second)
    x -= cb * db * dg
    y += (cb * ca * da - sb * sa * db) * dg - sa * da * db
    z -= (cb * sa * da + sb * ca * db) * dg + ca * da * db
    return x, y, z


@compiled_inline
def rpy_rate(frame, omega):
    """Euler angle rates of an angular velocity, the inverse of `turning`."""
    cb = math.sqrt(1.0 - frame[2, 0] * frame[2, 0])
    sa, ca = frame[2, 1] / cb, frame[2, 2] / cb
    dg = (sa * omega[1] + ca * omega[2]) / cb
    return omega[0] - frame[2, 0] * dg, ca * omega[1] - sa * omega[2], dg


@compiled_inline
def rpy_acceleration(frame, rate, alpha):
    """Second derivatives of Euler angles of an angular acceleration, the inverse of `turning_rate`."""
    sb = -frame[2, 0]
    cb = math.sqrt(1.0 - sb * sb)
    sa, ca = frame[2, 1] / cb, frame[2, 2] / cb
    da, db, dg = rate[0], rate[1], rate[2]
    x = alpha[0] + cb * db * dg
    y = alpha[1] + sa * da * db - (cb * ca * da - sb * sa * db) * dg
    z = alpha[2] + ca * da * db + (cb * sa * da + sb * ca * db) * dg
    return rpy_rate(frame, (x, y, z))


@compiled_inline
def integrate(q, dq, axes, out):
    """Pose after the body displacement dq: q exp(dq) on SE(3), quaternion kept unit (pin.integrate's oracle)."""
    if axes.size != 6:
        for k in range(axes.size):
            out[k] = q[k] + dq[k]
        return
    x, y, z, w = q[3], q[4], q[5], q[6]
    w0, w1, w2 = dq[3], dq[4], dq[5]
    v0, v1, v2 = dq[0], dq[1], dq[2]
    square = w0 * w0 + w1 * w1 + w2 * w2
    if square < 1e-4:  # series in the turn: the next terms are below 1e-16
        half = 0.5 * (1.0 - square / 24.0 * (1.0 - square / 80.0))
        cosine = 1.0 - square / 8.0 * (1.0 - square / 48.0)
        first = 0.5 - square / 24.0 * (1.0 - square / 30.0)
        second = 1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0)
    else:
        turn = math.sqrt(square)
        half = math.sin(0.5 * turn) / turn
        cosine = math.cos(0.5 * turn)
        first = (1.0 - math.cos(turn)) / square
        second = (turn - math.sin(turn)) / (square * turn)
    # translation in body axes: v + first (w x v) + second w x (w x v)
    c0, c1, c2 = w1 * v2 - w2 * v1, w2 * v0 - w0 * v2, w0 * v1 - w1 * v0
    t0 = v0 + first * c0 + second * (w1 * c2 - w2 * c1)
    t1 = v1 + first * c1 + second * (w2 * c0 - w0 * c2)
    t2 = v2 + first * c2 + second * (w0 * c1 - w1 * c0)
    # turned by the quaternion: t + 2 w (u x t) + 2 u x (u x t)
    u0, u1, u2 = y * t2 - z * t1, z * t0 - x * t2, x * t1 - y * t0
    out[0] = q[0] + t0 + 2.0 * (w * u0 + y * u2 - z * u1)
    out[1] = q[1] + t1 + 2.0 * (w * u1 + z * u0 - x * u2)
    out[2] = q[2] + t2 + 2.0 * (w * u2 + x * u1 - y * u0)
    e0, e1, e2 = half * w0, half * w1, half * w2
    n3 = w * e0 + x * cosine + y * e2 - z * e1
    n4 = w * e1 + y * cosine + z * e0 - x * e2
    n5 = w * e2 + z * cosine + x * e1 - y * e0
    n6 = w * cosine - x * e0 - y * e1 - z * e2
    # one Newton step to unit length is exact to rounding so close to it
    scale = 1.5 - 0.5 * (n3 * n3 + n4 * n4 + n5 * n5 + n6 * n6)
    out[3], out[4], out[5], out[6] = n3 * scale, n4 * scale, n5 * scale, n6 * scale


@compiled_inline
def difference(q, after, axes, out):
    """Body displacement dq that leads from pose q to pose `after`, the inverse of `integrate`.

    out (n_axes,) [m, rad]; for turns below half a revolution.
    """
    if axes.size != 6:
        for k in range(axes.size):
            out[k] = after[k] - q[k]
        return
    x, y, z, w = -q[3], -q[4], -q[5], q[6]
    a, b, c, d = after[3], after[4], after[5], after[6]
    # the turn between: conj(q) after
    e0 = w * a + x * d + y * c - z * b
    e1 = w * b - x * c + y * d + z * a
    e2 = w * c + x * b - y * a + z * d
    cosine = w * d - x * a - y * b - z * c
    if cosine < 0.0:  # the other quaternion of the same turn
        e0, e1, e2, cosine = -e0, -e1, -e2, -cosine
    sine = math.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    if sine < 1e-2:  # series in the sine of half the turn: the next terms are below 1e-15
        square = sine * sine
        scale = 2.0 * (1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (5.0 / 112.0))))
        turning = 4.0 * square * (1.0 + square / 3.0)
        third = 1.0 / 12.0 + turning * (1.0 / 720.0 + turning / 30240.0)
    else:
        turn = 2.0 * math.atan2(sine, cosine)
        scale = turn / sine
        third = (1.0 - 0.5 * turn * cosine / sine) / (turn * turn)
    w0, w1, w2 = scale * e0, scale * e1, scale * e2
    # the translation in body axes: conj(q) t
    t0, t1, t2 = after[0] - q[0], after[1] - q[1], after[2] - q[2]
    u0, u1, u2 = y * t2 - z * t1, z * t0 - x * t2, x * t1 - y * t0
    p0 = t0 + 2.0 * (w * u0 + y * u2 - z * u1)
    p1 = t1 + 2.0 * (w * u1 + z * u0 - x * u2)
    p2 = t2 + 2.0 * (w * u2 + x * u1 - y * u0)
    # v = p - (w x p) / 2 + third w x (w x p)
    c0, c1, c2 = w1 * p2 - w2 * p1, w2 * p0 - w0 * p2, w0 * p1 - w1 * p0
    out[0] = p0 - 0.5 * c0 + third * (w1 * c2 - w2 * c1)
    out[1] = p1 - 0.5 * c1 + third * (w2 * c0 - w0 * c2)
    out[2] = p2 - 0.5 * c2 + third * (w0 * c1 - w1 * c0)
    out[3], out[4], out[5] = w0, w1, w2
