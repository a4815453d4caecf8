"""The energy audit of a run: inflow, storage, dissipation and delivery of energy, effect by effect.

    audit = energy_audit(run)
    audit.power[:, audit.entry("created.thrust_direction")]   # [W]

Energy, per effect:  inflow = change of stored + dissipated + delivered
and for the platen:  delivered + created = change of kinetic + gravity (+ stored and dissipated in a specimen)

inflow      oil through the valves' orifices, h(P) Q per chamber
stored      compressed oil, nitrogen (laws with a potential); kinetic energy and weight; springs in a specimen's
            joints, and what its modes hold beyond the specimen as a rigid body
dissipated  leakage between chambers, and all work of laws without a potential: seals, pads, viscous
delivered   force times port rate, to the platen
created     three terms of the report's equations that do not conserve energy; zero in a machine with normal thrust,
            equal mass in all directions and no pad friction:
            `thrust_direction`  f (B - J) v of actuators with bearings: the force of Eq. 4-23 is vertical, their
                                velocity (3-27) is power-consistent with the platen's normal
            `directional_mass`  -v . M (omega x v) of Eq. 4-26
            `pad_reaction`      f (B - J) v of pads: slip is relative to the moving platen, but Eq. 4-24 applies
                                part of the force to the ground
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ..core.compiled import compiled
from ..effects.actuator import oil_power
from ..effects.dispatch import power
from ..effects.registry import HYDRAULIC, LAWS
from ..effects.supply import supply_pressures
from ..mechanics.moving_parts import leg_energies
from ..mechanics.ports import platen_pose
from ..mechanics.pose import PlantMotion
from ..mechanics.required_wrench import moving_wrenches
from ..mechanics.schemes import FORCE, SD, V_SEEN, S, forces_stage, pose_stage, set_twist
from .ledger import history_of, number_of
from .simulate import Run
from .specimen_response import modes_of_run, spring_energy, twists_of_run

if TYPE_CHECKING:
    import xarray as xr

from ..core.arrays import Array

__all__ = ["CREATED", "Audit", "energy_audit", "row_power"]

CREATED = ("thrust_direction", "directional_mass", "pad_reaction")
"""Terms of the report's equations that create or destroy energy."""


@dataclass(frozen=True)
class Audit:
    """Energy flows of a run; n samples. Entries are named "kind.name", such as ``dissipated.seal_friction``."""

    time: Array  # (n,) [s]
    entries: tuple[str, ...]  # (k,)
    power: Array  # (n, k) [W]
    energy: Array  # (n, k) since the start [J]: change of a stored entry, else the integral of power

    def entry(self, name: str) -> int:
        """Index of an entry; raises UnknownNameError that lists the names."""
        return number_of("energy entry", name, self.entries)

    def total(self, kind: str, *names: str) -> Array:
        """Energy (n,) [J] of all entries of a kind, or of those named; an absent one counts as zero."""
        split = [entry.split(".") for entry in self.entries]
        wanted = [i for i, (k, name) in enumerate(split) if k == kind and (not names or name in names)]
        return self.energy[:, wanted].sum(axis=1)

    @property
    def residual(self) -> Array:
        """Error of the balance (n,) [J]: inflow + created - stored - dissipated."""
        return self.total("inflow") + self.total("created") - self.total("stored") - self.total("dissipated")

    def effect_residual(self, effect: str) -> Array:
        """Error of the balance of one effect (n,) [J]: inflow - stored - dissipated - delivered."""
        number_of("effect", effect, [e.split(".")[1] for e in self.entries if e.startswith("delivered.")])
        spent = sum(self.total(kind, effect) for kind in ("stored", "dissipated", "delivered"))
        return self.total("inflow", effect) - spent

    def to_dataset(self) -> "xr.Dataset":
        """Lay out as a dataset with dims time, entry; coordinate kind on entry."""
        import xarray as xr

        return xr.Dataset(
            {
                "power": (("time", "entry"), self.power, {"units": "W", "long_name": "power"}),
                "energy": (("time", "entry"), self.energy, {"units": "J", "long_name": "energy since the start"}),
                "residual": ("time", self.residual, {"units": "J", "long_name": "energy not accounted for"}),
            },
            {
                "time": ("time", self.time, {"units": "s"}),
                "entry": list(self.entries),
                "kind": ("entry", [e.split(".")[0] for e in self.entries]),
            },
        )


