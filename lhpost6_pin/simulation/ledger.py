"""The force ledger of a run: who pushes the platen.

    ledger = force_ledger(run)
    ledger.force[:, ledger.row("actuators_4_way.H1")]         # [N]
    ledger.wrench[:, ledger.effect("pad_friction")]           # (n, 6) at C in {c}

It evaluates the run's states with the stages that the engines run; only the rigid body's part is pin.rnea.
Inertia = sum of all effects and the weight (Eqs. 4-24 to 4-26), each as a wrench on the platen at C.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..core.compiled import compiled, compiled_inline
from ..core.errors import UnknownNameError
from ..effects.registry import PORTS
from ..mechanics.plant import Plant
from ..mechanics.schemes import V_SEEN, forces_stage, pose_stage
from ..mechanics.tables import Tables
from ..mechanics.workspace import Workspace, make_workspace
from .simulate import Run

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Ledger", "States", "add_at_c", "add_row_at_c", "force_ledger", "number_of", "history_of"]

Array = NDArray[np.float64]

WRENCH_AXES = ("fx", "fy", "fz", "mx", "my", "mz")


class States(NamedTuple):
    """States of a plant over time, wherever they come from; n samples."""

    plant: Plant
    time: Array  # (n,) [s]
    q: Array  # (n, nq)
    v: Array  # (n, nv), as forces see it
    a: Array  # (n, nv)
    z: Array  # (n, n_states)


@dataclass(frozen=True)
class Ledger:
    """Forces of a run; n samples."""

    time: Array  # (n,) [s]
    rows: tuple[str, ...]  # (k,) "effect.port"
    force: Array  # (n, k) on the port [N], or [N m] on a rotation
    effects: tuple[str, ...]  # (m,) effects in the machine's order, gravity, and the guides of a guided platen
    wrench: Array  # (n, m, 6) on the platen at C in {c}: fx fy fz mx my mz [N, N m]
    inertia: Array  # (n, 6) rate of momentum of platen and specimen, same point and axes [N, N m]

    @property
    def residual(self) -> Array:
        """Inertia less the sum of all effects (n, 6) [N, N m]: the integrator's, not the physics'."""
        return self.inertia - self.wrench.sum(axis=1)

    def row(self, name: str) -> int:
        """Number of a row of `force`; raises UnknownNameError that lists the names."""
        return number_of("force", name, self.rows)

    def effect(self, name: str) -> int:
        """Number of an effect in `wrench`; raises UnknownNameError that lists the names."""
        return number_of("effect", name, self.effects)

    def at(self, sample: int) -> dict[str, pin.Force]:
        """Wrench of every effect on the platen at one sample, at C in {c}."""
        return {effect: pin.Force(w) for effect, w in zip(self.effects, self.wrench[sample], strict=True)}

    def to_dataset(self) -> "xr.Dataset":
        """Lay out as a dataset with dims time, row, effect, axis and units."""
        import xarray as xr

        data = xr.Dataset(
            {
                "force": (("time", "row"), self.force, {"units": "N, N m", "long_name": "force on the port"}),
                "wrench": (
                    ("time", "effect", "axis"),
                    self.wrench,
                    {"units": "N, N m", "long_name": "wrench on the platen at C in {c}"},
                ),
                "inertia": (
                    ("time", "axis"),
                    self.inertia,
                    {"units": "N, N m", "long_name": "inertial wrench at C in {c}"},
                ),
            },
            {"row": list(self.rows), "effect": list(self.effects), "axis": list(WRENCH_AXES)},
        )
        return data.assign_coords(time=("time", self.time, {"units": "s"}))


def force_ledger(run: "Run | States") -> Ledger:
    """Forces of every effect at every recorded sample, and the inertia that they balance."""
    plant = run.plant
    effects = plant.machine.effects
    n = len(run.time)
    by_row = np.zeros((n, plant.rows.size, len(PORTS)))
    by_effect = np.zeros((n, len(effects), 6))
    turn = np.zeros((n, 3, 3))
    _forces(*history_of(run), by_row, by_effect, turn)
    inertia, gravity = (_at_c(turn, plant, w) for w in _rigid_wrenches(run))
    names = [e.name for e in effects]
    wrench = np.concatenate([by_effect, gravity[:, None]], axis=1)
    names.append("gravity")
    if plant.axes.size != 6:
        guides = inertia - wrench.sum(axis=1)
        guides[:, plant.axes] = 0.0
        wrench = np.concatenate([wrench, guides[:, None]], axis=1)
        names.append("guides")
    # a law on several ports has as many columns
    used = [(i, k) for i, row in enumerate(plant.rows) for k in range(len(PORTS)) if row[PORTS[k]] >= 0]
    rows = [f"{names[plant.rows[i]['effect']]}.{plant.ports[plant.rows[i][PORTS[k]]]}" for i, k in used]
    force = by_row[:, [i for i, _ in used], [k for _, k in used]]
    return Ledger(run.time, tuple(rows), force, tuple(names), wrench, inertia)


def number_of(kind: str, name: str, valid: Sequence[str]) -> int:
    """Place of a name among the valid ones; raises UnknownNameError that lists them."""
    if name not in valid:
        raise UnknownNameError(kind, name, list(valid))
    return list(valid).index(name)


def history_of(run: "Run | States") -> tuple[Array, Array, Array, Tables, Workspace]:
    """States q, v, z of a run, the plant's tables and a workspace, as the compiled loops below take them."""
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
    b0, b1, b2 = B[port, 0], B[port, 1], B[port, 2]
    # from B to C: the moment less rho x force
    mx = B[port, 3] - (rho[1] * b2 - rho[2] * b1)
    my = B[port, 4] - (rho[2] * b0 - rho[0] * b2)
    mz = B[port, 5] - (rho[0] * b1 - rho[1] * b0)
    for j in range(3):
        out[j] += force * (frame[j, 0] * b0 + frame[j, 1] * b1 + frame[j, 2] * b2)
        out[3 + j] += force * (frame[j, 0] * mx + frame[j, 1] * my + frame[j, 2] * mz)


