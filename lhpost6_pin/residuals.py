"""Residuals: where a model and a measured test disagree, equation by equation.

    wrench   required less measured actuator wrench on the platen at C in {c} [N, N m]      (Eqs. 4-24 to 4-26)
    flow     L A / beta dP/dt + A dL/dt - Q, per chamber [m3/s]                              (Eqs. 4-2 to 4-5)
    gas      ln P/P_0 + n ln(1 + dL/L_c0), per strut [1]                                     (Eq. 4-7)
    force    measured actuator force less P_A A_1 - P_B A_2 [N]                              (Eq. 4-6)

All are zero where the model is right and sensors are perfect. The laws are those of the simulation, called by the same
tables; accelerations come from the fused engine's forward dynamics, whose oracle is Pinocchio.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .alignment import gas_pressure, oil_force
from .compiled import compiled
from .engine_fused import inertia_table, platen_acceleration
from .equilibrium import hydraulic_rows
from .inverse_dynamics import march_states
from .law_table import BOUC_WEN_1D, BOUC_WEN_2D, HYDRAULIC_DOUBLE
from .laws.chamber import chamber_rate, flows_double, flows_single
from .laws.orifice import opening
from .ledger import add_at_c
from .plant import Plant
from .pose import PlantMotion, PlatenMotion, plant_motion
from .records import require, sample_interval
from .rigid_body import platen_inertia
from .schemes import SD, TAU, V_SEEN, S, forces_stage, pose_stage
from .signals import differentiate
from .workspace import make_workspace

__all__ = ["RESIDUALS", "Measured", "Path", "Residuals", "evaluate_residuals", "follow", "make_measured", "path_key"]

Array = NDArray[np.float64]

RESIDUALS = ("wrench", "flow", "gas", "force")
"""Kinds of residuals."""


@dataclass(frozen=True)
class Measured:
    """A measured test made ready for residuals; n samples. What was not measured is None."""

    name: str
    dt: float  # [s]
    motion: PlatenMotion  # of C and Euler angles
    actuator_force: Array | None  # (n, n_actuators) [N]
    pressure: Array | None  # (n, n_chambers): A of every actuator, then B of the double-acting [Pa]
    pressure_rate: Array | None  # [Pa/s]
    strut_pressure: Array | None  # (n, n_struts) [Pa]
    spool: Array | None  # (n, n_actuators) at the samples' instants [1]
    path: Array | None = None  # (n, 6) displacement that friction follows, where it is not the motion's
    share: Mapping[str, PlatenMotion] = field(default_factory=dict)  # of each platen channel in the motion

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.motion.displacement)


class Residuals(NamedTuple):
    """Residuals of one test; n samples, no columns where something was not measured."""

    wrench: Array  # (n, 6)
    flow: Array  # (n, n_chambers)
    gas: Array  # (n, n_struts)
    force: Array  # (n, n_actuators)

    def stacked(self) -> Array:
        """All columns side by side (n, k)."""
        return np.hstack(self)


def make_measured(record: xr.Dataset, motion: PlatenMotion, cutoff: float, *, path: Array | None = None) -> Measured:
    """Make a record ready, with the platen motion found from it; pressures are differentiated up to `cutoff` [Hz].

    path (n, 6) is the displacement that friction follows, where it is not the motion's.

    Raises RecordError if neither forces nor pressures were measured.
    """
    dt = sample_interval(record)

    def values(name: str) -> Array | None:
        return np.ascontiguousarray(record[name].values, float) if name in record else None

    pressure_a, pressure_b = values("chamber_pressure_a"), values("chamber_pressure_b")
    pressure = pressure_a if pressure_a is None or pressure_b is None else np.hstack([pressure_a, pressure_b])
    force = values("actuator_force")
    if force is None and pressure is None:
        require(record, "actuator_force")
    return Measured(
        name=str(record.attrs.get("test", "test")),
        dt=dt,
        motion=motion,
        actuator_force=force,
        pressure=pressure,
        pressure_rate=None if pressure is None else differentiate(pressure, dt, cutoff),
        strut_pressure=values("strut_pressure"),
        spool=values("spool_position"),
        path=path,
    )


class Path(NamedTuple):
    """A test's motion in a plant's coordinates, and the friction states that it leaves behind."""

    motion: PlantMotion
    z: Array  # (n, n_states)


def follow(plant: Plant, test: Measured) -> Path:
    """Path of a test; raises RecordError naming the sample where a leg is out of its stroke."""
    moved = plant_motion(plant, test.motion)
    slid = moved if test.path is None else plant_motion(plant, test.motion._replace(displacement=test.path))
    return Path(PlantMotion(*(np.ascontiguousarray(x) for x in moved)), march_states(plant, slid, test.dt))


def path_key(plant: Plant) -> bytes:
    """What the path of a test depends on: geometry, and yield and shape of friction. Other numbers leave it alone."""
    friction = plant.rows[np.isin(plant.rows["law"], (BOUC_WEN_1D, BOUC_WEN_2D))]["p"][:, 1:3]
    return plant.body.tobytes() + plant.legs.tobytes() + friction.tobytes()


def evaluate_residuals(
    plant: Plant, test: Measured, only: tuple[str, ...] = RESIDUALS, *, path: Path | None = None
) -> Residuals:
    """Residuals of a test with a plant's equations; those not in `only` have no columns.

    path is that of `follow`, if it is known. Raises RecordError naming the sample where a leg is out of its stroke.
    """
    n, machine = test.samples, plant.machine
    moved, z = path or follow(plant, test)
    fed = hydraulic_rows(plant)
    double = np.array([name in machine.double_acting for name in machine.actuator_names])
    force = test.actuator_force
    if test.pressure is not None:
        oil = oil_force(machine, test.pressure[:, : plant.spools], test.pressure[:, plant.spools :])
        force = oil if force is None else force
    wants_flow = "flow" in only and test.pressure is not None and test.spool is not None
    wants_wrench = "wrench" in only and force is not None
    wrench = np.zeros((n, 6 if wants_wrench else 0))
    flow = np.zeros((n, plant.spools + int(double.sum()) if wants_flow else 0))
    length = np.zeros((n, plant.legs.size))
    rest = plant.rows[plant.rows["input"] < 0]
    ws = make_workspace(plant, plant.zero_state())
    _, mass = platen_inertia(plant.model, machine)
    none = np.zeros((1, plant.spools))
    chamber = np.full((plant.spools, 2), -1)
    chamber[:, 0] = np.arange(plant.spools)
    chamber[double, 1] = plant.spools + np.arange(int(double.sum()))
    pressures = (test.pressure, test.pressure_rate, test.spool) if wants_flow else (none, none, none)
    _residuals(
        *moved,
        z,
        force if wants_wrench else none,
        *pressures,
        *(plant.axes, plant.legs, plant.body, plant.rows[fed], rest, np.array(plant.model.damping), plant.supply),
        *(inertia_table(plant), mass, chamber),
        *(ws.frame, ws.port, ws.JB, ws.force, ws.motion, wrench, flow, length),
    )
    gas = np.zeros((n, 0))
    if "gas" in only and test.strut_pressure is not None:
        gas = np.log(test.strut_pressure / gas_pressure(machine, length[:, plant.spools :]))
    told = np.zeros((n, 0))
    if "force" in only and test.pressure is not None and test.actuator_force is not None:
        told = test.actuator_force - oil
    return Residuals(wrench, flow, gas, told)


@compiled
def _residuals(
    q, v, a, z, measured, pressure, pressure_rate, spool, axes, legs, body, fed, rest, damping, supply, inertia, mass,
    chamber, frame, port, JB, force, motion, wrench, flow, length,
):  # fmt: skip
    work = np.zeros((2, 6))
    miss = np.zeros(axes.size)
    left = np.zeros(6)
    for k in range(q.shape[0]):
        motion[V_SEEN] = v[k]
        pose_stage(q[k], axes, legs, body, frame, port, JB)
        forces_stage(axes, legs, body, rest, damping, frame, port, JB, z[k], force, motion)
        length[k] = port[S, : legs.size]
        if wrench.shape[1] > 0:
            for i in range(measured.shape[1]):
                for j in range(axes.size):
                    motion[TAU, j] += JB[1, i, axes[j]] * measured[k, i]
            platen_acceleration(inertia, axes, frame, motion[TAU], work, miss)
            for j in range(axes.size):
                miss[j] = a[k, j] - miss[j]
            left[:] = 0.0
            for i in range(axes.size):
                for j in range(axes.size):
                    left[axes[i]] += mass[axes[i], axes[j]] * miss[j]
            add_at_c(1.0, left.reshape(1, 6), 0, body[0].rho_c, frame, wrench[k])
        if flow.shape[1] > 0:
            for i in range(fed.size):
                row = fed[i]
                p = row.p
                s, sd = port[S, row.port], port[SD, row.port]
                at_a, at_b = chamber[i, 0], chamber[i, 1]
                opened = opening(spool[k, i], p[6])
                pressure_a = pressure[k, at_a]
                if row.law == HYDRAULIC_DOUBLE:
                    pressure_b = pressure[k, at_b]
                    q_a, q_b, _, _ = flows_double(
                        opened, pressure_a, pressure_b, p[2], p[3], p[4], p[5], p[7], supply[0], supply[1], p[11]
                    )
                    rate = chamber_rate(q_b, p[1], -sd, p[9] - s, p[10])
                    flow[k, at_b] = (pressure_rate[k, at_b] - rate) * p[1] * (p[9] - s) / p[10]
                else:
                    q_a, _ = flows_single(opened, pressure_a, p[2], p[4], p[7], supply[0], supply[1], p[11])
                rate = chamber_rate(q_a, p[0], sd, p[8] + s, p[10])
                flow[k, at_a] = (pressure_rate[k, at_a] - rate) * p[0] * (p[8] + s) / p[10]
