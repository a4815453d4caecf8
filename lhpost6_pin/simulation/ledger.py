"""The force ledger of a run: force and wrench of every effect on the platen.

    ledger = force_ledger(run)
    ledger.force[:, ledger.row("actuators_4_way.H1")]         # [N]
    ledger.wrench[:, ledger.effect("pad_friction")]           # (n, 6) at C in {c}

It evaluates the states of the run with the stages of the engines; a specimen with joints by pin.rnea.
Inertia = sum of all effects and the weight (Eqs. 4-24 to 4-26), each as a wrench on the platen at C.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ..core.compiled import compiled, compiled_inline
from ..core.errors import UnknownNameError
from ..effects.registry import PORTS
from ..mechanics.plant import Plant
from ..mechanics.pose import PlantMotion
from ..mechanics.required_wrench import moving_wrenches, rigid_wrenches, wrenches_at_c
from ..mechanics.schemes import V_SEEN, forces_stage, pose_stage
from ..mechanics.spatial import act_force
from ..mechanics.tables import Tables
from ..mechanics.workspace import Workspace, make_workspace
from .simulate import Run
from .specimen_response import modes_of_run

if TYPE_CHECKING:
    import xarray as xr

from ..core.arrays import Array

__all__ = ["Ledger", "States", "add_at_c", "add_row_at_c", "force_ledger", "number_of", "history_of"]

WRENCH_AXES = ("fx", "fy", "fz", "mx", "my", "mz")


class States(NamedTuple):
    """States of a plant over time, simulated or measured; n samples."""

    plant: Plant
    time: Array  # (n,) [s]
    q: Array  # (n, nq)
    v: Array  # (n, nv), at which forces are evaluated
    a: Array  # (n, nv)
    z: Array  # (n, n_states)


@dataclass(frozen=True)
class Ledger:
    """Forces of a run; n samples."""

    time: Array  # (n,) [s]
    rows: tuple[str, ...]  # (k,) "effect.port"
    force: Array  # (n, k) on the port [N], or [N m] on a rotation
    effects: tuple[str, ...]  # (m,) effects in the machine's order, gravity, modes of a specimen, guides of a platen
    wrench: Array  # (n, m, 6) on the platen at C in {c}: fx fy fz mx my mz [N, N m]
    inertia: Array  # (n, 6) rate of momentum of platen and specimen, same point and axes [N, N m]

    @property
    def residual(self) -> Array:
        """Inertia minus the sum of all effects (n, 6) [N, N m]: the error of the integrator."""
        return self.inertia - self.wrench.sum(axis=1)

    def row(self, name: str) -> int:
        """Index of a row of `force`; raises UnknownNameError that lists the names."""
        return number_of("force", name, self.rows)

    def effect(self, name: str) -> int:
        """Index of an effect in `wrench`; raises UnknownNameError that lists the names."""
        return number_of("effect", name, self.effects)

    def at(self, sample: int) -> dict[str, pin.Force]:
        """Wrench of every effect on the platen at one sample, at C in {c}."""
        return {effect: pin.Force(w) for effect, w in zip(self.effects, self.wrench[sample], strict=True)}

    def to_dataset(self) -> "xr.Dataset":
        """Lay out as a dataset with dims time, row, effect, axis and units."""
        import xarray as xr

        contents = {
            "force": (("row",), self.force, "force on the port"),
            "wrench": (("effect", "axis"), self.wrench, "wrench on the platen at C in {c}"),
            "inertia": (("axis",), self.inertia, "inertial wrench at C in {c}"),
        }
        data = {
            name: (("time", *dims), values, {"units": "N, N m", "long_name": about})
            for name, (dims, values, about) in contents.items()
        }
        coords = {"row": list(self.rows), "effect": list(self.effects), "axis": list(WRENCH_AXES)}
        return xr.Dataset(data, coords).assign_coords(time=("time", self.time, {"units": "s"}))


def force_ledger(run: "Run | States") -> Ledger:
    """Forces of every effect at every recorded sample, and the inertia that they balance."""
    plant = run.plant
    effects = plant.machine.effects
    n = len(run.time)
    by_row = np.zeros((n, plant.rows.size, len(PORTS)))
    by_effect = np.zeros((n, len(effects), 6))
    turn = np.zeros((n, 3, 3))
    _forces(*history_of(run), by_row, by_effect, turn)
    at_b = _articulated(run) if plant.articulated else rigid_wrenches(plant, PlantMotion(run.q, run.v, run.a), turn)
    inertia, gravity = (wrenches_at_c(plant, turn, w) for w in at_b)
    names = [e.name for e in effects]
    wrench = np.concatenate([by_effect, gravity[:, None]], axis=1)
    names.append("gravity")
    if plant.modes.size:
        reaction = modes_of_run(run).reaction
        wrench = np.concatenate([wrench, wrenches_at_c(plant, turn, reaction)[:, None]], axis=1)
        names.append("specimen_modes")
    if plant.axes.size != 6:
        guides = inertia - wrench.sum(axis=1)
        guides[:, plant.axes] = 0.0
        wrench = np.concatenate([wrench, guides[:, None]], axis=1)
        names.append("guides")
    # a law on several ports has one row for each
    used = [(i, k) for i, row in enumerate(plant.rows) for k in range(len(PORTS)) if row[PORTS[k]] >= 0]
    rows = [f"{names[plant.rows[i]['effect']]}.{plant.ports[plant.rows[i][PORTS[k]]]}" for i, k in used]
    force = by_row[:, [i for i, _ in used], [k for _, k in used]]
    return Ledger(run.time, tuple(rows), force, tuple(names), wrench, inertia)


def number_of(kind: str, name: str, valid: Sequence[str]) -> int:
    """Index of a name among the valid ones; raises UnknownNameError that lists them."""
    if name not in valid:
        raise UnknownNameError(kind, name, list(valid))
    return list(valid).index(name)


def history_of(run: "Run | States") -> tuple[Array, Array, Array, Tables, Workspace]:
    """States q, v, z of a run, the plant's tables and a workspace, as arguments of compiled loops over a run."""
    plant = run.plant
    q, v, z = (np.ascontiguousarray(x) for x in (run.q, run.v, run.z))
    return q, v, z, plant.tables, make_workspace(plant, plant.zero_state())


