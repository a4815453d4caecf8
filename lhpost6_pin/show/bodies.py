"""A machine's URDF in Pinocchio: where its bodies are at a pose of the platen.

A leg's joint positions follow from its two ends in closed form, as the tree of the URDF needs them. That extensions
are those of the compiled ports is tested.
"""

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..machine.machine import Machine
from ..mechanics.pose import rotation
from .urdf import legs, urdf_text

__all__ = ["Bodies", "body_name", "body_poses", "joint_positions", "load_bodies", "quaternions"]

Array = NDArray[np.float64]


class Bodies(NamedTuple):
    """A machine's URDF in Pinocchio: joints, and primitive shapes to draw."""

    model: Any  # pin.Model
    shapes: Any  # pin.GeometryModel


def load_bodies(machine: Machine) -> Bodies:
    """Read the machine's URDF with Pinocchio."""
    text = urdf_text(machine)
    model = pin.buildModelFromXML(text)
    return Bodies(model, pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL))


def joint_positions(machine: Machine, model: Any, displacement: Array) -> Array:
    """Positions q (n, nq) of the URDF's joints at which every leg ends at the platen (Eqs. 3-20, 3-24, 4-13, 4-14).

    displacement (n, 6): of C in {s} and Euler angles [m, rad]. A guided platen uses its own axis only.
    """
    pose = np.array(np.atleast_2d(displacement), float)
    if machine.motion != "free":
        pose[:, np.arange(6) != "xyz".index(machine.motion)] = 0.0
    turn = rotation(pose[:, 3:])
    q = np.zeros((len(pose), model.nq))

    def put(joint: str, values: Array) -> None:
        index = model.getJointId(joint)
        start = model.idx_qs[index]
        q[:, start : start + model.nqs[index]] = values.reshape(len(pose), -1)

    if machine.motion == "free":
        centre = np.array(machine.platen.centre_of_gravity)
        put("platen_motion", np.hstack([pose[:, :3] + turn @ centre - centre, quaternions(turn)]))
    else:
        put("platen_motion", pose[:, "xyz".index(machine.motion)])
    normal = turn[:, :, 2]
    foot = pose[:, :3] + turn @ np.array(machine.platen.bearing_plane)
    for leg in legs(machine):
        base, point = np.array(leg.base_point), np.array(leg.platen_point)
        zero_length = np.linalg.norm(point - base)
        if getattr(leg, "mount", "swivel") == "bearing":
            length = np.einsum("ni,ni->n", foot - base, normal) / normal[:, 2]
            put(f"{leg.name}_plate_y", np.arctan2(normal[:, 0], normal[:, 2]))
            put(f"{leg.name}_plate_x", np.arctan2(-normal[:, 1], np.hypot(normal[:, 0], normal[:, 2])))
        else:
            reach = pose[:, :3] + turn @ point - base
            length = np.linalg.norm(reach, axis=1)
            at_zero = model.jointPlacements[model.getJointId(f"{leg.name}_swivel_x")].rotation
            x, y, z = (reach @ at_zero / length[:, None]).T
            put(f"{leg.name}_swivel_x", np.arctan2(-y, z))
            put(f"{leg.name}_swivel_y", np.arctan2(x, np.hypot(y, z)))
        put(f"{leg.name}_extension", length - zero_length)
    return q


def body_poses(model: Any, q: Array) -> Array:
    """Poses (n, n_joints, 7) of the bodies in {s}: position [m] and quaternion x y z w, joint 0 being the world."""
    data = model.createData()
    poses = np.zeros((len(q), model.njoints, 7))
    for k, position in enumerate(q):
        pin.forwardKinematics(model, data, position)
        for joint in range(model.njoints):
            poses[k, joint] = pin.SE3ToXYZQUAT(data.oMi[joint])
    return poses


def quaternions(turn: Array) -> Array:
    """Unit quaternions (n, 4) as x, y, z, w of rotation matrices (n, 3, 3)."""
    return np.array([pin.Quaternion(r).coeffs() for r in turn])


def body_name(model: Any, joint: int) -> str:
    """Link that moves with a joint; its name in the scene."""
    body = pin.FrameType.BODY
    return str(next(f.name for f in model.frames if f.parentJoint == joint and f.type == body))