@compiled_inline
def add_row_at_c(force, B, row, rho, frame, out):
    """Add the wrench at C in {c} of a row's forces (3,) on its ports to out (6,), as `add_at_c` does."""
    add_at_c(force[0], B, row.port, rho, frame, out)
    if row.port_2 >= 0:
        add_at_c(force[1], B, row.port_2, rho, frame, out)
    if row.port_3 >= 0:
        add_at_c(force[2], B, row.port_3, rho, frame, out)


def _rigid_wrenches(run: "Run | States") -> tuple[Array, Array]:
    """Inertial wrench and weight (n, 6) of platen and specimen at B in platen axes (Eqs. 4-24, 4-26)."""
    plant = run.plant
    body = plant.body[0]
    weightless = plant.model.copy()
    weightless.gravity = pin.Motion.Zero()
    data, rnea = weightless.createData(), pin.rnea
    inertia = np.zeros((len(run.time), 6))
    for k, (q, v, a) in enumerate(zip(run.q, run.v, run.a, strict=True)):
        rnea(weightless, data, q, v, a)
        inertia[k] = data.f[1].vector
    twist, rise = np.zeros((2, len(run.time), 6))
    twist[:, plant.axes], rise[:, plant.axes] = (x[:, : plant.axes.size] for x in (run.v, run.a))
    inertia[:, :3] += body["mass_extra"] * (rise[:, :3] + np.cross(twist[:, 3:], twist[:, :3]))
    gravity, down = _weight(plant, run.q)
    gravity[:, :3] -= body["weight_extra"] * down
    return inertia, gravity


def _weight(plant: Plant, poses: Array) -> tuple[Array, Array]:
    """Weight (n, 6) of the Inertias at B in platen axes, and the vertical (n, 3) in platen axes, at poses (n, nq)."""
    model, data = plant.model, plant.model.createData()
    zero = np.zeros(model.nv)
    weight, down = np.zeros((len(poses), 6)), np.zeros((len(poses), 3))
    if plant.model.nv != 6:
        for k, q in enumerate(poses):
            pin.rnea(model, data, q, zero, zero)
            weight[k], down[k] = -data.f[1].vector, data.liMi[1].rotation[2]
        return weight, down
    # one rigid body: its weight is linear in the direction of the vertical, which is the last row of s_R_b
    x, y, z, w = poses[:, 3:7].T
    down = np.stack([2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)], axis=1)
    fall = np.zeros((6, 3))
    fall[:3] = -plant.machine.platen.gravity * np.eye(3)
    return down @ (model.inertias[1].matrix() @ fall).T, down


def _at_c(turn: Array, plant: Plant, wrench: Array) -> Array:
    """Wrench (n, 6) at C in {c} from that at B in platen axes; turn (n, 3, 3) is s_R_b (Eqs. 4-20 to 4-22)."""
    force = wrench[:, :3]
    moment = wrench[:, 3:] - np.cross(plant.body[0]["rho_c"], force)
    return np.hstack([np.einsum("nij,nj->ni", turn, x) for x in (force, moment)])
