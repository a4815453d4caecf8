"""The right-hand side of the whole table: dy/dt of pose, twist, pressures, friction and all hidden states."""

import math

from numba import njit

from .hidden import (
    compliance,
    creep_rate,
    leakage,
    leg_force,
    memory_rate,
    pad_plateau,
    seal_plateau,
    soft_gap,
)
from .table import bristle, leg_line, rotation, turned, valve

__all__ = ["SHOWN", "STATES", "rates"]

# Where each state starts in y. Pose of C (position, Euler angles), twist of B on body axes (linear, angular) ...
POSE, TWIST, PA, PB, SEAL, PAD = 0, 6, 12, 22, 26, 39
SPOOL, SPOOL_RATE, GAS, SUPPLY, RETURN = 51, 61, 71, 74, 75
LINE_P, LINE_Q, PISTON, PISTON_RATE = 76, 86, 96, 100
SWAY, HEAT, PAST, CREEP, CREEPERS = 104, 116, 129, 142, 4  # two sprung masses; per leg: heat, memory, creep elements
PAD_HEAT = CREEP + 13 * CREEPERS  # of each bearing
STATES = PAD_HEAT + 6
# What `rates` also shows: extension as measured (13), hydraulic or gas pull (13), gas (3) and supply pressure (1).
X, PULL, GAS_PRESSURE, SUPPLY_PRESSURE, SHOWN = 0, 13, 26, 29, 30
RETURN_TIME = 0.005  # s, a return line this short follows the flow through it


@njit(cache=True)
def sprung_mass(y, dy, at, mass, frequency, damping, vx, vy, vz):
    """Force of a sprung mass on its foot, which moves at (vx, vy, vz); states stretch (3) and own velocity (3) [N]."""
    omega = 2.0 * math.pi * frequency
    stiffness, dashpot = mass * omega * omega, 2.0 * damping * mass * omega
    fx = stiffness * y[at] + dashpot * (y[at + 3] - vx)
    fy = stiffness * y[at + 1] + dashpot * (y[at + 4] - vy)
    fz = 9.0 * stiffness * y[at + 2] + 3.0 * dashpot * (y[at + 5] - vz)  # three times the frequency along Z
    dy[at], dy[at + 1], dy[at + 2] = y[at + 3] - vx, y[at + 4] - vy, y[at + 5] - vz
    dy[at + 3], dy[at + 4], dy[at + 5] = -fx / mass, -fy / mass, -fz / mass
    return fx, fy, fz


@njit(cache=True)
def swivel(moment, slow, wx, wy, wz, ux, uy, uz, vx, vy, vz, length):
    """Coulomb moments at both swivels of a leg: the moment on the platen and the lateral force at its point."""
    rx, ry, rz = (uy * vz - uz * vy) / length, (uz * vx - ux * vz) / length, (ux * vy - uy * vx) / length
    px, py, pz = wx - rx, wy - ry, wz - rz
    at_platen = moment / math.sqrt(px * px + py * py + pz * pz + slow * slow)
    at_base = moment / math.sqrt(rx * rx + ry * ry + rz * rz + slow * slow)
    mx, my, mz = at_platen * px - at_base * rx, at_platen * py - at_base * ry, at_platen * pz - at_base * rz
    fx, fy, fz = (my * uz - mz * uy) / length, (mz * ux - mx * uz) / length, (mx * uy - my * ux) / length
    return -at_platen * px, -at_platen * py, -at_platen * pz, fx, fy, fz