def energy_audit(run: Run) -> Audit:
    """Inflow, stored, dissipated and delivered energy of each effect, and energy created by the equations.

    Powers are integrated by the trapezoidal rule over recorded samples: record every sample where the residual
    matters. Valve flow jumps with the spool: it is integrated with the mean spool of each interval, which is known in
    closed loop and for spools held over a sample.
    """
    plant = run.plant
    names = [e.name for e in plant.machine.effects]
    n = len(run.time)
    flows = np.zeros((n, len(names), 5))
    created = np.zeros((n, len(CREATED)))
    spool = np.ascontiguousarray(run.spool)  # of the interval after each sample
    before = np.concatenate([spool[:1], spool[:-1]])
    _powers(*history_of(run), (before, spool), flows, created)
    inflow, inflow_before, dissipated, delivered, stored = np.moveaxis(flows, 2, 0)
    dt = 1.0 / run.rate
    found: dict[str, tuple[Array, Array]] = {}  # power and energy by entry

    def add(entry: str, power: Array, energy: Array | None = None, power_before: Array | None = None) -> None:
        if energy is None:  # the power jumps at samples: power_before holds its values before each
            before = power if power_before is None else power_before
            energy = np.concatenate([[0.0], np.cumsum(0.5 * dt * (power[:-1] + before[1:]))])
        found[entry] = power, energy

    laws = [LAWS[e.law] for e in plant.machine.effects]
    for i, (name, law) in enumerate(zip(names, laws, strict=True)):
        if law.takes_spool:
            add(f"inflow.{name}", inflow[:, i], power_before=inflow_before[:, i])
        if law.stores_energy:
            rate = inflow[:, i] - dissipated[:, i] - delivered[:, i]
            add(f"stored.{name}", rate, stored[:, i] - stored[0, i])
        if law.states or not law.stores_energy:
            add(f"dissipated.{name}", dissipated[:, i])
        add(f"delivered.{name}", delivered[:, i])
    for name, rate, energy in zip(("kinetic", "gravity"), *_rigid_energies(run), strict=True):
        add(f"stored.{name}", rate, energy - energy[0])
    if plant.articulated:
        joints = slice(plant.axes.size, None)
        add("dissipated.specimen_joints", run.v[:, joints] ** 2 @ plant.model.damping[joints])
    if plant.springs.size:
        power, energy = spring_energy(run)
        add("stored.specimen_joints", power, energy - energy[0])
    if plant.modes.size:
        modes = modes_of_run(run)
        rate = -modes.dissipation - np.einsum("ij,ij->i", modes.reaction, twists_of_run(run)[0])
        add("stored.specimen_modes", rate, modes.energy - modes.energy[0])
        add("dissipated.specimen_modes", modes.dissipation)
    for i, name in enumerate(CREATED):
        add(f"created.{name}", created[:, i])
    return Audit(run.time, tuple(found), *(np.stack(values, axis=1) for values in zip(*found.values(), strict=True)))


@compiled
def row_power(row, s, z, work, spool, supply):
    """Inflow and dissipated power [W] and stored energy [J] of one row that delivers the power `work` [W]."""
    if row.law == HYDRAULIC:
        high, low = supply_pressures(supply, z)
        return oil_power(row, s[row.port], z, spool[row.spool], high, low)
    dissipated, held = power(row, s, z, work)
    return 0.0, dissipated, held


@compiled
def _powers(q, v, z, tables, ws, spools, flows, created):
    """Fill flows (n, n_effects, 5) and created (n, 3), in the order of CREATED [W].

    spools: positions before and after each sample. Flows: inflow after and before it, dissipated, delivered [W],
    stored [J].
    """
    port, force, rows, JB = ws.port, ws.force, tables.rows, ws.JB
    spool_before, spool = spools
    s, sd = port[S], port[SD]
    for k in range(q.shape[0]):
        ws.motion[V_SEEN] = v[k]
        pose_stage(q[k], tables, ws)
        forces_stage(tables, ws, z[k])
        for i in range(rows.size):
            row = rows[i]
            work = force[i, 0] * sd[row.port]
            if row.port_2 >= 0:
                work += force[i, 1] * sd[row.port_2]
            if row.port_3 >= 0:
                work += force[i, 2] * sd[row.port_3]
            inflow, dissipated, stored = row_power(row, s, z[k], work, spool[k], tables.supply)
            before, _, _ = row_power(row, s, z[k], work, spool_before[k], tables.supply)
            out = flows[k, row.effect]
            out[0] += inflow
            out[1] += before
            out[2] += dissipated
            out[3] += work
            out[4] += stored
        linear, turn = ws.frame[4], ws.frame[5]
        for p in range(s.size):
            apart = JB[1, p] - JB[0, p]
            rate = 0.0
            for j in range(3):
                rate += apart[j] * linear[j] + apart[3 + j] * turn[j]
            created[k, 0 if p < tables.legs.size else 2] += port[FORCE, p] * rate
        for j in range(3):
            i, m = (j + 1) % 3, (j + 2) % 3
            created[k, 1] -= tables.body[0].mass_extra[j] * linear[j] * (turn[i] * linear[m] - turn[m] * linear[i])


def _rigid_energies(run: Run) -> tuple[Array, Array]:
    """Power [W] and energy [J], each (2, n), of platen, moving parts and specimen: kinetic, potential in gravity."""
    plant = run.plant
    model, data = plant.model, plant.model.createData()
    weight = plant.body[0]["weight_extra"]
    power, energy = np.zeros((2, 2, len(run.time)))
    zero = np.zeros(model.nv)
    for k, (q, v, a) in enumerate(zip(run.q, run.v, run.a, strict=True)):
        holding = pin.rnea(model, data, q, zero, zero) @ v
        power[0, k] = pin.rnea(model, data, q, v, a) @ v - holding  # with armature: all of M
        rate = data.liMi[1].rotation @ data.v[1].linear
        power[1, k] = holding + weight * rate[2]
        energy[0, k] = pin.computeKineticEnergy(model, data, q, v)
        energy[1, k] = pin.computePotentialEnergy(model, data, q) + weight * data.liMi[1].translation[2]
    if plant.machine.bodies == "full":
        free, of_bodies = plant.axes, np.zeros((2, len(run.time)))
        _leg_energies(np.ascontiguousarray(run.q), np.ascontiguousarray(run.v), plant.tables, of_bodies)
        inertia, down = moving_wrenches(plant, PlantMotion(run.q, run.v, run.a))
        for k, wrench in enumerate((inertia, -down)):
            power[k] += np.einsum("ij,ij->i", wrench[:, free], run.v[:, : free.size])
        energy += of_bodies
    return power, energy


@compiled
def _leg_energies(q, v, tables, energy):
    """Fill energy (2, n): kinetic and potential, of moving parts that are bodies [J]."""
    frame = np.zeros((8, 3))
    for k in range(q.shape[0]):
        platen_pose(q[k], tables.axes, tables.body, frame)
        set_twist(v[k], tables.axes, frame)
        energy[0, k], energy[1, k] = leg_energies(frame, tables.legs, tables.body, tables.inertia)