@compiled
def _forces(q, v, z, tables, ws, by_row, by_effect, turn):
    """Fill by_row (n, n_rows, 3), by_effect (n, n_effects, 6) at C in {c} and turn (n, 3, 3), the rotation s_R_b."""
    rho = tables.body[0].rho_c
    for k in range(q.shape[0]):
        ws.motion[V_SEEN] = v[k]
        pose_stage(q[k], tables, ws)
        forces_stage(tables, ws, z[k])
        by_row[k] = ws.force
        turn[k] = ws.frame[:3]
        for i in range(tables.rows.size):
            add_row_at_c(ws.force[i], ws.JB[1], tables.rows[i], rho, ws.frame, by_effect[k, tables.rows[i].effect])


@compiled_inline
def add_at_c(force, B, port, rho, frame, out):
    """Add the wrench at C in {c} of a force on a port to out (6,); B (n_ports, 6) at B in platen axes, rho its C."""
    unit, moment = act_force(frame, rho, B[port], B[port, 3:])
    for j in range(3):
        out[j] += force * unit[j]
        out[3 + j] += force * moment[j]


@compiled_inline
def add_row_at_c(force, B, row, rho, frame, out):
    """Add the wrench at C in {c} of a row's forces (3,) on its ports to out (6,), as `add_at_c` does."""
    add_at_c(force[0], B, row.port, rho, frame, out)
    if row.port_2 >= 0:
        add_at_c(force[1], B, row.port_2, rho, frame, out)
    if row.port_3 >= 0:
        add_at_c(force[2], B, row.port_3, rho, frame, out)


def _articulated(run: "Run | States") -> tuple[Array, Array]:
    """Inertial wrench and weight (n, 6) at B in platen axes of a platen whose specimen has joints, by pin.rnea."""
    plant, body = run.plant, run.plant.body[0]
    weightless = plant.model.copy()
    weightless.gravity = pin.Motion.Zero()
    models = [(model, model.createData()) for model in (weightless, plant.model)]
    zero = np.zeros(plant.model.nv)
    inertia, weight = np.zeros((2, len(run.time), 6))
    for k, (q, v, a) in enumerate(zip(run.q, run.v, run.a, strict=True)):
        for (model, data), rates in zip(models, ((v, a), (zero, zero)), strict=True):
            pin.rnea(model, data, q, *rates)
        (_, moving), (_, still) = models
        inertia[k], weight[k] = moving.f[1].vector, -still.f[1].vector
        weight[k, :3] -= body["weight_extra"] * still.liMi[1].rotation[2]
    twist, rise = np.zeros((2, len(run.time), 6))
    twist[:, plant.axes], rise[:, plant.axes] = (x[:, : plant.axes.size] for x in (run.v, run.a))
    inertia[:, :3] += body["mass_extra"] * (rise[:, :3] + np.cross(twist[:, 3:], twist[:, :3]))
    more = moving_wrenches(plant, PlantMotion(run.q, run.v, run.a))
    return inertia + more[0], weight + more[1]