@njit(cache=True)
def rates(t, y, command, surge, legs, platen, inverse, dy, shown):
    """dy/dt for spool commands that have arrived at the valves (10) and a surge of the supply [Pa]."""
    body = platen[0]
    R = rotation(y)
    for j in range(SPOOL, STATES):
        dy[j] = 0.0
    # velocities: of C, and angular, on axes of space
    bx, by, bz = body.cog_x, body.cog_y, body.cog_z
    p, q, r = y[9], y[10], y[11]
    u, v, w = y[6], y[7], y[8]
    wx, wy, wz = turned(R, p, q, r)
    cx, cy, cz = turned(R, u - (q * bz - r * by), v - (r * bx - p * bz), w - (p * by - q * bx))
    gx, gy, gz = turned(R, bx, by, bz)  # from C to B
    dy[0], dy[1], dy[2] = cx, cy, cz
    sa, ca, cb = math.sin(y[3]), math.cos(y[3]), math.cos(y[4])
    turn = (q * sa + r * ca) / cb
    dy[3], dy[4], dy[5] = p + turn * math.sin(y[4]), q * ca - r * sa, turn
    fx, fy, fz = 0.0, 0.0, -body.mass_z * body.gravity
    mx, my, mz = 0.0, 0.0, 0.0  # about B, on axes of space
    nx, ny, nz = R[0, 2], R[1, 2], R[2, 2]
    supply = body.supply + surge - y[SUPPLY]
    back = body.back_pressure
    if body.back != 0.0:
        back += body.back * max(y[RETURN], 0.0) ** body.back_exponent
    taken_all, given_all = 0.0, 0.0
    later = max(t, 0.0)
    for i in range(13):
        leg = legs[i]
        length, dx, dy_, dz, ax, ay, az = leg_line(leg, y, R, body.plane)
        x = length - leg.length
        if leg.drift != 0.0:
            x += leg.drift * (1.0 - math.exp(-later / leg.drift_time))
        vx, vy, vz = cx + wy * az - wz * ay, cy + wz * ax - wx * az, cz + wx * ay - wy * ax
        rate = (nx * vx + ny * vy + nz * vz) / nz if leg.kind == 1 else dx * vx + dy_ * vy + dz * vz
        side_x, side_y, side_z = 0.0, 0.0, 0.0  # forces across the leg
        piston, piston_rate = x, rate
        if leg.gap != 0.0:
            piston, piston_rate = x + y[PISTON + i], y[PISTON_RATE + i]
        if leg.kind == 2:  # nitrogen, adiabatic at once and isothermal in the long run where heat gets out
            ratio = 1.0 + x / leg.gas_length
            j = GAS + i - 10
            pressure = leg.gas_pressure * ratio ** (-leg.gas_index) * math.exp(y[j]) / (1.0 + leg.gas_leak * later)
            if leg.gas_rate != 0.0:
                dy[j] = leg.gas_rate * ((leg.gas_index - 1.0) * math.log(ratio) - y[j])
            pull = -pressure * leg.gas_area
            shown[GAS_PRESSURE + i - 10] = pressure
        else:
            spool = command[i]
            if leg.lag != 0.0:
                spool = y[SPOOL + i]
                dy[SPOOL + i] = y[SPOOL_RATE + i]
                dy[SPOOL_RATE + i] = ((command[i] - spool) / leg.lag - 2.0 * y[SPOOL_RATE + i]) / leg.lag
            at_valve = supply
            if leg.line_inertance != 0.0:
                at_valve += y[LINE_P + i]
            pa, pb = y[PA + i], 0.0
            drop = pa
            if leg.kind == 0:
                pb = y[PB + i]
                drop = pa - pb
            flow_a, flow_b, taken, given = valve(leg, spool, pa, pb, at_valve, back, body.rated)
            if leg.line_inertance != 0.0:
                turn_rate = 2.0 * math.pi * leg.line_frequency
                resistance = 2.0 * leg.line_damping * turn_rate * leg.line_inertance
                dy[LINE_P + i] = (y[LINE_Q + i] - taken) * turn_rate**2 * leg.line_inertance
                dy[LINE_Q + i] = (-y[LINE_P + i] - resistance * (y[LINE_Q + i] - taken)) / leg.line_inertance
            taken_all += taken
            given_all += given
            leak = leakage(leg, drop)
            flow_a -= leak + leg.external_a * (pa - back)
            bulk = body.bulk / compliance(leg, pa)
            dy[PA + i] = bulk / (leg.chamber_a + leg.dead + piston) * (flow_a / leg.area_a - piston_rate)
            pull = pa * leg.area_a
            if leg.kind == 0:
                flow_b += leak - leg.external_b * (pb - back)
                bulk = body.bulk / compliance(leg, pb)
                dy[PB + i] = bulk / (leg.chamber_b + leg.dead - piston) * (flow_b / leg.area_b + piston_rate)
                pull -= pb * leg.area_b
        shown[X + i], shown[PULL + i] = piston, pull
        # friction and the rest along the leg
        heat = y[HEAT + i]
        plateau = seal_plateau(leg, piston_rate, pull, heat)
        dy[SEAL + i] = bristle(y[SEAL + i], piston_rate, leg.seal_yield, leg.seal_exponent)
        if leg.warm_fraction != 0.0:
            dy[HEAT + i] = plateau * abs(piston_rate) / leg.warm_energy - heat / leg.warm_time
        if leg.memory != 0.0:
            dy[PAST + i] = memory_rate(leg, piston, piston_rate, y[PAST + i])
        axial = pull - plateau * y[SEAL + i] - leg.viscous * piston_rate
        axial += leg_force(leg, piston, piston_rate, y[SEAL + i], y[PAST + i])
        if leg.creep != 0.0:
            for k in range(CREEPERS):
                j = CREEP + CREEPERS * i + k
                axial -= leg.creep * (piston - y[j])
                dy[j] = creep_rate(leg, piston - y[j], k)
        if leg.gap != 0.0:  # a rod of some mass between the oil and a clevis with play
            play = y[PISTON + i]
            contact = leg.gap_stiffness * soft_gap(play, leg.gap, 0.1 * leg.gap)
            contact += leg.gap_damping * (piston_rate - rate) * min(abs(contact) / 1e4, 1.0)
            dy[PISTON + i] = piston_rate - rate
            dy[PISTON_RATE + i] = (axial - contact) / leg.gap_mass
            axial = contact
        if leg.kind == 1:
            if body.thrust != 0.0:  # the share of the thrust along the platen's normal rather than straight up
                dx, dy_ = body.thrust * nx / nz, body.thrust * ny / nz
            # sliding of the platen over the plate, in the plate's plane
            tilt_s, tilt_c = -ny, math.sqrt(1.0 - ny * ny)
            lean_s, lean_c = nx / tilt_c, nz / tilt_c
            slide_z = vz - rate
            s1 = lean_c * vx - lean_s * slide_z
            s2 = lean_s * tilt_s * vx + tilt_c * vy + lean_c * tilt_s * slide_z
            speed = math.sqrt(s1 * s1 + s2 * s2)
            j = PAD + 2 * (i - 4)
            k = PAD_HEAT + i - 4
            grip = pad_plateau(leg, pull, y[k])
            if leg.pad_warm_fraction != 0.0:
                dy[k] = grip * speed / leg.pad_warm_energy - y[k] / leg.pad_warm_time
            dy[j] = (s1 - speed * y[j]) / leg.pad_yield
            dy[j + 1] = (s2 - speed * y[j + 1]) / leg.pad_yield
            f1, f2 = -grip * y[j], -grip * y[j + 1]
            side_x = lean_c * f1 + lean_s * tilt_s * f2
            side_y = tilt_c * f2
            side_z = -lean_s * f1 + lean_c * tilt_s * f2
        elif leg.swivel_moment != 0.0:
            tx, ty, tz, side_x, side_y, side_z = swivel(
                leg.swivel_moment, leg.swivel_rate, wx, wy, wz, dx, dy_, dz, vx, vy, vz, length
            )
            mx, my, mz = mx + tx, my + ty, mz + tz
        lx, ly, lz = axial * dx + side_x, axial * dy_ + side_y, axial * dz + side_z
        rx, ry, rz = ax - gx, ay - gy, az - gz
        fx, fy, fz = fx + lx, fy + ly, fz + lz
        mx, my, mz = mx + ry * lz - rz * ly, my + rz * lx - rx * lz, mz + rx * ly - ry * lx
    if body.droop != 0.0:
        dy[SUPPLY] = (body.droop * taken_all - y[SUPPLY]) / body.droop_time
    dy[RETURN] = (given_all - y[RETURN]) / RETURN_TIME
    shown[SUPPLY_PRESSURE] = supply
    # what hangs on the platen: hoses, dead weight, sprung masses
    if body.spring_reach != 0.0:
        fx -= body.spring_x * body.spring_reach * math.tanh(y[0] / body.spring_reach)
        fy -= body.spring_y * body.spring_reach * math.tanh(y[1] / body.spring_reach)
        fz -= body.spring_z * body.spring_reach * math.tanh(y[2] / body.spring_reach)
    if body.weight != 0.0:
        ax, ay, az = turned(R, body.weight_x, body.weight_y, 0.0)
        load = -body.weight * body.gravity
        fz += load
        mx, my = mx + (ay - gy) * load, my - (ax - gx) * load
    if body.added_mass != 0.0:
        ax, ay, az = turned(R, body.added_x - bx, body.added_y - by, body.added_z - bz)
        load = -body.added_mass * body.gravity
        fz += load
        mx, my = mx + ay * load, my - ax * load
    for k in range(2):
        mass, foot_x, foot_y, foot_z = body.structure_mass, body.structure_x, body.structure_y, body.structure_z
        frequency, damping, load = body.structure_frequency, body.structure_damping, 0.0
        if k == 1:
            mass, foot_x, foot_y, foot_z = body.specimen_mass, body.specimen_x, body.specimen_y, body.specimen_z
            frequency, damping, load = body.specimen_frequency, body.specimen_damping, -mass * body.gravity
        if mass != 0.0:
            ax, ay, az = turned(R, foot_x, foot_y, foot_z)
            vx, vy, vz = cx + wy * az - wz * ay, cy + wz * ax - wx * az, cz + wx * ay - wy * ax
            lx, ly, lz = sprung_mass(y, dy, SWAY + 6 * k, mass, frequency, damping, vx, vy, vz)
            lz += load
            rx, ry, rz = ax - gx, ay - gy, az - gz
            fx, fy, fz = fx + lx, fy + ly, fz + lz
            mx, my, mz = mx + ry * lz - rz * ly, my + rz * lx - rx * lz, mz + rx * ly - ry * lx
    # Newton and Euler on body axes (Eqs. 4-26, 4-28), a point mass and products of inertia among the inertia
    wrench_0 = R[0, 0] * fx + R[1, 0] * fy + R[2, 0] * fz - body.mass_x * (q * w - r * v)
    wrench_1 = R[0, 1] * fx + R[1, 1] * fy + R[2, 1] * fz - body.mass_y * (r * u - p * w)
    wrench_2 = R[0, 2] * fx + R[1, 2] * fy + R[2, 2] * fz - body.mass_z * (p * v - q * u)
    hx = body.inertia_x * p - body.product_xy * q - body.product_xz * r
    hy = body.inertia_y * q - body.product_xy * p - body.product_yz * r
    hz = body.inertia_z * r - body.product_xz * p - body.product_yz * q
    wrench_3 = R[0, 0] * mx + R[1, 0] * my + R[2, 0] * mz - (q * hz - r * hy)
    wrench_4 = R[0, 1] * mx + R[1, 1] * my + R[2, 1] * mz - (r * hx - p * hz)
    wrench_5 = R[0, 2] * mx + R[1, 2] * my + R[2, 2] * mz - (p * hy - q * hx)
    if body.added_mass != 0.0:
        rx, ry, rz = body.added_x - bx, body.added_y - by, body.added_z - bz
        ox, oy, oz = u + q * rz - r * ry, v + r * rx - p * rz, w + p * ry - q * rx  # velocity of the mass
        lx = -body.added_mass * (q * oz - r * oy)
        ly = -body.added_mass * (r * ox - p * oz)
        lz = -body.added_mass * (p * oy - q * ox)
        wrench_0, wrench_1, wrench_2 = wrench_0 + lx, wrench_1 + ly, wrench_2 + lz
        wrench_3, wrench_4, wrench_5 = (
            wrench_3 + ry * lz - rz * ly,
            wrench_4 + rz * lx - rx * lz,
            wrench_5 + rx * ly - ry * lx,
        )
    for j in range(6):
        dy[TWIST + j] = (
            inverse[j, 0] * wrench_0
            + inverse[j, 1] * wrench_1
            + inverse[j, 2] * wrench_2
            + inverse[j, 3] * wrench_3
            + inverse[j, 4] * wrench_4
            + inverse[j, 5] * wrench_5
        )
