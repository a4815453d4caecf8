"""Moving parts as bodies against their lump on the platen: inertia and weight over the range of motion."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.errors import OutOfRangeError
from ..machine.machine import Machine
from .leg_model import LegModel
from .plant import Plant, make_plant
from .pose import PlantMotion, PlatenMotion, plant_motion, rotation
from .required_wrench import rigid_wrenches, wrenches_at_c
from .rigid_body import lumped_inertia

__all__ = ["KindComparison", "LumpComparison", "compare_with_lump", "effective_inertia", "static_wrench"]


class KindComparison(NamedTuple):
    """Bodies less lump of one kind of component at one pose."""

    inertia: Array  # (6, 6) at B in platen axes, linear first [kg, kg m, kg m2]
    weight: Array  # (6,) at C in {c}: fx fy fz mx my mz [N, N m]


class LumpComparison(NamedTuple):
    """Bodies less lump at one pose."""

    displacement: Array  # (6,) of C and Euler angles [m, rad]
    inertia: Array  # (6, 6) at B in platen axes, linear first [kg, kg m, kg m2]
    mass_share: float  # largest relative difference of the masses along X, Y, Z [1]
    weight: Array  # (6,) at C in {c}: fx fy fz mx my mz [N, N m]
    by_kind: dict[str, KindComparison]  # a kind's lump weighs at its points on the platen, with its vertical mass


def compare_with_lump(machine: Machine, displacement: ArrayLike) -> LumpComparison:
    """Compare a machine's moving parts as bodies with their lump at a displacement (6,) of C and Euler angles [m, rad].

    Raises OutOfRangeError for a platen on guides, ParameterError where the machine's legs cannot be split into bodies.
    """
    if machine.motion != "free":
        raise OutOfRangeError(f"{machine.name}: moving parts are compared on a free platen only")
    at = np.asarray(displacement, float)
    bodies, lump = (make_plant(machine.with_bodies(word)) for word in ("full", "lumped"))
    inertias = [effective_inertia(plant, at) for plant in (bodies, lump)]
    masses = [np.diag(inertia)[:3] for inertia in inertias]
    weights = [static_wrench(plant, at) for plant in (bodies, lump)]
    share = float(np.abs(masses[0] / masses[1] - 1.0).max())
    return LumpComparison(at, inertias[0] - inertias[1], share, weights[0] - weights[1], _by_kind(bodies, at))


def _by_kind(plant: Plant, displacement: Array) -> dict[str, KindComparison]:
    """Contributions of the kinds of components, by Pinocchio's model of the legs."""
    machine, legs = plant.machine, LegModel(plant)
    turn = rotation(displacement[None, 3:])
    q = plant_motion(plant, PlatenMotion(displacement[None], *np.zeros((2, 1, 6)))).q[0]
    mass, force = legs.forces(q, np.zeros(6))
    mass = np.triu(mass) + np.triu(mass, 1).T
    lumps = lumped_inertia((0.0,), (0.0, 0.0, 0.0), machine)
    down = -machine.platen.gravity * turn[0, 2]  # in platen axes
    centre = np.array(machine.platen.centre_of_gravity)
    lumped = {kind: np.zeros(6) for kind in lumps}
    for c in machine.components:
        lever, away = np.array(c.platen_point) - centre, np.subtract(c.platen_point, c.base_point)
        upright = c.mass_across + (c.mass_along - c.mass_across) * away[2] ** 2 / (away @ away)
        lumped[c.kind] += upright * np.concatenate([down, np.cross(lever, down)])
    found = {}
    for kind in dict.fromkeys(c.kind for c in machine.components):
        own = [joint for joint, of_kind in enumerate(legs.kinds) if of_kind == kind]
        rows = legs.jacobian[own]
        weight = wrenches_at_c(plant, turn, (-rows.T @ force[own] - lumped[kind])[None])[0]
        found[kind] = KindComparison(rows.T @ mass[np.ix_(own, own)] @ rows - lumps[kind], weight)
    return found


def effective_inertia(plant: Plant, displacement: Array) -> Array:
    """Inertia (6, 6) at B in platen axes, linear first, of platen, rigid specimen and moving parts."""
    at = np.tile(displacement, (6, 1))
    q = plant_motion(plant, PlatenMotion(at, *np.zeros((2, 6, 6)))).q
    inertia, _ = rigid_wrenches(plant, PlantMotion(q, np.zeros((6, 6)), np.eye(6)), rotation(at[:, 3:]))
    return inertia.T


def static_wrench(plant: Plant, displacement: Array) -> Array:
    """Weight (6,) of all that moves at a displacement, on the platen at C in {c} [N, N m]."""
    motion = plant_motion(plant, PlatenMotion(displacement[None], *np.zeros((2, 1, 6))))
    turn = rotation(displacement[None, 3:])
    return np.asarray(wrenches_at_c(plant, turn, rigid_wrenches(plant, motion, turn)[1])[0])
