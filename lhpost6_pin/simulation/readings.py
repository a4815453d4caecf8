"""All that a running plant shows at an instant as one row of numbers, in one compiled call.

    acceleration (6,), displacement (n,), force (n,)        sensors (`control.loop.Feedback`)
    position, Euler angles, twist, acceleration (18,)       motion of the interface, at C (`coupled.motion_numbers`)
    A (n,), B (n,), spool (n,), strut (k,), supply          pressures (`running.PressureReading`), where there is room

`RunningPlant.sensors`, `interface_motion` and `pressures` are the same one by one, the latter two in Python.
"""

import math

import numpy as np

from ..control.loop import Feedback, sense
from ..core.compiled import compiled, compiled_inline
from ..effects.gas import log_ratio_at
from ..effects.supply import supply_pressures
from ..effects.views import view_hydraulic
from ..laws.nitrogen_strut import gas_pressure
from ..mechanics.ports import platen_pose
from ..mechanics.schemes import A, S, V
from ..mechanics.spatial import cross, from_body, matrix_to_rpy
from ..mechanics.tables import unpack_tables
from ..mechanics.workspace import unpack_workspace

__all__ = ["INTERFACE", "read_packed"]

INTERFACE = 18
"""Numbers of the motion of the interface."""


@compiled_inline
def _put(x, out, at):
    out[at], out[at + 1], out[at + 2] = x[0], x[1], x[2]


@compiled_inline
def _interface(tables, ws, frame, moved, out):
    """Motion (18,) of C as `base_motion` and `motion_numbers` give it; frame (8, 3) and moved (2, 6) are scratch."""
    axes, rho = tables.axes, tables.body[0].rho_c
    platen_pose(ws.q, axes, tables.body, frame)
    moved[:] = 0.0
    for k in range(axes.size):
        moved[0, axes[k]], moved[1, axes[k]] = ws.motion[V, k], ws.motion[A, k]
    v, omega, a, alpha = moved[0], moved[0, 3:], moved[1], moved[1, 3:]
    lever = from_body(frame, rho)
    _put((frame[3, 0] + lever[0], frame[3, 1] + lever[1], frame[3, 2] + lever[2]), out, 0)
    _put(matrix_to_rpy(frame), out, 3)
    tx, ty, tz = cross(omega, rho)
    at_c = (v[0] + tx, v[1] + ty, v[2] + tz)
    _put(at_c, out, 6)
    _put(omega, out, 9)
    rx, ry, rz = cross(alpha, rho)
    bx, by, bz = cross(omega, at_c)
    _put((a[0] + rx + bx, a[1] + ry + by, a[2] + rz + bz), out, 12)
    _put(alpha, out, 15)


@compiled_inline
def _pressures(tables, ws, window, gas, out):
    """Pressures and spools (3 n + k + 1,); gas (3, k): numbers of the struts' law (`gas_pressure.gas_numbers`)."""
    rows, actuators, z, steps = tables.rows, tables.actuators, ws.z, window.shape[0]
    n, struts = actuators.size, gas.shape[1]
    for i in range(n):
        row = rows[actuators[i]]
        out[i] = z[row.state]
        out[n + i] = z[row.state + 1] if view_hydraulic(row.numbers).area_b > 0.0 else 0.0
        total = 0.0
        for j in range(steps):
            total += window[j, i]
        out[2 * n + i] = total / steps
    for j in range(struts):
        ratio = 1.0
        for r in range(rows.size):
            if rows[r].port == n + j:
                ratio += math.expm1(log_ratio_at(rows[r], z))
        out[3 * n + j] = gas_pressure(ws.port[S, n + j], gas[0, j], gas[1, j], gas[2, j]) * ratio
    out[3 * n + struts] = supply_pressures(tables.supply, z)[0]


@compiled
def read_packed(packed, buffer, window, gas, out):
    """Fill out as the module says; returns whether all numbers are finite."""
    tables, ws = unpack_tables(packed), unpack_workspace(buffer)
    n = tables.actuators.size
    at = 6 + 2 * n
    sense(tables, ws, Feedback(out[6 : 6 + n], out[:6], out[6 + n : at]))
    _interface(tables, ws, np.empty((8, 3)), np.empty((2, 6)), out[at : at + INTERFACE])
    if out.size > at + INTERFACE:
        _pressures(tables, ws, window, gas, out[at + INTERFACE :])
    for x in out:
        if not math.isfinite(x):
            return False
    return True
