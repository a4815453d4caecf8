"""The rigid body on Pinocchio: platen with direction-dependent mass, specimen, lumped masses.

A Pinocchio Inertia has one mass; the platen's identified masses differ by direction (Table 4.1). The Inertia at B
carries the isotropic part m_0 = min(m_x, m_y, m_z) and the rotational inertia, the joint's armature the rest
dM = M - m_0; what is then missing of Eqs. 4-24 and 4-26, the bias -dM (omega x v_B) and the weight (m_z - m_0) g, is
added as a wrench by `evaluate.wrench_on_platen`. Together they are the report's equations to rounding.

With moving parts as bodies (machine.bodies = full) the platen is what their lump in the zero-position leaves of the
effective inertia (`platen_body`), so that the total there is the effective inertia of the machine file.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.errors import ParameterError
from ..effects.modifiers import added_inertias
from ..machine.machine import Machine
from ..machine.user_specimen import UserSpecimen
from .coupled import CoupledSpecimen
from .coupled_maker import coupled_specimen
from .specimen_mount import base_placement, mount_specimen, top_placement

__all__ = ["free_axes", "lumped_inertia", "make_model", "platen_body", "platen_inertia"]


def free_axes(machine: Machine) -> NDArray[np.int64]:
    """Twist components (linear first) that the platen can have: all six, or those along its guides."""
    return np.array(machine.axes, np.int64)


def make_model(machine: Machine, coupled: CoupledSpecimen | None = None) -> Any:
    """Build the pin.Model of platen and specimen; the platen is joint 1, its frame {b} at B.

    q starts with the position of B in {s} and a quaternion (x, y, z, w), or with the displacements along guides; v with
    the twist of B in platen axes, linear first, on the free axes. Specimen joints follow. Of a coupled specimen the
    rigidly attached part belongs to the platen. Raises ParameterError for an unreadable URDF.
    """
    platen = machine.platen
    model = pin.Model()
    model.name = machine.name
    model.gravity.linear = np.array([0.0, 0.0, -platen.gravity])
    if machine.motion == "free":
        joint, placement = pin.JointModelFreeFlyer(), pin.SE3.Identity()
    else:
        joint = _guides(machine.axes)
        placement = pin.SE3(np.eye(3), np.array(platen.centre_of_gravity))
    index = model.addJoint(0, joint, placement, "platen")
    model.addJointFrame(index)
    body, beyond = platen_body(machine)
    model.appendBodyToJoint(index, _with_added(body, machine), pin.SE3.Identity())
    model.addFrame(pin.Frame("platen_top", index, 0, top_placement(machine), pin.FrameType.OP_FRAME))
    armature = np.diag(beyond) if machine.bodies == "lumped" else np.zeros(6)
    if isinstance(machine.specimen, UserSpecimen):
        coupled = coupled or coupled_specimen(machine)
        assert coupled is not None
        model.appendBodyToJoint(index, coupled.inertia, base_placement(machine))
    elif machine.specimen is not None:
        model = mount_specimen(model, machine.specimen)
    extra = np.zeros(model.nv)
    axes = free_axes(machine)
    extra[: axes.size] = armature[axes]
    model.armature = model.armature + extra
    return model


def _guides(axes: Sequence[int]) -> Any:
    """Joint of a platen on guides: a prismatic one, or one of several."""
    prismatic = [(pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)[k]() for k in axes]
    if len(prismatic) == 1:
        return prismatic[0]
    joint = pin.JointModelComposite(len(prismatic))
    for each in prismatic:
        joint.addJoint(each)
    return joint


def _with_added(inertia: Any, machine: Machine) -> Any:
    """Inertia of the platen with what effects add to it: mass with its weight, first and second moments about B."""
    for name, more in added_inertias(machine.modifiers):
        total = inertia.mass + more.mass
        if total <= 0.0:
            raise ParameterError(f"{name}: {more.mass:g} kg leave the platen no mass")
        if machine.motion != "free":  # what turns has no part
            inertia = pin.Inertia(total, inertia.lever, inertia.inertia)
            continue
        first, second = (more.first_x, more.first_y, more.first_z), (more.second_xx, more.second_xy, more.second_yy)
        added = [more.mass, *first, *second, more.second_xz, more.second_yz, more.second_zz]
        inertia = pin.Inertia.FromDynamicParameters(inertia.toDynamicParameters() + added)
        if np.linalg.eigvalsh(inertia.inertia)[0] <= 0.0:
            raise ParameterError(f"{name}: its moments and products leave the platen no inertia")
    return inertia


def platen_body(machine: Machine) -> tuple[Any, Array]:
    """Inertia of the platen at B (pin.Inertia), and what its effective inertia has beyond it (6, 6), linear first.

    Lumped: the isotropic mass, and the directional mass beyond it. Moving parts as bodies: what their lump leaves of
    the effective inertia, as an Inertia of its vertical mass, first and second moments; beyond it are the differences
    of the horizontal masses and of their first moments. Raises ParameterError if the lump leaves no inertia.
    """
    platen = machine.platen
    effective = np.diag([*platen.mass, *platen.inertia])
    if machine.bodies == "lumped":
        lumped = pin.Inertia(platen.isotropic_mass, np.zeros(3), np.diag(platen.inertia))
        return lumped, np.diag([*platen.directional_mass, 0.0, 0.0, 0.0])
    alone = effective - _legs_lump(machine)
    axes = free_axes(machine)
    if np.linalg.eigvalsh(alone[np.ix_(axes, axes)])[0] <= 0.0 or alone[2, 2] <= 0.0:
        raise ParameterError(
            f"{machine.parameters.origin}: mass_along and mass_across of the legs leave the platen no inertia; "
            "lighten them, or take machine.bodies = lumped"
        )
    mass, coupling = alone[2, 2], alone[3:, :3]
    first = pin.unSkew(0.5 * (coupling - coupling.T))
    lever = first / mass
    body = pin.Inertia(mass, lever, alone[3:, 3:] + mass * pin.skewSquare(lever, lever))
    return body, alone - body.matrix()


def _legs_lump(machine: Machine) -> Array:
    """Moving parts of all legs lumped to the platen in the zero-position (6, 6), at B."""
    parts = lumped_inertia((0.0,), (0.0, 0.0, 0.0), machine)
    return np.asarray(sum(parts.values()))


def platen_inertia(model: Any, machine: Machine) -> tuple[Array, Array]:
    """Spatial inertia of the platen body (6, 6) at B, linear first, and the effective one in the zero-position.

    Both include a rigid specimen; the effective one adds the directional mass, and moving parts that are bodies of
    their own. [kg, kg m, kg m2]
    """
    plain = np.array(model.inertias[1].matrix())
    full = plain + platen_body(machine)[1]
    return plain, full + _legs_lump(machine) if machine.bodies == "full" else full


def lumped_inertia(platen_mass: Sequence[float], platen_inertia: Sequence[float], machine: Machine) -> dict[str, Array]:
    """Compose platen alone and the moving parts of actuators and struts at their connection points (Table 4.1).

    Isotropic parts are Pinocchio point masses at the platen points; what differs along and across a component adds
    J^T dm J. Returns the 6x6 contribution of ``platen`` and of each kind, at B, linear first [kg, kg m, kg m2].
    """
    centre = np.array(machine.platen.centre_of_gravity)
    alone = pin.Inertia(float(platen_mass[0]), np.zeros(3), np.diag(np.asarray(platen_inertia, float)))
    parts = {"platen": np.array(alone.matrix())}
    for component in machine.components:
        lever = np.array(component.platen_point) - centre
        along = np.array(component.platen_point) - np.array(component.base_point)
        along /= np.linalg.norm(along)
        point = pin.Inertia(component.mass_across, lever, np.zeros((3, 3)))
        jacobian = np.hstack([np.eye(3), -pin.skew(lever)])
        more = (component.mass_along - component.mass_across) * np.outer(along, along)
        total = np.array(point.matrix()) + jacobian.T @ more @ jacobian
        parts[component.kind] = parts.get(component.kind, np.zeros((6, 6))) + total
    return parts
