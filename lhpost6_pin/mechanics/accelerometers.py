"""Accelerometers on the platen: what they read, and the acceleration that a controller computes from it.

An accelerometer at r from C with the sensitive direction d, both in platen axes, reads

    m = d . (R' (a_C + g e_z) + alpha x r + omega x (omega x r)) - g d_z

the acceleration of its point less gravity, zero at rest in the zero-position; a_C in {s}, omega and alpha in platen
axes. Near the zero-position m = A (a_C, alpha) with rows (d, r x d) of A. A controller takes the pseudo-inverse of A on
the axes in which the platen moves, so that tilt and turning enter its acceleration feedback as they do on the table.
"""

from collections.abc import Sequence

import numpy as np

from ..core.arrays import Array
from ..core.compiled import compiled_inline
from ..core.errors import ParameterError
from ..core.names import AXES
from ..machine.components import Accelerometer
from ..machine.machine import Machine
from .spatial import cross, to_body

__all__ = ["accelerometer_rows", "accelerometer_table", "acceleration_weights", "composed_acceleration", "reading"]
__all__ += ["sensitivities"]

_BLIND = 1e-6  # below it accelerometers do not see a motion
_PART = 0.3  # of a motion that none of them sees: axes with more are named


def accelerometer_rows(accelerometers: Sequence[Accelerometer]) -> Array:
    """Rows (n, 6) of accelerometers: point from C [m] and unit direction, in platen axes."""
    rows = [(*one.point, *np.divide(one.direction, np.linalg.norm(one.direction))) for one in accelerometers]
    return np.array(rows, float).reshape(-1, 6)


def sensitivities(rows: Array) -> Array:
    """Change (n, 6) of the readings per acceleration of C and per angular acceleration, zero-position."""
    return np.hstack([rows[:, 3:], np.cross(rows[:, :3], rows[:, 3:])])


def acceleration_weights(rows: Array, machine: Machine) -> Array:
    """Weights (6, n) of accelerometers in the platen's acceleration, zero in axes in which it cannot move.

    Raises ParameterError naming the axes that they do not determine.
    """
    axes = list(machine.axes)
    seen = sensitivities(rows)[:, axes]
    size = np.maximum(np.linalg.norm(seen, axis=0), _BLIND)
    _, values, turned = np.linalg.svd(seen / size, full_matrices=True)
    unseen = turned[np.count_nonzero(values > _BLIND) :]  # motions that no accelerometer sees
    lost = [AXES[k] for k, part in zip(axes, np.linalg.norm(unseen, axis=0), strict=True) if part > _PART]
    if lost:
        raise ParameterError(
            f"{machine.name}: {len(rows)} accelerometers do not determine the platen's acceleration in "
            f"{', '.join(lost)}; add some, or correct their points and directions"
        )
    out = np.zeros((6, len(rows)))
    out[axes] = np.linalg.pinv(seen)
    return out


def accelerometer_table(machine: Machine) -> Array:
    """Table (n * 12,) of `composed_acceleration`: of each its row and its weights; empty without accelerometers."""
    if not machine.accelerometers:
        return np.zeros(0)
    rows = accelerometer_rows(machine.accelerometers)
    return np.hstack([rows, acceleration_weights(rows, machine).T]).ravel()


@compiled_inline
def reading(frame, along, omega, alpha, gravity, row):
    """Reading [m/s2] of an accelerometer: row its point and direction, `along` the acceleration of C in {s}."""
    point, direction = row[:3], row[3:6]
    ax, ay, az = to_body(frame, (along[0], along[1], along[2] + gravity))
    tx, ty, tz = cross(alpha, point)
    bx, by, bz = cross(omega, cross(omega, point))
    return direction[0] * (ax + tx + bx) + direction[1] * (ay + ty + by) + direction[2] * (az + tz + bz - gravity)


@compiled_inline
def composed_acceleration(table, frame, axes, v, a, gravity, acceleration):
    """Replace acceleration (6,), that of C in {s} and of the Euler angles, by the one that a controller computes.

    v, a (nv,) as a plant integrates them, frame its pose.
    """
    omega, alpha = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if axes.size == 6:
        omega, alpha = (v[3], v[4], v[5]), (a[3], a[4], a[5])
    along = (acceleration[0], acceleration[1], acceleration[2])
    acceleration[:] = 0.0
    for at in range(0, table.size, 12):
        read = reading(frame, along, omega, alpha, gravity, table[at : at + 6])
        for k in range(6):
            acceleration[k] += table[at + 6 + k] * read
