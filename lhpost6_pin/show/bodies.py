"""URDFs of a machine and of its specimen in Pinocchio: shapes to draw, and where they are.

A leg's joint positions follow from its two ends in closed form, as the tree of the URDF needs them. That extensions
are those of the compiled ports is tested.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ..core.arrays import Array
from ..machine.machine import Machine
from ..machine.specimen_forms import SpecimenContents
from ..machine.user_specimen import UserSpecimen
from ..mechanics.pose import rotation
from ..mechanics.specimen_mount import top_placement
from .urdf import legs, urdf_text

__all__ = [
    "Bodies",
    "body_name",
    "body_poses",
    "joint_positions",
    "load_bodies",
    "load_specimen_bodies",
    "quaternions",
    "specimen_poses",
]


class Bodies(NamedTuple):
    """A URDF in Pinocchio: joints, and primitive shapes to draw."""

    model: Any  # pin.Model
    shapes: Sequence[Any]  # pin.GeometryObject: box, cylinder or sphere
    root: Any = pin.SE3.Identity()  # of a specimen in the platen's {b}


def load_bodies(machine: Machine) -> Bodies:
    """Read the machine's URDF with Pinocchio."""
    text = urdf_text(machine)
    model = pin.buildModelFromXML(text)
    return Bodies(model, _shapes(model, text))


def load_specimen_bodies(machine: Machine) -> Bodies | None:
    """Read the specimen's URDF with Pinocchio, or draw the floors of any other form; None without, or for Python.

    A body is drawn by its boxes, cylinders and spheres; one without any of these as the uniform box that has its mass
    and inertia. A specimen of modes is a slab at each of its points' places, which moves as they do (its joints have
    their names), on a mast; or the box of its mass.
    """
    specimen = machine.specimen
    if specimen is None or isinstance(specimen, UserSpecimen):
        return None
    if specimen.contents is None:
        model = pin.buildModelFromUrdf(str(specimen.file))
        try:
            shapes = _shapes(model, specimen.file.read_text(encoding="utf-8"))
        except (ValueError, RuntimeError):  # a mesh that cannot be read
            shapes = []
    else:
        model, shapes = _floors(specimen.contents)
    drawn = {shape.parentJoint for shape in shapes}
    for joint, inertia in enumerate(model.inertias):
        if joint not in drawn and inertia.mass > 0.0:
            shapes.append(_uniform_box(joint, inertia))
    place = pin.SE3(pin.rpy.rpyToMatrix(*specimen.rpy), np.array(specimen.position))
    top = top_placement(machine)
    return Bodies(model, shapes, top * place)


def _shapes(model: Any, text: str) -> list[Any]:
    """Boxes, cylinders and spheres of a URDF's visuals."""
    objects = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL).geometryObjects
    return [one for one in objects if hasattr(one.geometry, "halfSide") or hasattr(one.geometry, "radius")]


def _floors(contents: SpecimenContents) -> tuple[Any, list[Any]]:
    """Model and shapes of a slab at every place of a specimen's points, each point a joint of its slab; and a mast.

    The uniform box of the specimen's mass without points.
    """
    body, model = contents.body, pin.Model()
    whole = _uniform_box(0, pin.Inertia(body.mass, np.array(body.centre), body.inertia))
    places = list(dict.fromkeys(point.at for point in contents.points))
    if not places:
        return model, [whole]
    edges = 2.0 * whole.geometry.halfSide
    x, y = (float(np.abs(whole.placement.rotation[k]) @ edges) for k in range(2))
    top = max(max(place[2] for place in places), 0.1)
    thick, mast = 0.05 * top, 0.1 * min(x, y)
    at = pin.SE3(np.eye(3), np.array([*np.mean(places, axis=0)[:2], 0.5 * top]))
    shapes = [pin.GeometryObject("mast", 0, at, pin.coal.Box(mast, mast, top))]
    for k, place in enumerate(places):
        joint, where = 0, pin.SE3(np.eye(3), np.array(place))
        for point in (point for point in contents.points if point.at == place):
            joint = model.addJoint(joint, _JOINTS[point.direction](), where, point.name)
            where = pin.SE3.Identity()
        shapes.append(pin.GeometryObject(f"floor_{k}", joint, pin.SE3.Identity(), pin.coal.Box(x, y, thick)))
    return model, shapes


_JOINTS: Mapping[str, Any] = {
    "x": pin.JointModelPX,
    "y": pin.JointModelPY,
    "z": pin.JointModelPZ,
    "rx": pin.JointModelRX,
    "ry": pin.JointModelRY,
    "rz": pin.JointModelRZ,
}
"""Joint of a coordinate of `specimen_forms.DIRECTIONS`."""


def _uniform_box(joint: int, inertia: Any) -> Any:
    """Uniform box of a mass and inertia: edge a of three with a^2 = 6 (I_b + I_c - I_a) / m."""
    moments, axes = np.linalg.eigh(inertia.inertia)
    axes[:, 2] *= np.linalg.det(axes)  # right-handed
    squares = 6.0 * (moments.sum() - 2.0 * moments) / inertia.mass
    least = 0.02 * float(np.sqrt(max(squares.max(), 1e-4)))  # a rod or plate is drawn with some thickness
    edges = np.maximum(np.sqrt(np.maximum(squares, 0.0)), least)
    return pin.GeometryObject(f"body_{joint}", joint, pin.SE3(axes, inertia.lever), pin.coal.Box(*edges))


def joint_positions(machine: Machine, model: Any, displacement: Array) -> Array:
    """Positions q (n, nq) of the URDF's joints at which every leg ends at the platen (Eqs. 3-20, 3-24, 4-13, 4-14).

    displacement (n, 6): of C in {s} and Euler angles [m, rad]. A guided platen uses its own axes only.
    """
    pose = np.array(np.atleast_2d(displacement), float)
    pose[:, ~np.isin(np.arange(6), machine.axes)] = 0.0
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
        for k in machine.axes:
            put(f"platen_motion_{'xyz'[k]}", pose[:, k])
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


def specimen_poses(bodies: Bodies, positions: Mapping[str, Array], samples: int) -> Array:
    """Return poses (n, n_joints, 7) of a specimen's bodies in the platen's {b}: position [m] and quaternion x y z w.

    positions (n,) [m or rad] are those of a record's `specimen_joint_position`, or of points `specimen_displacement`,
    by name; what is missing stands still.
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
