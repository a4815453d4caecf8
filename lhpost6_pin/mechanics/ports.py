"""Ports: where a force can act on the platen, with its coordinate, rate and force direction.

A port is a named coordinate s(q) [m or rad] with rate s' = J v [m/s or rad/s] and a force column B: a force f on the
port is a wrench B f on the platen. Usually B = J^T; two known exceptions do not conserve energy (see `Ports`).
v = (v_B, omega) is the platen's twist in its own axes at B, linear first (Pinocchio's free-flyer velocity).

Compiled code keeps the platen in one array, frame (8, 3): rows 0 to 2 the rotation s_R_b, 3 the position of B in {s},
4 and 5 the twist (v_B, omega) in platen axes, 6 and 7 the wrench (f, m) at B in platen axes.

One compiled function evaluates all ports of a pose. It is written in body axes, where a bearing's plane is constant;
`kinematics.py` writes the same rows as the report does, and tests hold the two together.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled, compiled_inline
from ..effects.modifiers import thrust_shares
from ..machine.machine import Machine
from ..machine.port_names import PLATEN_PORTS, SWIVEL_TURNS, place_of
from .leg_bodies import leg_bodies
from .spatial import from_body, matrix_to_rpy, quaternion_to_matrix, to_body

__all__ = [
    "BODY",
    "LEG",
    "PLACE",
    "body_table",
    "evaluate_ports",
    "leg_table",
    "place_ports",
    "place_table",
    "platen_pose",
]

LEG = np.dtype(
    [
        (
            "bearing",
            np.int64,
        ),  # 1: the leg stays vertical and the platen slides on it; 0: swivels at both ends
        ("pad", np.int64),  # number of the first of its two pad ports, -1 without
        ("rho", np.float64, 3),  # platen point from B, body axes, control zero-position [m]
        ("base_point", np.float64, 3),  # base point in {s} [m]
        ("zero_length", np.float64),  # length in the control zero-position [m]
        ("stroke", np.float64),  # largest |s| [m]: the hard stop
        (
            "normal_thrust",
            np.float64,
        ),  # bearing: 0 thrust along the vertical (Eq. 4-23), 1 along the normal (3-27)
        ("swivel", np.int64),  # number of the first of its five swivel ports, -1 without
        # its moving parts as bodies (`leg_bodies`), zero where they are lumped to the platen
        ("rod_mass", np.float64),  # [kg]
        ("rod_centre", np.float64),  # of the rod, behind the platen point [m]
        ("turning", np.float64),  # of the barrel about the base point, and of the rod about its centre [kg m2]
        ("first_moment", np.float64),  # of the barrel about the base point [kg m]
    ]
)
"""Table row of a leg: an actuator or a strut."""

BODY = np.dtype(
    [
        ("rho_c", np.float64, 3),  # C from B, body axes [m]
        ("plane", np.float64),  # height of the bearing plane above B, along the platen normal [m]
        ("mass_extra", np.float64, 3),  # directional mass beyond the Inertia's, dM [kg]
        ("weight_extra", np.float64),  # weight beyond the Inertia's, (m_z - m_0) g [N]
    ]
)
"""Table (one row) of the platen."""


PLACE = np.dtype(
    [
        ("rho", np.float64, 3),  # the place from B, body axes [m]
        ("along", np.float64, 3),  # unit vector in {s}
        ("zero", np.float64),  # its coordinate along it in the control zero-position [m]
    ]
)
"""Table row of a port at a place of the platen, along a direction fixed in space."""


def leg_table(machine: Machine) -> NDArray[np.void]:
    """Table of actuators, then struts, as `evaluate_ports` reads it; raises UnknownNameError for an effect's leg."""
    centre = np.array(machine.platen.centre_of_gravity)
    legs = np.zeros(len(machine.actuators) + len(machine.struts), LEG)
    pad = len(legs)
    bearings = sum(a.mount == "bearing" for a in machine.actuators)
    turn = pad + 2 * bearings + len(PLATEN_PORTS)
    for row, component in zip(legs, machine.components, strict=True):
        row["rho"] = np.array(component.platen_point) - centre
        row["base_point"] = component.base_point
        row["zero_length"] = math.dist(component.platen_point, component.base_point)
        row["stroke"] = getattr(component, "hard_stop", math.inf)
        row["pad"] = row["swivel"] = -1
        mount = getattr(component, "mount", "none")
        if mount == "bearing":
            row["bearing"], row["pad"] = 1, pad
            row["normal_thrust"] = float(machine.thrust == "normal")
            pad += 2
        elif mount == "swivel":
            row["swivel"] = turn
            turn += len(SWIVEL_TURNS)
    if machine.bodies == "full":
        for row, body in zip(legs, leg_bodies(machine), strict=True):
            row["rod_mass"], row["rod_centre"] = body.rod_mass, body.rod_centre
            row["turning"], row["first_moment"] = body.turning, body.first_moment
    turned = thrust_shares(machine.modifiers, [c.name for c in machine.components])
    legs["normal_thrust"] += np.multiply(-1.0 if machine.thrust == "normal" else 1.0, turned)
    return legs


