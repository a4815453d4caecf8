"""The platen's side of an interface: motion of a base on it, and its apparent mass there."""

import numpy as np
import pinocchio as pin

from ..core.arrays import Array
from .coupled import BaseMotion
from .plant import Plant
from .rigid_body import platen_inertia
from .schemes import A, V
from .workspace import Workspace

__all__ = ["apparent_mass", "base_motion", "mass_at_b"]


def base_motion(plant: Plant, ws: Workspace, placement: pin.SE3) -> BaseMotion:
    """Motion of a base placed in {b}, from pose, V and A of a workspace."""
    axes, v = plant.axes, np.zeros((2, 6))
    v[0, axes], v[1, axes] = ws.motion[V][: axes.size], ws.motion[A][: axes.size]
    if plant.machine.motion == "free":
        pose = pin.XYZQUATToSE3(ws.q[:7])
    else:
        moved = np.zeros(6)
        moved[axes] = ws.q[: axes.size]
        pose = pin.SE3(np.eye(3), np.array(plant.machine.platen.centre_of_gravity) + moved[:3])
    twist = placement.actInv(pin.Motion(v[0]))
    spatial = placement.actInv(pin.Motion(v[1]))
    classical = pin.Motion(pin.classicAcceleration(twist, spatial), spatial.angular)
    return BaseMotion(pose * placement, twist, classical)


def mass_at_b(placement: pin.SE3, mass: Array) -> Array:
    """Mass matrix (6, 6) of a base, linear first, at B in platen axes; placement of the base in {b}."""
    to_base = placement.inverse().action
    return np.asarray(to_base.T @ mass @ to_base)


def apparent_mass(plant: Plant) -> Array:
    """Mass matrix (6, 6) of the platen with all that is rigidly attached, at B in platen axes."""
    return platen_inertia(plant.model, plant.machine)[1]
