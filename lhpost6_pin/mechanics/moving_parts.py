"""Moving parts of the legs as bodies, projected onto the platen: M = sum G' M_leg G, in closed form and compiled.

All in platen axes at B, V = (v, omega). A leg on swivels (`leg_bodies`) moves as its platen point P does: with u its
direction, a_P the acceleration of P and u' = (v_P - L' u)/L, it requires the force on the platen point

    f = m_r (u . a_P + c |u'|^2) u + J/L^2 a_P,across + L' (J'/L - 2 J/L^2) u',    J' = dJ/dL = 2 m_r (L - c)

c the distance of the rod's centre behind P. Its weight has the potential g s(L) u_z, s = m_b l_b/2 + m_r (L - c). The
rod of a bearing actuator has one coordinate, the leg's length, with the rate row J_L: m J_L' (J_L a + bias). What the
identified inertia of the platen has beyond an Inertia, `extra`, moves as a constant matrix in platen axes does: extra
dV/dt + V x* (extra V). All of it conserves energy. Pinocchio's CRBA and RNEA of the legs (`leg_model`) are the oracle.
"""

import math

from ..core.cholesky import solve_positive
from ..core.compiled import compiled, compiled_inline
from .spatial import cross, to_body

__all__ = ["add_moving_parts", "bodies_acceleration", "leg_energies"]


@compiled_inline
def _add_row(out, scale, row):
    """Add scale times the square of a row (6,) to a matrix (6, 6)."""
    for i in range(6):
        for j in range(6):
            out[i, j] += scale * row[i] * row[j]


@compiled_inline
def _add_wrench(out, rho, force):
    """Add the wrench at B of a force at rho."""
    moment = cross(rho, force)
    for i in range(3):
        out[i] += force[i]
        out[3 + i] += moment[i]


@compiled_inline
def _from_base(frame, leg):
    """B from the leg's base point, in platen axes [m]."""
    away = (frame[3, 0] - leg.base_point[0], frame[3, 1] - leg.base_point[1], frame[3, 2] - leg.base_point[2])
    return to_body(frame, away)


@compiled
def _add_bearing_rod(frame, leg, plane, g, row, M, bias, weight):
    """Add the rod of a bearing actuator."""
    e0, e1, e2 = frame[2, 0], frame[2, 1], frame[2, 2]
    v0, v1 = frame[4, 0], frame[4, 1]
    w0, w1, w2 = frame[5, 0], frame[5, 1], frame[5, 2]
    b0, b1, b2 = _from_base(frame, leg)
    rise = 1.0 / e2
    length = (b2 + plane) * rise
    row[0] = row[1] = row[5] = 0.0
    row[2], row[3], row[4] = rise, (length * e1 - b1) * rise, -(length * e0 - b0) * rise
    rate = row[2] * frame[4, 2] + row[3] * w0 + row[4] * w1
    # second derivative of L n_z = (B - A) . n + plane with dV/dt = 0; n'' in platen axes
    n0, n1, n2 = w2 * w0, w2 * w1, -(w0 * w0 + w1 * w1)
    turned = e0 * n0 + e1 * n1 + e2 * n2
    second = (w0 * v1 - w1 * v0) + 2.0 * (v0 * w1 - v1 * w0) + b0 * n0 + b1 * n1 + b2 * n2
    second = (second - 2.0 * rate * (e0 * w1 - e1 * w0) - length * turned) * rise
    _add_row(M, leg.rod_mass, row)
    for i in range(6):
        bias[i] += leg.rod_mass * second * row[i]
        weight[i] -= leg.rod_mass * g * row[i]


@compiled
def _add_swivel_leg(frame, leg, g, row, M, bias, weight):
    """Add rod and barrel of a leg on swivels or pins."""
    rho = leg.rho
    v, w = frame[4], frame[5]
    b0, b1, b2 = _from_base(frame, leg)
    d0, d1, d2 = b0 + rho[0], b1 + rho[1], b2 + rho[2]
    length = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    u0, u1, u2 = d0 / length, d1 / length, d2 / length
    turn = cross(w, rho)
    p0, p1, p2 = v[0] + turn[0], v[1] + turn[1], v[2] + turn[2]
    a0, a1, a2 = cross(w, (p0, p1, p2))  # of P with dV/dt = 0
    rate = u0 * p0 + u1 * p1 + u2 * p2
    t0, t1, t2 = (p0 - rate * u0) / length, (p1 - rate * u1) / length, (p2 - rate * u2) / length
    reach = length - leg.rod_centre
    inertia = leg.turning + leg.rod_mass * reach * reach
    across = inertia / (length * length)
    along = leg.rod_mass
    # M: a point of mass `across` at P, and what the mass along the leg has beyond it
    M[0, 0] += across
    M[1, 1] += across
    M[2, 2] += across
    x, y, z = across * rho[0], across * rho[1], across * rho[2]
    M[0, 4] += z
    M[4, 0] += z
    M[0, 5] -= y
    M[5, 0] -= y
    M[1, 3] -= z
    M[3, 1] -= z
    M[1, 5] += x
    M[5, 1] += x
    M[2, 3] += y
    M[3, 2] += y
    M[2, 4] -= x
    M[4, 2] -= x
    M[3, 3] += y * rho[1] + z * rho[2]
    M[4, 4] += x * rho[0] + z * rho[2]
    M[5, 5] += x * rho[0] + y * rho[1]
    M[3, 4] -= x * rho[1]
    M[4, 3] -= x * rho[1]
    M[3, 5] -= x * rho[2]
    M[5, 3] -= x * rho[2]
    M[4, 5] -= y * rho[2]
    M[5, 4] -= y * rho[2]
    row[0], row[1], row[2] = u0, u1, u2
    row[3], row[4], row[5] = cross(rho, (u0, u1, u2))
    _add_row(M, along - across, row)
    onward = u0 * a0 + u1 * a1 + u2 * a2
    push = along * (onward + leg.rod_centre * (t0 * t0 + t1 * t1 + t2 * t2)) - across * onward
    swing = 2.0 * rate * (along * reach / length - across)
    force = (
        push * u0 + across * a0 + swing * t0,
        push * u1 + across * a1 + swing * t1,
        push * u2 + across * a2 + swing * t2,
    )
    _add_wrench(bias, rho, force)
    e0, e1, e2 = frame[2, 0], frame[2, 1], frame[2, 2]
    upright = e0 * u0 + e1 * u1 + e2 * u2
    carried = (leg.first_moment + along * reach) / length
    heavy = (along - carried) * upright
    down = -g * carried, -g * heavy
    force = down[0] * e0 + down[1] * u0, down[0] * e1 + down[1] * u1, down[0] * e2 + down[1] * u2
    _add_wrench(weight, rho, force)


