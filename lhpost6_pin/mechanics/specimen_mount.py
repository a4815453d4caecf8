"""A specimen mounted on the platen: joined to the Pinocchio model at the platen's top, with its springs and modes.

A URDF is appended with its joints; any other form is a rigid body on the platen's joint, whose modes are no part of
the Pinocchio model (`modes`).
"""

from typing import Any

import numpy as np
import pinocchio as pin

from ..core.arrays import Array
from ..core.errors import ParameterError, instead_of
from ..machine.machine import Machine
from ..machine.specimen import Specimen
from ..machine.urdf_numbers import check_urdf

__all__ = ["base_placement", "base_twist", "modal_participation", "mount_specimen", "placement_of", "top_placement"]

_NO_INERTIA = 1e-12
"""Share of the largest eigenvalue of a mass matrix below which one is rounding."""
_TAKES_PART = 0.1
"""Least share of a joint in a motion without inertia."""


def top_placement(machine: Machine) -> pin.SE3:
    """Placement in {b} of C with the platen's axes: the platen's top frame."""
    return pin.SE3(np.eye(3), -np.array(machine.platen.centre_of_gravity))


def placement_of(specimen: Specimen) -> pin.SE3:
    """Placement of a specimen's root or base in the platen's top frame; raises ParameterError if it is not finite."""
    if not np.all(np.isfinite((*specimen.position, *specimen.rpy))):
        raise ParameterError(f"{specimen.file}: position {specimen.position} and rpy {specimen.rpy} must be finite")
    return pin.SE3(pin.rpy.rpyToMatrix(*specimen.rpy), np.array(specimen.position))


def mount_specimen(model: Any, specimen: Specimen) -> Any:
    """Model of the platen with the specimen fixed to its top frame, at the specimen's position and rpy.

    Raises ParameterError for a file that is missing, unreadable, without mass, or with names of parts of the platen.
    """
    at = placement_of(specimen)
    if specimen.contents is None:
        return _mount_urdf(model, specimen, at)
    body, top = specimen.contents.body, model.frames[model.getFrameId("platen_top")]
    inertia = pin.Inertia(body.mass, np.array(body.centre), body.inertia)
    model.appendBodyToJoint(top.parentJoint, inertia, top.placement * at)
    return model


def _mount_urdf(model: Any, specimen: Specimen, at: pin.SE3) -> Any:
    urdf = specimen.file
    if not urdf.is_file():
        raise ParameterError(f"{urdf}: no such URDF file")
    check_urdf(urdf)
    try:
        body = pin.buildModelFromUrdf(str(urdf))
    except Exception as error:  # urdfdom reports malformed files as plain exceptions
        raise ParameterError(f"{urdf}: not a URDF that Pinocchio can read: {error}") from error
    _add_dampers(body, specimen)
    _rename_links(body, model)
    if specimen.locked and body.njoints > 1:
        body = pin.buildReducedModel(body, list(range(1, body.njoints)), pin.neutral(body))
    if sum(i.mass for i in body.inertias) <= 0.0:
        raise ParameterError(f"{urdf}: the specimen has no mass; give its links <inertial> elements")
    if lacking := _joints_without_inertia(body):
        raise ParameterError(
            f"{urdf}: nothing determines the acceleration of {', '.join(lacking)}: the links that move with it have no "
            "inertia; give them <inertial> elements, make the joint fixed, or lock all joints (--locked)"
        )
    try:
        joined = pin.appendModel(model, body, model.getFrameId("platen_top"), at)
    except ValueError as error:  # a joint named as the platen's
        raise ParameterError(f"{urdf}: {error} ({model.names[1]}); rename the specimen's in the URDF") from error
    joined.gravity = model.gravity
    return joined


def _rename_links(body: Any, model: Any) -> None:
    """Rename links that share their name with a joint or a part of the platen: Pinocchio finds frames by name alone."""
    taken = {str(frame.name) for frame in (*model.frames, *body.frames) if frame.type != pin.FrameType.BODY}
    names = taken | {str(frame.name) for frame in body.frames}
    for frame in body.frames:
        if frame.type == pin.FrameType.BODY and frame.name in taken:
            while frame.name in names:
                frame.name += "_link"
            names.add(frame.name)


def _joints_without_inertia(body: Any) -> list[str]:
    """Joints that can move without moving any inertia in the neutral position: the null space of the mass matrix."""
    if body.nv == 0:
        return []
    values, vectors = np.linalg.eigh(pin.crba(body, body.createData(), pin.neutral(body)), UPLO="U")
    share = (vectors[:, values <= _NO_INERTIA * values[-1]] ** 2).sum(axis=1)
    ends = zip(body.names, body.idx_vs, body.nvs, strict=True)
    return [str(name) for name, at, size in list(ends)[1:] if share[at : at + size].max() > _TAKES_PART]


def _add_dampers(body: Any, specimen: Specimen) -> None:
    """Add the dampers of the file beside a URDF to its joints' damping; raises ParameterError naming file and joint."""
    for name, spring in specimen.joint_springs.items():
        where = f"{specimen.file.with_suffix('.toml')}: joint.{name}"
        joints = [str(n) for n in body.names[1:]]
        if name not in joints:
            raise ParameterError(
                f"{where}: no such joint that moves in {specimen.file.name}; {instead_of(name, joints)}"
            )
        joint = body.getJointId(name)
        if body.nvs[joint] != 1:
            raise ParameterError(f"{where}: a spring acts in a joint of one coordinate, prismatic or revolute")
        damping = np.array(body.damping)
        damping[body.idx_vs[joint]] += spring.damping
        body.damping = damping


def modal_participation(machine: Machine) -> Array:
    """Participation (n_modes, 6) of a specimen's modes in the platen's twist at B in platen axes."""
    specimen = machine.specimen
    if specimen is None or specimen.modes is None:
        return np.zeros((0, 6))
    return specimen.modes.participation @ base_twist(machine)


def base_placement(machine: Machine) -> pin.SE3:
    """Placement of the base of a machine's specimen in {b}, at B with the platen's axes."""
    assert machine.specimen is not None
    return top_placement(machine) * placement_of(machine.specimen)


def base_twist(machine: Machine) -> Array:
    """Matrix (6, 6) that takes the platen's twist at B in platen axes to that of a specimen's base in its own axes.

    Its transpose takes a wrench at the base in its axes to B.
    """
    return np.asarray(base_placement(machine).toActionMatrixInverse())
