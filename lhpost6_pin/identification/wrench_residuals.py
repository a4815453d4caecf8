"""Wrenches on the platen along a path of its ports: what laws and measured forces leave of the required one.

All at B in platen axes on the platen's free axes until they are summed; results are at C in {c}.
"""

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.compiled import compiled
from ..effects.evaluate import apply_forces
from ..effects.registry import PORTS
from ..mechanics.plant import Plant
from ..mechanics.port_path import PortPath
from ..simulation.ledger import add_at_c, add_row_at_c

__all__ = ["wrench_residual", "row_wrenches"]


def wrench_residual(plant: Plant, ports: PortPath, required: Array, z: Array, measured: Array) -> Array:
    """Wrench (n, 6) at C in {c} that is needed beyond what the plant's laws and measured forces give [N, N m].

    required is that of `required_wrench`, z (n, n_states) hidden states, measured (n, n_actuators) forces [N].
    """
    rows = plant.rows[plant.rows["spool"] < 0]
    missed = np.zeros((len(z), 6))
    _residual(rows, plant.tables, ports, required, z, np.ascontiguousarray(measured), missed)
    return missed


@compiled
def _residual(rows, tables, ports, required, z, measured, missed):
    s, axes, column = ports.s, tables.axes, ports.column
    force, port_force = np.zeros((rows.size, len(PORTS))), np.zeros(s.shape[1])
    frame, left = np.zeros((8, 3)), np.zeros((1, 6))
    for k in range(s.shape[0]):
        apply_forces(rows, s[k], ports.rate[k], z[k], force, port_force)
        for i in range(measured.shape[1]):
            port_force[i] += measured[k, i]
        for j in range(axes.size):
            given = 0.0
            for i in range(port_force.size):
                given += column[k, i, axes[j]] * port_force[i]
            left[0, axes[j]] = required[k, axes[j]] - given
        frame[:3] = ports.turn[k]
        add_at_c(1.0, left, 0, tables.body[0].rho_c, frame, missed[k])


def row_wrenches(plant: Plant, ports: PortPath, z: Array, rows: NDArray[np.void]) -> Array:
    """Wrenches (n, k, 6) at C in {c} [N, N m] of k rows of the plant's effects, that take no spool."""
    out = np.zeros((len(z), len(rows), 6))
    _row_wrenches(np.ascontiguousarray(rows), plant.body, ports, z, out)
    return out


@compiled
def _row_wrenches(rows, body, ports, z, out):
    s = ports.s
    force, port_force = np.zeros((rows.size, len(PORTS))), np.zeros(s.shape[1])
    frame, rho = np.zeros((8, 3)), body[0].rho_c
    for k in range(s.shape[0]):
        apply_forces(rows, s[k], ports.rate[k], z[k], force, port_force)
        frame[:3] = ports.turn[k]
        for i in range(rows.size):
            add_row_at_c(force[i], ports.column[k], rows[i], rho, frame, out[k, i])
