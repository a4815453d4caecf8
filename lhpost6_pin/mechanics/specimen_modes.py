"""Modes of a specimen on a platen that is held fast: frequency, damping, and the mass that each moves by axis."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import eigh

from ..core.arrays import Array
from .equilibrium import find_equilibrium
from .linearize import LinearPlant, linearize
from .plant import Plant

__all__ = ["SpecimenMode", "specimen_modes"]


class SpecimenMode(NamedTuple):
    """An oscillation of the specimen's joints, the platen held fast."""

    frequency: float  # undamped [Hz]
    damping: float  # ratio [1]
    mass: Array  # (6,) effective modal mass or inertia along x y z roll pitch yaw at B [kg, kg m2]


def specimen_modes(plant: Plant, linear: LinearPlant | None = None) -> tuple[SpecimenMode, ...]:
    """Modes of the free joints of a specimen about rest, slowest first; none for a rigid specimen.

    Stiffness, damping and mass are those of the linearised plant, whose joint forces are M times its accelerations
    (`linear`: of `linearize` at rest, if known); damping by the diagonal of the modal damping matrix. Coordinates that
    nothing returns (zero or negative stiffness) are left out. The effective mass of mode phi along axis k is
    (phi' M_jk)^2 / phi' M_jj phi.
    """
    platen, nv = plant.axes.size, plant.model.nv
    if nv == platen:
        return ()
    rest = find_equilibrium(plant)
    linear = linearize(plant, rest.state, rest.spool) if linear is None else linear
    mass = np.triu(pin.crba(plant.model, plant.model.createData(), rest.state.q))
    mass += np.triu(mass, 1).T
    force = mass @ linear.A[nv : 2 * nv]
    stiffness, damping = -force[platen:, platen:nv], -force[platen:, nv + platen : 2 * nv]
    own = mass[platen:, platen:]
    squares, shapes = eigh(0.5 * (stiffness + stiffness.T), own)  # shapes' M shapes = 1
    found, smallest = [], 1e-9 * float(np.abs(squares).max())
    for square, shape in zip(squares, shapes.T, strict=True):
        if square <= smallest:
            continue
        omega, moved = float(np.sqrt(square)), np.zeros(6)
        moved[plant.axes] = np.square(shape @ mass[platen:, :platen])
        found.append(SpecimenMode(omega / (2.0 * np.pi), float(shape @ damping @ shape) / (2.0 * omega), moved))
    return tuple(found)
