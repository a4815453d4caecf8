"""The wrench at the interface of a specimen and the platen: base shear, axial force, overturning moment, torsion.

    wrench = at_interface(plant, specimen_wrenches(plant, run.q, run.v, run.a))    # (n, 6), on the platen
    force = interface_force(plant, q, v, a)                                        # pin.Force at one instant

The interface is the point of the platen's top where the specimen's root is mounted, with the axes of the platen. The
specimen is what the Pinocchio model has beyond the bare table's: the force that RNEA of the model without the platen's
own inertia transmits through the platen's joint is that of the platen on the specimen. Its weight is included.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..core.arrays import Array
from .derivatives import rates_at
from .plant import Plant, make_plant
from .pose import PlantMotion
from .rigid_body import make_model
from .schemes import TAU, V_SEEN
from .workspace import make_workspace

__all__ = ["INTERFACE_AXES", "at_interface", "bare", "driven_specimen", "from_interface", "interface_force"]
__all__ += ["interface_lever", "specimen_wrenches", "wrenches_at_b"]

_HEAVY = 1e15
"""Inertia [kg, kg m2] of a platen whose acceleration no specimen changes by more than rounding."""

_REACH = 0.5
"""Largest step times rate of Runge-Kutta 4: its error is (rate step)^5 / 120 of the amplitude, 3e-4 a radian."""

INTERFACE_AXES = ("fx", "fy", "fz", "mx", "my", "mz")
"""Base shear in x and y, axial force, overturning moments about x and y, torsion."""


def bare(plant: Plant) -> Plant:
    """The plant without its specimen."""
    return plant if plant.machine.specimen is None else make_plant(replace(plant.machine, specimen=None))


def interface_lever(plant: Plant) -> Array:
    """Position (3,) of the interface from B, platen axes [m]; of C where no specimen is mounted."""
    specimen = plant.machine.specimen
    place = np.zeros(3) if specimen is None else np.array(specimen.position, float)
    return np.asarray(plant.body[0]["rho_c"] + place)


def at_interface(plant: Plant, wrench: Array) -> Array:
    """Wrenches (n, 6) at the interface of those at B, both in platen axes [N, N m]."""
    out = wrench.copy()
    out[:, 3:] -= np.cross(interface_lever(plant), wrench[:, :3])
    return out


def from_interface(plant: Plant, wrench: Array) -> Array:
    """Wrenches (n, 6) at B of those at the interface, both in platen axes [N, N m]. Inverse of `at_interface`."""
    out = wrench.copy()
    out[:, 3:] += np.cross(interface_lever(plant), wrench[:, :3])
    return out


def wrenches_at_b(plant: Plant, turn: Array, wrench: Array) -> Array:
    """Wrenches (n, 6) at B in platen axes of those at C in {c}; turn (n, 3, 3) is s_R_b. Inverse of `wrenches_at_c`."""
    force, moment = (np.einsum("nji,nj->ni", turn, x) for x in (wrench[:, :3], wrench[:, 3:]))
    return np.hstack([force, moment + np.cross(plant.body[0]["rho_c"], force)])


def specimen_wrenches(plant: Plant, q: Array, v: Array, a: Array) -> Array:
    """Wrenches (n, 6) of the specimen on the platen at B in platen axes, from a plant's q, v, a; zero without one."""
    out = np.zeros((len(q), 6))
    if plant.machine.specimen is None:
        return out
    model = _without_platen(plant)
    data = model.createData()
    for k, state in enumerate(zip(q, v, a, strict=True)):
        pin.rnea(model, data, *state)
        out[k] = -data.f[1].vector
    return out


def _without_platen(plant: Plant) -> Any:
    """The plant's model with no inertia of the platen itself."""
    model, own = plant.model.copy(), make_model(replace(plant.machine, specimen=None)).inertias[1]
    left = model.inertias[1].toDynamicParameters() - own.toDynamicParameters()
    model.inertias[1] = pin.Inertia.FromDynamicParameters(left) if left[0] > 0.0 else pin.Inertia.Zero()
    return model


