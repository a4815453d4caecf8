"""Modes of a specimen on a platen that is held fast: frequency, damping, and the mass that each moves by axis."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import eigh

from ..core.arrays import Array
from .equilibrium import find_equilibrium
from .linearize import LinearPlant, linearize
from .plant import Plant

__all__ = ["SpecimenMode", "specimen_growth", "specimen_modes"]


class SpecimenMode(NamedTuple):
    """An oscillation of the specimen, the platen held fast."""

    frequency: float  # undamped [Hz]
    damping: float  # ratio [1]
    mass: Array  # (6,) effective modal mass or inertia along x y z roll pitch yaw at B [kg, kg m2]


def specimen_modes(plant: Plant, linear: LinearPlant | None = None) -> tuple[SpecimenMode, ...]:
    """Modes of a specimen about rest, slowest first: those it states and those of its free joints; none if rigid.

    Of joints, stiffness, damping and mass are those of the linearised plant, whose joint forces are M times its
    accelerations (`linear`: of `linearize` at rest, if known); damping by the diagonal of the modal damping matrix.
    Coordinates that nothing returns (zero or negative stiffness) are left out. The effective mass of mode phi along
    axis k is (phi' M_jk)^2 / phi' M_jj phi; of stated modes, which are mass-normalised, the square of their
    participation.
    """
    return tuple(sorted([*_stated_modes(plant), *_joint_modes(plant, linear)], key=lambda mode: mode.frequency))


def _stated_modes(plant: Plant) -> list[SpecimenMode]:
    """Modes that a specimen states itself, or by its matrices."""
    omega = np.sqrt(plant.modes["stiffness"])
    rows = zip(omega, plant.modes["damping"], plant.modes["participation"], strict=True)
    return [SpecimenMode(float(w / (2.0 * np.pi)), float(d / (2.0 * w)), np.square(part)) for w, d, part in rows]


def _joint_modes(plant: Plant, linear: LinearPlant | None) -> list[SpecimenMode]:
    """Modes of the free joints of a specimen about rest."""
    if not plant.articulated:
        return []
    mass, stiffness, damping = _joint_matrices(plant, linear)
    platen = plant.axes.size
    own = mass[platen:, platen:]
    squares, shapes = eigh(0.5 * (stiffness + stiffness.T), own)  # shapes' M shapes = 1
    found, smallest = [], 1e-9 * float(np.abs(squares).max())
    for square, shape in zip(squares, shapes.T, strict=True):
        if square <= smallest:
            continue
        omega, moved = float(np.sqrt(square)), np.zeros(6)
        moved[plant.axes] = np.square(shape @ mass[platen:, :platen])
        found.append(SpecimenMode(omega / (2.0 * np.pi), float(shape @ damping @ shape) / (2.0 * omega), moved))
    return found


def specimen_growth(plant: Plant) -> float:
    """Rate [1/s] of the fastest growing motion of a specimen's free joints, the platen held fast; negative: all decay.

    Minus infinity for a specimen without free joints.
    """
    if not plant.articulated:
        return -np.inf
    mass, stiffness, damping = _joint_matrices(plant)
    own, n = mass[plant.axes.size :, plant.axes.size :], len(stiffness)
    rates = np.linalg.solve(own, np.hstack([-stiffness, -damping]))
    return float(np.linalg.eigvals(np.vstack([np.eye(n, 2 * n, n), rates])).real.max())


def _joint_matrices(plant: Plant, linear: LinearPlant | None = None) -> tuple[Array, Array, Array]:
    """Mass matrix (nv, nv) at rest, and stiffness and damping (n, n) of the free joints, the platen held fast."""
    platen, nv = plant.axes.size, plant.model.nv
    rest = find_equilibrium(plant)
    linear = linearize(plant, rest.state, rest.spool) if linear is None else linear
    mass = np.triu(pin.crba(plant.model, plant.model.createData(), rest.state.q))
    mass += np.triu(mass, 1).T
    force = mass @ linear.A[nv : 2 * nv]
    return mass, -force[platen:, platen:nv], -force[platen:, nv + platen : 2 * nv]
