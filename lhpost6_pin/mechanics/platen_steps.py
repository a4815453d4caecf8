"""Steps of the platen's pose on SE(3): a pose moved by a body displacement, and the displacement between two poses."""

import math

from ..core.compiled import compiled_inline

__all__ = ["integrate_platen", "platen_difference"]


@compiled_inline
def integrate_platen(q, dq, axes, out):
    """Pose after the body displacement dq: q exp(dq) on SE(3), quaternion kept unit (pin.integrate's oracle)."""
    if axes.size != 6:
        out[0] = q[0] + dq[0]
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
def platen_difference(q, after, axes, out):
    """Body displacement dq that leads from pose q to pose `after`, the inverse of `integrate_platen`.

    out (6,), or (1,) of a guided platen [m, rad]; for turns below half a revolution.
    """
    if axes.size != 6:
        out[0] = after[0] - q[0]
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