@compiled
def add_moving_parts(frame, legs, body, inertia, row, M, bias, weight):
    """Add mass matrix (6, 6), bias (6,) and weight (6,) of all moving parts, with the platen's `extra`; row is scratch.

    Pose and twist are those of frame. The wrench that the motion requires of the platen is M dV/dt + bias - weight.
    """
    g, extra, plane = inertia[0].gravity, inertia[0].extra, body[0].plane
    for i in range(legs.size):
        leg = legs[i]
        if leg.bearing == 1:
            _add_bearing_rod(frame, leg, plane, g, row, M, bias, weight)
        elif leg.rod_mass > 0.0 or leg.turning > 0.0:
            _add_swivel_leg(frame, leg, g, row, M, bias, weight)
    for i in range(6):
        row[i] = 0.0
        for j in range(3):
            row[i] += extra[i, j] * frame[4, j] + extra[i, 3 + j] * frame[5, j]
        for j in range(6):
            M[i, j] += extra[i, j]
    _add_momentum_bias(frame, row, bias)


@compiled_inline
def _add_momentum_bias(frame, momentum, bias):
    """Add V x* momentum."""
    v, w = frame[4], frame[5]
    bend, turning, drift = cross(w, momentum), cross(w, momentum[3:]), cross(v, momentum)
    for i in range(3):
        bias[i] += bend[i]
        bias[3 + i] += turning[i] + drift[i]


@compiled
def bodies_acceleration(tables, frame, tau, work, a):
    """Forward dynamics of platen and moving parts: fill a (n_axes,) from tau at the pose and twist in frame.

    (I - M_modes + M_parts) dV/dt = tau + weight - V x* (I V) - bias, I the platen's Inertia, on the free axes. work
    (9, 6) is scratch.
    """
    inertia, axes = tables.inertia, tables.axes
    plain, g = inertia[0].plain, inertia[0].gravity
    M, row, bias, weight = work[:6], work[6], work[7], work[8]
    for i in range(6):
        row[i] = bias[i] = weight[i] = 0.0
        for j in range(6):
            M[i, j] = plain[i, j] - inertia[0].modal[i, j]
        for j in range(3):
            row[i] += plain[i, j] * frame[4, j] + plain[i, 3 + j] * frame[5, j]
            weight[i] -= g * plain[i, j] * frame[2, j]
    _add_momentum_bias(frame, row, bias)
    add_moving_parts(frame, tables.legs, tables.body, inertia, row, M, bias, weight)
    n = axes.size
    for i in range(n):  # axes ascend: no entry is overwritten before it is read
        a[i] = tau[i] + weight[axes[i]] - bias[axes[i]]
        for j in range(n):
            M[i, j] = M[axes[i], axes[j]]
    solve_positive(M, a[:n])


@compiled
def leg_energies(frame, legs, body, inertia):
    """Kinetic energy of moving parts and of `extra`, and potential energy of moving parts in gravity [J]."""
    g, extra, plane = inertia[0].gravity, inertia[0].extra, body[0].plane
    v, w = frame[4], frame[5]
    kinetic = potential = 0.0
    for i in range(6):
        for j in range(6):
            kinetic += 0.5 * extra[i, j] * frame[4 + i // 3, i % 3] * frame[4 + j // 3, j % 3]
    for i in range(legs.size):
        leg = legs[i]
        b0, b1, b2 = _from_base(frame, leg)
        if leg.bearing == 1:
            rise = 1.0 / frame[2, 2]
            length = (b2 + plane) * rise
            rate = rise * (v[2] + (length * frame[2, 1] - b1) * w[0] - (length * frame[2, 0] - b0) * w[1])
            kinetic += 0.5 * leg.rod_mass * rate * rate
            potential += leg.rod_mass * g * (length + leg.base_point[2])
            continue
        d = (b0 + leg.rho[0], b1 + leg.rho[1], b2 + leg.rho[2])
        turn = cross(w, leg.rho)
        length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        rate = square = upright = 0.0
        for k in range(3):
            speed = v[k] + turn[k]
            rate += d[k] / length * speed
            square += speed * speed
            upright += d[k] / length * frame[2, k]
        reach = length - leg.rod_centre
        turning = leg.turning + leg.rod_mass * reach * reach
        kinetic += 0.5 * leg.rod_mass * rate * rate + 0.5 * turning * (square - rate * rate) / (length * length)
        potential += g * (leg.first_moment + leg.rod_mass * reach) * upright
    return kinetic, potential
