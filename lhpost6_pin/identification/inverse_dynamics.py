"""Inverse dynamics: from a measured motion to the forces behind it (report, Section 6.1).

    found = inverse_dynamics(plant, time, motion, actuator_force, strut_pressure)
    found.residual                          # (n, 6) [N, N m] required less measured actuator wrench, at C in {c}

From the motion of C and the Euler angles follow the platen's twist and its rate in {b} (Eqs. 3-11, 3-18), and with them
inertia (Eq. 4-26), weight, struts (Eq. 4-8), friction and viscous forces (Eqs. 4-9 to 4-19). The rest of the inertia
is the required actuator wrench, compared with the measured one.

Hidden friction states are marched along the motion by the simulation's own step rule, `evaluate.advance_states`: the
residual of a noise-free run recorded at every model step is rounding, free of integration errors.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arrays import Array
from ..core.compiled import compiled
from ..core.errors import SimulationError
from ..effects.evaluate import advance_states
from ..effects.registry import LAWS, actuator_rows
from ..mechanics.plant import Plant
from ..mechanics.port_path import PortPath, ports_along
from ..mechanics.pose import PlatenMotion, kinematic_jacobian, plant_motion
from ..mechanics.required_wrench import floor_wrench, required_wrench, wrenches_at_c
from ..mechanics.schemes import pose_stage
from ..mechanics.workspace import make_workspace
from ..simulation.ledger import Ledger, States, add_at_c, force_ledger
from ..simulation.specimen_response import driven_wrenches
from .residual_kernels import wrench_residual

LOAD_ROUNDS, LOAD_ROUNDING = 20, 1e-12
"""Rounds at most in which loads and the friction under them are found, and the relative change that ends them."""

BASE_SHEAR, SPECIMEN = "base_shear", "specimen"
"""Names in the ledger of the wrenches that a specimen's floors, as measured, and a mounted specimen exert."""

__all__ = ["BASE_SHEAR", "SPECIMEN", "Decomposition", "inverse_dynamics", "leg_wrenches", "march_states", "with_loads"]


@dataclass(frozen=True)
class Decomposition:
    """Forces behind a motion; n samples, wrenches on the platen at C in {c}: fx fy fz mx my mz [N, N m]."""

    states: States
    ledger: Ledger  # of the model's effects; actuators are zero, since their forces are measured
    component: tuple[str, ...]  # (k,) components whose force was measured: actuators, then struts
    component_force: Array  # (n, k) measured force along each [N], positive where it lengthens it
    component_wrench: Array  # (n, k, 6) the same on the platen
    actuators: int  # how many of the components are actuators

    @property
    def required(self) -> Array:
        """Required actuator wrench (n, 6): inertia less all other effects of the model."""
        return self.ledger.residual

    @property
    def measured(self) -> Array:
        """Measured actuator wrench (n, 6)."""
        return np.asarray(self.component_wrench[:, : self.actuators].sum(axis=1))

    @property
    def residual(self) -> Array:
        """Required less measured actuator wrench (n, 6): what the model does not explain."""
        return self.required - self.measured

    @property
    def carried(self) -> Array:
        """Wrench (n, 6) on the platen of what it carries: the residual without the model's, or the floors', part."""
        return self.residual + self._of([BASE_SHEAR, SPECIMEN])

    @property
    def struts(self) -> Array:
        """Wrench of the struts (n, 6), of the model (Eq. 4-8), with effects on their gas."""
        return self._of(e.name for e in self.states.plant.machine.effects if LAWS[e.law].acts_on_gas)

    @property
    def struts_measured(self) -> Array | None:
        """Wrench of the struts (n, 6) from their measured pressures; None where there are none."""
        if len(self.component) == self.actuators:
            return None
        return np.asarray(self.component_wrench[:, self.actuators :].sum(axis=1))

    @property
    def dissipative(self) -> Array:
        """Friction and viscous wrench of the model (n, 6), with all effects but those of oil and gas."""
        effects = self.states.plant.machine.effects
        return self._of(e.name for e in effects if not (LAWS[e.law].acts_on_gas or LAWS[e.law].takes_spool))

    @property
    def dissipative_measured(self) -> Array:
        """The same from measured forces: inertia less weight, load, actuators, struts (modelled, if not measured)."""
        struts = self.struts if self.struts_measured is None else self.struts_measured
        return self.ledger.inertia - self._of(["gravity", BASE_SHEAR, SPECIMEN]) - self.measured - struts

    def _of(self, effects: Iterable[str]) -> Array:
        """Sum of the wrenches (n, 6) of those effects that make a force."""
        columns = [self.ledger.effect(effect) for effect in effects if effect in self.ledger.effects]
        return np.asarray(self.ledger.wrench[:, columns].sum(axis=1))