def place_table(machine: Machine, ports: Sequence[str]) -> NDArray[np.void]:
    """Table of the ports at places of the platen among those named, in order."""
    found = [at for port in ports if (at := place_of(port)) is not None]
    places, centre = np.zeros(len(found), PLACE), np.array(machine.platen.centre_of_gravity)
    for row, (place, along) in zip(places, found, strict=True):
        row["rho"], row["along"], row["zero"] = np.array(place) - centre, along, np.dot(place, along)
    return places


def body_table(machine: Machine) -> NDArray[np.void]:
    """Table (one row) of the platen: C, bearing plane, and what an Inertia cannot hold (see `rigid_body`)."""
    platen = machine.platen
    body = np.zeros(1, BODY)
    body["rho_c"] = -np.array(platen.centre_of_gravity)
    body["plane"] = platen.bearing_plane[2] - platen.centre_of_gravity[2]
    if machine.bodies == "lumped":
        body["mass_extra"] = platen.directional_mass
        body["weight_extra"] = platen.directional_mass[2] * platen.gravity
    return body


@compiled_inline
def platen_pose(q, axes, body, frame):
    """Fill rows 0 to 3 of frame from q: the rotation s_R_b and the position of B in {s} [m].

    With six free axes q starts with the position of B and a unit quaternion (x, y, z, w); of a guided platen, which
    does not turn, q starts with the displacements [m] along axes.
    """
    if axes.size == 6:
        quaternion_to_matrix(q[3], q[4], q[5], q[6], frame)
        for k in range(3):
            frame[3, k] = q[k]
    else:
        for k in range(3):
            for j in range(3):
                frame[k, j] = 1.0 if k == j else 0.0
            frame[3, k] = -body[0].rho_c[k]
        for k in range(axes.size):
            frame[3, axes[k]] += q[k]


@compiled_inline
def _row(out, i, fx, fy, fz, rx, ry, rz):
    """Row of a unit force (fx, fy, fz) at r from B, body axes: (f, r x f)."""
    out[i, 0] = fx
    out[i, 1] = fy
    out[i, 2] = fz
    out[i, 3] = ry * fz - rz * fy
    out[i, 4] = rz * fx - rx * fz
    out[i, 5] = rx * fy - ry * fx


