"""A plant with what it carries as one rigid body: joints of a specimen locked, or a rigid payload at C."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from .plant import Plant
from .specimen_mount import base_placement

__all__ = ["lock_joints", "with_payload"]


def lock_joints(plant: Plant) -> Plant:
    """Plant with the joints of its specimen locked at neutral: its inertia is that of one rigid body.

    A specimen that is a program states its rigidly attached part alone: what it weighs beyond it is a point mass at the
    height of its base, since how high that stands is not known.
    """
    if plant.coupled is not None:
        return _lumped(plant)
    if not plant.articulated:
        return plant
    joints = list(range(2, plant.model.njoints))
    return replace(plant, model=pin.buildReducedModel(plant.model, joints, pin.neutral(plant.model)))


def _lumped(plant: Plant) -> Plant:
    """Plant with the weight of a coupled specimen beyond its rigid part as a mass where it acts in plan."""
    load, model = plant.rest_external, plant.model.copy()
    weight = -float(load[2])
    if weight > 0.0:
        at = np.array([load[4] / weight, -load[3] / weight, base_placement(plant.machine).translation[2]])
        mass = weight / plant.machine.platen.gravity
        model.appendBodyToJoint(1, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), pin.SE3(np.eye(3), at))
    return replace(plant, model=model, coupled=None)


def with_payload(plant: Plant, weight: float) -> Plant:
    """Plant with a rigid payload of a weight [N], concentrated in C: the centred payload of Table 2.2."""
    model = plant.model.copy()
    top = pin.SE3(np.eye(3), plant.body[0]["rho_c"])
    mass = weight / plant.machine.platen.gravity
    model.appendBodyToJoint(1, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), top)
    return replace(plant, model=model)
