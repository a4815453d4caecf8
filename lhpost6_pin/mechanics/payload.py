"""A plant with what it carries as one rigid body: joints of a specimen locked, or a rigid payload at C."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from .plant import Plant

__all__ = ["lock_joints", "with_payload"]


def lock_joints(plant: Plant) -> Plant:
    """Plant with the joints of its specimen locked at neutral: its inertia is that of one rigid body."""
    if not plant.articulated:
        return plant
    joints = list(range(2, plant.model.njoints))
    return replace(plant, model=pin.buildReducedModel(plant.model, joints, pin.neutral(plant.model)))


def with_payload(plant: Plant, weight: float) -> Plant:
    """Plant with a rigid payload of a weight [N], concentrated in C: the centred payload of Table 2.2."""
    model = plant.model.copy()
    top = pin.SE3(np.eye(3), plant.body[0]["rho_c"])
    mass = weight / plant.machine.platen.gravity
    model.appendBodyToJoint(1, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), top)
    return replace(plant, model=model)