@compiled
def _swivel_ports(frame, legs, s, J, B):
    """Fill the swivel ports of all legs that have them: J = B^T.

    With u the leg's direction and v_P the platen point's velocity the rod turns at u x v_P / L in the base, and the
    platen at omega - u x v_P / L in the rod. Their components along two axes across the leg: e_1 level, e_2 = u x e_1;
    the platen's along u as well, about which the rod does not turn.
    The force column is the moment on the platen and, as the rod has no mass, its lateral force at the platen point.
    The axes turn with the leg, so that s of the base is its tilt and its turn about the vertical less a constant only
    while that tilt is small; s of the tip, which no angle belongs to, is zero.
    """
    for i in range(legs.size):
        leg = legs[i]
        k = leg.swivel
        if k < 0:
            continue
        px, py, pz = leg.rho[0], leg.rho[1], leg.rho[2]
        gx, gy, gz = from_body(frame, leg.rho)
        dx = frame[3, 0] + gx - leg.base_point[0]
        dy = frame[3, 1] + gy - leg.base_point[1]
        dz = frame[3, 2] + gz - leg.base_point[2]
        level = math.sqrt(dx * dx + dy * dy)
        length = math.sqrt(level * level + dz * dz)
        s[k] = -math.atan2(dz, level)
        s[k + 1] = math.atan2(dy, dx)
        s[k + 2] = s[k + 3] = s[k + 4] = 0.0
        e1x, e1y = (-dy / level, dx / level) if level > 1e-9 * length else (0.0, 1.0)
        e2x, e2y, e2z = -dz / length * e1y, dz / length * e1x, (dx * e1y - dy * e1x) / length
        for n in range(2):
            # e . (u x v) / L = (e x u) . v / L, and e_1 x u = -e_2, e_2 x u = e_1
            ex, ey, ez = (e1x, e1y, 0.0) if n == 0 else (e2x, e2y, e2z)
            fx, fy, fz = (-e2x, -e2y, -e2z) if n == 0 else (e1x, e1y, 0.0)
            fx, fy, fz = to_body(frame, (fx / length, fy / length, fz / length))
            _row(J, k + n, fx, fy, fz, px, py, pz)
            turn_x, turn_y, turn_z = to_body(frame, (ex, ey, ez))
            for j in range(6):
                J[k + 2 + n, j] = -J[k + n, j]
            J[k + 2 + n, 3] += turn_x
            J[k + 2 + n, 4] += turn_y
            J[k + 2 + n, 5] += turn_z
        J[k + 4, 0] = J[k + 4, 1] = J[k + 4, 2] = 0.0
        J[k + 4, 3], J[k + 4, 4], J[k + 4, 5] = to_body(frame, (dx / length, dy / length, dz / length))
        for n in range(k, k + 5):
            for j in range(6):
                B[n, j] = J[n, j]


@compiled
def place_ports(frame, places, s, J, B):
    """Fill the ports at places of the platen, the last ones of the arrays: J = B^T, s the displacement along each."""
    for i in range(places.size):
        place, k = places[i], s.size - places.size + i
        gx, gy, gz = from_body(frame, place.rho)
        nx, ny, nz = place.along[0], place.along[1], place.along[2]
        s[k] = nx * (frame[3, 0] + gx) + ny * (frame[3, 1] + gy) + nz * (frame[3, 2] + gz) - place.zero
        fx, fy, fz = to_body(frame, (nx, ny, nz))
        _row(J, k, fx, fy, fz, place.rho[0], place.rho[1], place.rho[2])
        for j in range(6):
            B[k, j] = J[k, j]