def inverse_dynamics(
    plant: Plant,
    time: ArrayLike,
    motion: PlatenMotion,
    actuator_force: ArrayLike,
    strut_pressure: ArrayLike | None = None,
    *,
    floor_acceleration: ArrayLike | None = None,
    mounted: Plant | None = None,
    path: Array | None = None,
    start: Array | None = None,
    model_step: bool = False,
) -> Decomposition:
    """Forces behind a motion of C and Euler angles.

    time (n,) uniform [s]; actuator_force (n, n_actuators) [N]; strut_pressure (n, n_struts) [Pa] or None. path (n, 6)
    is the displacement that friction follows, where it is not the motion's (`FusedMotion.path`). start (n_states,) are
    friction's states at the start, by default zero. floor_acceleration
    (n, n_floors) [m/s2] are those measured on a specimen's floors: their base shear is the effect `base_shear` of the
    ledger. mounted is the plant with a specimen, where `plant` is without: the wrench on the platen of that specimen,
    its joints and modes driven by the motion (`driven_wrenches`), is the effect `specimen` of the ledger. model_step:
    the samples are steps of a semi-implicit run, whose forces see the last step's velocity (`schemes.staggered_stage`).
    Raises RecordError naming the sample where a leg is out of its stroke, SimulationError for a specimen with joints.
    """
    if plant.flexible:
        raise SimulationError(
            "inverse dynamics takes a platen with a rigid specimen at most: the motion of its joints or modes is not "
            "measured; lock them (--locked)"
        )
    t = np.asarray(time, float)
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    moved = plant_motion(plant, motion)
    along = moved if path is None else plant_motion(plant, motion._replace(displacement=path))
    z = march_states(plant, ports_along(plant, along), dt, start)
    v = np.vstack([moved.v[:1], moved.v[:-1] + dt * moved.a[:-1]]) if model_step else moved.v
    states = States(plant, t, moved.q, v, moved.a, z)
    measured = [np.asarray(actuator_force, float)]
    names = list(plant.machine.actuator_names)
    if strut_pressure is not None:
        areas = np.array([s.area for s in plant.machine.struts])
        measured.append(-areas * np.asarray(strut_pressure, float))
        names += plant.machine.strut_names
    force = np.hstack(measured)
    wrench = leg_wrenches(plant, moved.q, force)
    seen = moved._replace(v=v)
    ports = ports_along(plant, seen)
    required = required_wrench(plant, seen, ports.turn)
    carried: dict[str, Array] = {}  # wrenches on the platen at B in platen axes
    if floor_acceleration is not None:
        carried[BASE_SHEAR] = -floor_wrench(plant, np.asarray(floor_acceleration, float))
    if mounted is not None:
        carried[SPECIMEN] = driven_wrenches(mounted, seen, dt, model_step=model_step)
    for load in carried.values():
        required[:, plant.axes] -= load[:, plant.axes]
    loaded = with_loads(plant, ports, required, z, measured[0])
    ledger = _without_oil(force_ledger(states._replace(z=loaded)), plant)
    for name, load in carried.items():
        on_platen = wrenches_at_c(plant, ports.turn, load)[:, None]
        ledger = replace(ledger, effects=(*ledger.effects, name), wrench=np.hstack([ledger.wrench, on_platen]))
    return Decomposition(states, ledger, tuple(names), force, wrench, plant.spools)


