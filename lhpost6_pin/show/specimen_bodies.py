"""A specimen's URDF in Pinocchio: shapes to draw, and where they are on the platen."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..machine.machine import Machine
from .bodies import body_poses

__all__ = ["SpecimenBodies", "SpecimenShape", "load_specimen_bodies", "specimen_poses"]

Array = NDArray[np.float64]


class UniformBox(NamedTuple):
    """Box by half its edges, as Pinocchio's own boxes say it."""

    halfSide: Array


class SpecimenShape(NamedTuple):
    """A primitive that moves with a joint of the specimen; joint 0 stands on the platen."""

    name: str
    joint: int
    geometry: Any  # with halfSide, with halfLength and radius, or with radius alone
    placement: Any  # pin.SE3 on the joint


class SpecimenBodies(NamedTuple):
    """A machine's specimen to draw."""

    model: Any  # pin.Model of the URDF alone
    shapes: Sequence[SpecimenShape]
    root: Any  # pin.SE3 of its root in the platen's {b}


def load_specimen_bodies(machine: Machine) -> SpecimenBodies | None:
    """Read the specimen's URDF with Pinocchio; None without one.

    A body is drawn by its boxes, cylinders and spheres; one without any of these as the uniform box that has its mass
    and inertia.
    """
    specimen = machine.specimen
    if specimen is None:
        return None
    model = pin.buildModelFromUrdf(str(specimen.urdf))
    shapes = list(_primitives(model, specimen.urdf.read_text(encoding="utf-8")))
    drawn = {shape.joint for shape in shapes}
    for joint, inertia in enumerate(model.inertias):
        if joint not in drawn and inertia.mass > 0.0:
            shapes.append(_as_uniform(joint, inertia))
    place = pin.SE3(pin.rpy.rpyToMatrix(*specimen.rpy), np.array(specimen.position))
    top = pin.SE3(np.eye(3), -np.array(machine.platen.centre_of_gravity))
    return SpecimenBodies(model, shapes, top * place)


def specimen_poses(bodies: SpecimenBodies, positions: Mapping[str, Array], samples: int) -> Array:
    """Return poses (n, n_joints, 7) of a specimen's bodies in the platen's {b}: position [m] and quaternion x y z w.

    positions (n,) [m or rad] are those of a record's `specimen_joint_position`, by joint; what is missing stands still.
    """
    model = bodies.model
    q = np.tile(pin.neutral(model), (samples, 1))
    for joint in range(1, model.njoints):
        values = positions.get(str(model.names[joint]))
        if values is not None:
            turns = model.nqs[joint] == 2
            columns = [np.cos(values), np.sin(values)] if turns else [values]
            q[:, model.idx_qs[joint] : model.idx_qs[joint] + len(columns)] = np.column_stack(columns)
    poses = body_poses(model, q)
    for moment in poses:
        for k, pose in enumerate(moment):
            moment[k] = pin.SE3ToXYZQUAT(bodies.root * pin.XYZQUATToSE3(pose))
    return poses


def _primitives(model: Any, text: str) -> Sequence[SpecimenShape]:
    """Boxes, cylinders and spheres of the URDF's visuals; none where one of them is a mesh that cannot be read."""
    try:
        known = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL).geometryObjects
    except (ValueError, RuntimeError):
        return []
    return [
        SpecimenShape(shape.name, shape.parentJoint, shape.geometry, shape.placement)
        for shape in known
        if hasattr(shape.geometry, "halfSide") or hasattr(shape.geometry, "radius")
    ]


def _as_uniform(joint: int, inertia: Any) -> SpecimenShape:
    """Uniform box of a mass and inertia: edge a of three with a^2 = 6 (I_b + I_c - I_a) / m."""
    moments, axes = np.linalg.eigh(inertia.inertia)
    axes[:, 2] *= np.linalg.det(axes)  # right-handed
    squares = 6.0 * (moments.sum() - 2.0 * moments) / inertia.mass
    least = 0.02 * float(np.sqrt(max(squares.max(), 1e-4)))  # a rod or plate is drawn with some thickness
    half = 0.5 * np.maximum(np.sqrt(np.maximum(squares, 0.0)), least)
    return SpecimenShape(f"body_{joint}", joint, UniformBox(half), pin.SE3(axes, inertia.lever))