def interface_force(plant: Plant, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> pin.Force:
    """Force of the specimen on the platen at one instant, at the interface in platen axes."""
    rows = (np.asarray(x, float)[None] for x in (q, v, a))
    return pin.Force(at_interface(plant, specimen_wrenches(plant, *rows))[0])


def driven_specimen(plant: Plant, motion: PlantMotion, dt: float) -> PlantMotion:
    """Motion (n, nq), (n, nv), (n, nv) of a plant whose platen is prescribed: its specimen's joints respond from rest.

    By ABA of a platen too heavy for the joints to move, with the force that gives it the prescribed acceleration; the
    joints have their own stiffness and damping. Runge-Kutta 4 with steps of dt [s], or a whole part of it where the
    joints' fastest rate requires it; the platen's motion between samples by linear interpolation. A rigid specimen has
    no joints: the motion is returned as it is.
    """
    platen = plant.axes.size
    if plant.model.nv == platen:
        return motion
    model = plant.model.copy()
    model.armature[:platen] = _HEAVY
    data, ws = model.createData(), make_workspace(plant, plant.zero_state())
    z, spool, own = plant.zero_state().z, np.zeros(plant.spools), int(model.nqs[1])

    def acceleration(q: Array, v: Array, a: Array) -> Array:
        """Acceleration (nv - platen,) of the joints."""
        ws.motion[V_SEEN] = v
        rates_at(plant, ws, q, z, spool)
        ws.motion[TAU, :platen] = _HEAVY * a
        return np.asarray(pin.aba(model, data, q, v, ws.motion[TAU])[platen:])

    substeps = max(1, int(np.ceil(dt * _fastest(model, motion.q[0], acceleration) / _REACH)))
    h, n = dt / substeps, len(motion.q)
    out = PlantMotion(np.tile(pin.neutral(model), (n, 1)), *np.zeros((2, n, model.nv)))
    q, v = out.q[0].copy(), np.zeros(model.nv)
    for k in range(n):
        q[:own], v[:platen] = motion.q[k], motion.v[k]
        out.q[k], out.v[k], out.a[k, :platen] = q, v, motion.a[k]
        out.a[k, platen:] = acceleration(q, v, motion.a[k])
        if k == n - 1:
            break
        at = [_between(motion, k, i / (2.0 * substeps), dt) for i in range(2 * substeps + 1)]
        for i in range(substeps):
            q, v = _joint_step(model, at[2 * i : 2 * i + 3], q, v, h, acceleration)
    return out


def _fastest(model: Any, start: Array, acceleration: Callable[[Array, Array, Array], Array]) -> float:
    """Fastest rate [1/s] of the joints about rest, the platen held: of their undamped modes, or of their damping."""
    platen, nv, small = model.nvs[1], model.nv, 1e-6
    q = pin.neutral(model)
    q[: len(start)] = start
    still, columns = np.zeros(nv), []
    for k in range(platen, nv):
        step = np.zeros(nv)
        step[k] = small
        for moved in ((pin.integrate(model, q, step), still), (q, step)):
            columns.append((acceleration(*moved, still[:platen]) - acceleration(q, still, still[:platen])) / small)
    stiffness, damping = (np.abs(np.linalg.eigvals(np.array(columns[i::2]))).max() for i in (0, 1))
    return float(max(np.sqrt(stiffness), damping))


def _joint_step(
    model: Any, at: list[PlantMotion], q: Array, v: Array, h: float, acceleration: Any
) -> tuple[Array, Array]:
    """One step of Runge-Kutta 4 of the joints; `at` is the platen's motion at its start, middle and end."""
    platen, own = len(at[0].v), len(at[0].q)
    rates: list[Array] = []
    turns: list[Array] = []
    for reach, place in ((0.0, at[0]), (0.5, at[1]), (0.5, at[1]), (1.0, at[2])):
        local, seen = np.zeros(model.nv), v.copy()
        if rates:
            local[platen:], seen[platen:] = reach * h * turns[-1], v[platen:] + reach * h * rates[-1]
        moved = pin.integrate(model, q, local)
        moved[:own], seen[:platen] = place.q, place.v
        rates.append(acceleration(moved, seen, place.a))
        turns.append(seen[platen:])
    local = np.zeros(model.nv)
    local[platen:] = h / 6.0 * (turns[0] + 2.0 * turns[1] + 2.0 * turns[2] + turns[3])
    seen = v.copy()
    seen[platen:] += h / 6.0 * (rates[0] + 2.0 * rates[1] + 2.0 * rates[2] + rates[3])
    return pin.integrate(model, q, local), seen


def _between(motion: PlantMotion, k: int, share: float, dt: float) -> PlantMotion:
    """Motion of the platen between samples k and k + 1, one row; linear in q, v and a."""
    q, v, a = ((1.0 - share) * x[k] + share * x[k + 1] for x in motion)
    if len(q) == 7:
        q[3:] /= np.linalg.norm(q[3:])
    return PlantMotion(q, v, a)