def with_loads(plant: Plant, ports: PortPath, required: Array, z: Array, measured: Array) -> Array:
    """Hidden states (n, n_states) with the actuators' loads, for friction under load.

    The load is the model's: of the measured forces (n, n_actuators) [N] only those count that cancel in the platen's
    balance. The rest is what the motion requires (`required`, (n, 6) at B) beyond all other laws, so that no friction
    under load explains the force that it was computed from. Each load is set as pressure in chamber A, with none in B.
    Without such friction z is returned as it is.
    """
    if not plant.feels_load:
        return z
    shares = np.linalg.pinv(kinematic_jacobian(plant)[:, plant.axes])
    states, areas = plant.rows["state"][actuator_rows(plant.rows)], plant.actuators.area_a
    out, loads = z.copy(), np.zeros_like(measured)
    for _ in range(LOAD_ROUNDS):  # friction is a small share of its load
        before, lacking = loads, wrench_residual(plant, ports, required, out, measured)[:, plant.axes]
        loads = measured + lacking @ shares
        out[:, states] = loads / areas
        if np.abs(loads - before).max() <= LOAD_ROUNDING * np.abs(loads).max():
            break
    return out


def _without_oil(ledger: Ledger, plant: Plant) -> Ledger:
    """The ledger with actuators' forces zero."""
    oil = [e.name for e in plant.machine.effects if LAWS[e.law].takes_spool]
    force, wrench = ledger.force.copy(), ledger.wrench.copy()
    force[:, [row.split(".")[0] in oil for row in ledger.rows]] = 0.0
    wrench[:, [effect in oil for effect in ledger.effects]] = 0.0
    return replace(ledger, force=force, wrench=wrench)


def march_states(
    plant: Plant,
    ports: PortPath,
    dt: float,
    start: Array | None = None,
    *,
    spool: Array | None = None,
    rows: NDArray[np.void] | None = None,
) -> Array:
    """Hidden states (n, n_states) along a path of the ports, from `start` (n_states,) or all zero, one step a sample.

    Friction states only, or those of some rows of the plant's alone; with spool (n - 1 or more, n_actuators), the mean
    over each step, chamber pressures as well.
    """
    moved = plant.rows if rows is None else rows
    if spool is None:
        moved = moved[moved["spool"] < 0]
        spool = np.zeros((1, plant.spools))
    z = np.zeros((len(ports.s), len(plant.states)))
    if start is not None:
        z[0] = start
    _march(np.ascontiguousarray(moved), ports.s, ports.slip, dt, np.ascontiguousarray(spool, float), plant.supply, z)
    return z


@compiled
def _march(rows, s, slip, dt, spool, supply, z):
    """Fill z from its first row."""
    last = spool.shape[0] - 1
    for k in range(1, s.shape[0]):
        z[k] = z[k - 1]
        advance_states(rows, s[k - 1], slip[k], dt, spool[min(k - 1, last)], supply, z[k])


def leg_wrenches(plant: Plant, q: Array, force: Array) -> Array:
    """Wrenches (n, k, 6) on the platen at C in {c} of forces (n, k) [N] along the first k legs at poses q (n, nq)."""
    out = np.zeros((*force.shape, 6))
    ws = make_workspace(plant, plant.zero_state())
    _leg_wrenches(np.ascontiguousarray(q), np.ascontiguousarray(force), plant.tables, ws, out)
    return out


@compiled
def _leg_wrenches(q, force, tables, ws, out):
    rho = tables.body[0].rho_c
    for k in range(q.shape[0]):
        pose_stage(q[k], tables, ws)
        for i in range(force.shape[1]):
            add_at_c(force[k, i], ws.JB[1], i, rho, ws.frame, out[k, i])