@compiled_inline
def evaluate_ports(frame, legs, body, s, J, B):
    """Fill s (n,), J (n, 6) and B (n, 6) of all ports at the pose in rows 0 to 3 of frame.

    Swivel leg (Eqs. 3-20 to 3-22): s the elongation, J its rate. Bearing leg (Eqs. 3-24, 3-27): the same with the
    leg vertical and the platen sliding over it; B is the thrust direction, vertical (Eq. 4-23) or normal. Pads: slip
    of the platen over the plate in the axes of {n_i} (Eqs. 4-13 to 4-15); J is slip relative to the rising plate, B
    the force on the platen alone (Eq. 4-24); s is the displacement of the platen point of the zero-position.
    Platen ports, where the arrays have room for them: J = B^T, displacement of C, Euler angles (whose rates are not
    omega), wrench at C in {c}. Swivel ports, where there is room for them too: see `_swivel_ports`.
    """
    r00, r01, r02 = frame[0, 0], frame[0, 1], frame[0, 2]
    r10, r11, r12 = frame[1, 0], frame[1, 1], frame[1, 2]
    r20, r21, r22 = frame[2, 0], frame[2, 1], frame[2, 2]
    bx, by, bz = frame[3, 0], frame[3, 1], frame[3, 2]
    plane = body[0].plane
    # {n}: same for all pads, z along the platen normal (r02, r12, r22), no rotation about it (Eq. 4-13)
    cos_a = math.sqrt(1.0 - r12 * r12)
    scale = 1.0 / cos_a
    sin_b = r02 * scale
    cos_b = r22 * scale
    rise = 1.0 / r22  # of the leg per displacement along the normal
    # its x and y axes in {s}, then in body axes (their body z components vanish)
    yx, yy, yz = -sin_b * r12, cos_a, -cos_b * r12
    xbx = r00 * cos_b - r20 * sin_b
    xby = r01 * cos_b - r21 * sin_b
    ybx = r00 * yx + r10 * yy + r20 * yz
    yby = r01 * yx + r11 * yy + r21 * yz
    pads = 0
    for i in range(legs.size):
        leg = legs[i]
        px, py, pz = leg.rho[0], leg.rho[1], leg.rho[2]
        ax, ay, az = leg.base_point[0], leg.base_point[1], leg.base_point[2]
        if leg.bearing == 0:
            dx = bx + r00 * px + r01 * py + r02 * pz - ax
            dy = by + r10 * px + r11 * py + r12 * pz - ay
            dz = bz + r20 * px + r21 * py + r22 * pz - az
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            s[i] = length - leg.zero_length
            scale = 1.0 / length
            dx *= scale
            dy *= scale
            dz *= scale
            _row(
                J,
                i,
                r00 * dx + r10 * dy + r20 * dz,
                r01 * dx + r11 * dy + r21 * dz,
                r02 * dx + r12 * dy + r22 * dz,
                px,
                py,
                pz,
            )
            for k in range(6):
                B[i, k] = J[i, k]
            continue
        pads += 1
        # bearing: the vertical through A meets the plane through N with normal n
        ex, ey, ez = bx - ax, by - ay, bz - az
        length = (ex * r02 + ey * r12 + ez * r22 + plane) * rise
        s[i] = length - leg.zero_length
        # P from B, in body axes; its body z is the plane's height
        hx, hy, hz = -ex, -ey, length - ez
        cx = r00 * hx + r10 * hy + r20 * hz
        cy = r01 * hx + r11 * hy + r21 * hz
        J[i, 0], J[i, 1], J[i, 2] = 0.0, 0.0, rise
        J[i, 3], J[i, 4], J[i, 5] = cy * rise, -cx * rise, 0.0
        share = leg.normal_thrust
        tx, ty, tz = (1.0 - share) * r20, (1.0 - share) * r21, (1.0 - share) * r22 + share * rise
        _row(B, i, tx, ty, tz, cx, cy, plane)
        k = leg.pad
        turn_x = cx * xby - cy * xbx
        turn_y = cx * yby - cy * ybx
        B[k, 0], B[k, 1], B[k, 2] = xbx, xby, 0.0
        B[k, 3], B[k, 4], B[k, 5] = -plane * xby, plane * xbx, turn_x
        B[k + 1, 0], B[k + 1, 1], B[k + 1, 2] = ybx, yby, 0.0
        B[k + 1, 3], B[k + 1, 4], B[k + 1, 5] = -plane * yby, plane * ybx, turn_y
        # slip relative to the plate, which rises with the leg: less its share of the rise along {n}'s x and y
        lift_x, lift_y = sin_b * rise, -yz * rise
        J[k, 0], J[k, 1], J[k, 2] = xbx, xby, lift_x
        J[k, 3], J[k, 4], J[k, 5] = lift_x * cy - plane * xby, plane * xbx - lift_x * cx, turn_x
        J[k + 1, 0], J[k + 1, 1], J[k + 1, 2] = ybx, yby, lift_y
        J[k + 1, 3], J[k + 1, 4], J[k + 1, 5] = lift_y * cy - plane * yby, plane * ybx - lift_y * cx, turn_y
        gx, gy = px - cx, py - cy
        s[k] = xbx * gx + xby * gy
        s[k + 1] = ybx * gx + yby * gy
    first = legs.size + 2 * pads
    if s.size == first:
        return
    rho = body[0].rho_c
    ox, oy, oz = rho[0], rho[1], rho[2]
    for k in range(3):
        fx, fy, fz = frame[k, 0], frame[k, 1], frame[k, 2]
        _row(B, first + k, fx, fy, fz, ox, oy, oz)
        s[first + k] = frame[3, k] + fx * ox + fy * oy + fz * oz
        for j in range(3):
            B[first + 3 + k, j] = 0.0
        B[first + 3 + k, 3] = fx
        B[first + 3 + k, 4] = fy
        B[first + 3 + k, 5] = fz
    for k in range(first, first + 6):
        for j in range(6):
            J[k, j] = B[k, j]
    s[first + 3], s[first + 4], s[first + 5] = matrix_to_rpy(frame)
    if s.size > first + 6:  # with room for those at places, too, if there are any
        _swivel_ports(frame, legs, s, J, B)
