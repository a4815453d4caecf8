"""Wrenches on the platen along a path of its ports: what a motion asks for, and what laws and measured forces give.

All at B in platen axes on the platen's free axes until they are summed; results are at C in {c}.
"""

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled
from ..effects.evaluate import apply_forces, wrench_on_platen
from ..effects.registry import PORTS
from ..mechanics.forward_dynamics import platen_acceleration
from ..mechanics.plant import Plant
from ..mechanics.port_path import PortPath
from ..mechanics.pose import PlantMotion
from ..mechanics.rigid_body import platen_inertia
from ..mechanics.schemes import set_twist
from ..simulation.engine_fused import refuse_joints
from ..simulation.ledger import add_at_c, add_row_at_c

__all__ = ["wrench_residual", "required_wrench", "row_wrenches", "weigh_alike"]

Array = NDArray[np.float64]


def weigh_alike(some: Plant, other: Plant) -> bool:
    """Whether the platens of two plants need the same wrench for a motion."""
    one, two = (np.append(platen_inertia(p.model, p.machine), p.machine.platen.gravity) for p in (some, other))
    return bool(np.array_equal(one, two) and some.body["weight_extra"] == other.body["weight_extra"])


def required_wrench(plant: Plant, motion: PlantMotion, turn: Array) -> Array:
    """Wrench (n, 6) at B in platen axes that inertia and weight ask for along a motion, on the platen's free axes.

    Mass times the acceleration that the fused engine's forward dynamics do not give without forces; turn (n, 3, 3) is
    the platen's rotation. Raises SimulationError for an articulated specimen.
    """
    required = np.zeros((len(motion.q), 6))
    _, mass = platen_inertia(plant.model, plant.machine)
    v, a = (np.ascontiguousarray(x) for x in (motion.v, motion.a))
    refuse_joints(plant)
    _required(v, a, turn, plant.tables, mass, required)
    return required


@compiled
def _required(v, a, turn, tables, mass, required):
    axes, body, inertia = tables.axes, tables.body, tables.inertia
    frame, work = np.zeros((8, 3)), np.zeros((2, 6))
    column, force = np.zeros((1, 6)), np.zeros(1)
    tau, miss = np.zeros(axes.size), np.zeros(axes.size)
    for k in range(required.shape[0]):
        frame[:3] = turn[k]
        set_twist(v[k], axes, frame)
        wrench_on_platen(frame, body, column, force)  # what no Inertia holds
        for i in range(axes.size):
            tau[i] = frame[6 + axes[i] // 3, axes[i] % 3]
        platen_acceleration(inertia, axes, frame, tau, work, miss)
        for j in range(axes.size):
            miss[j] = a[k, j] - miss[j]
        for i in range(axes.size):
            for j in range(axes.size):
                required[k, axes[i]] += mass[axes[i], axes[j]] * miss[j]


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
