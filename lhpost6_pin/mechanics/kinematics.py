"""Kinematics and the platen's dynamics as the report writes them (Chapter 3, Sections 4.4 and 4.5), by hand.

This is the readable reference, one pose at a time; `ports` and `pose` hold the same relations for compiled code, and
tests hold both to Pinocchio. Here, and only here, twists V = (omega, v) and wrenches F = (m, f) are in the report's
order, ANGULAR FIRST; `to_pinocchio_order` and `to_report_order` are the one place where it changes.

Symbols: pose (6,) is the displacement r_OC of C in {s} [m] and the Euler angles alpha, beta, gamma [rad]. Points in
capitals: O origin of {s}, C centre of the top face, B centre of gravity, N foot of the normal from C on the bearing
plane, A_i and P_i base and platen end of component i, P'_i the platen's particle at P_i. A frame {f}, instantaneous and
inertial, is its placement in {s}, a `pin.SE3`. A name such as `f_J_g` is the report's superscript notation: it takes a
twist of the platen in {g} to the same motion in {f}.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.errors import SimulationError

if TYPE_CHECKING:
    from ..machine.components import Actuator, Strut
    from ..machine.machine import Machine

__all__ = ["b_J_E", "bearing_jacobian", "bearing_vector", "c_J_b", "component_force", "component_vector"]
__all__ += ["external_wrench", "f_J_g", "forward_kinematics", "frame_b", "frame_c", "frame_n", "frame_p", "frame_s"]
__all__ += ["inertial_wrench", "inverse_kinematics", "length_jacobian", "p_J_c", "plate_rotation", "pose_jacobian"]
__all__ += ["rotation", "rotation_x", "rotation_y", "rotation_z", "s_J_E", "skew", "slip_velocity", "swivel_jacobian"]
__all__ += ["swivel_vector", "thrust_direction", "to_pinocchio_order", "to_report_order", "twist_c", "wrench_transform"]

Component: TypeAlias = "Actuator | Strut"


# Order of components -------------------------------------------------------------------------------------------------


def to_pinocchio_order(spatial: ArrayLike) -> Array:
    """Twist (omega, v) or wrench (m, f), shape (..., 6), as Pinocchio stacks it: (v, omega) or (f, m)."""
    return np.roll(np.asarray(spatial, float), 3, axis=-1)


def to_report_order(spatial: ArrayLike) -> Array:
    """Twist (v, omega) or wrench (f, m), shape (..., 6), as the report stacks it: (omega, v) or (m, f)."""
    return np.roll(np.asarray(spatial, float), 3, axis=-1)


# Rotations (Section 3.2) ---------------------------------------------------------------------------------------------


def rotation_x(angle: float) -> Array:
    """Rotation (3, 3) about x by `angle` [rad] (Eq. 3-3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_y(angle: float) -> Array:
    """Rotation (3, 3) about y by `angle` [rad] (Eq. 3-3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_z(angle: float) -> Array:
    """Rotation (3, 3) about z by `angle` [rad] (Eq. 3-3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation(euler: ArrayLike) -> Array:
    """Platen's rotation s_R_b = Rz(gamma) Ry(beta) Rx(alpha) of Euler angles (3,) alpha, beta, gamma (Eq. 3-5)."""
    alpha, beta, gamma = np.asarray(euler, float)
    return rotation_z(gamma) @ rotation_y(beta) @ rotation_x(alpha)


def skew(x: ArrayLike) -> Array:
    """Matrix [x]_x (3, 3) with [x]_x y = x cross y (Eq. 3-8)."""
    x1, x2, x3 = np.asarray(x, float)
    return np.array([[0.0, -x3, x2], [x3, 0.0, -x1], [-x2, x1, 0.0]])


def s_J_E(euler: ArrayLike) -> Array:
    """Jacobian (3, 3) from Euler angle rates to the angular velocity in {s}, and so in {c} and {p'_i} (Eq. 3-10)."""
    _, beta, gamma = np.asarray(euler, float)
    cb, sb, cg, sg = np.cos(beta), np.sin(beta), np.cos(gamma), np.sin(gamma)
    return np.array([[cb * cg, -sg, 0.0], [cb * sg, cg, 0.0], [-sb, 0.0, 1.0]])


def b_J_E(euler: ArrayLike) -> Array:
    """Jacobian (3, 3) from Euler angle rates to the angular velocity in {b} (Eq. 3-11)."""
    alpha, beta, _ = np.asarray(euler, float)
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    return np.array([[1.0, 0.0, -sb], [0.0, ca, cb * sa], [0.0, -sa, cb * ca]])


# Frames, twists and wrenches (Sections 3.1, 3.3, 4.4) ----------------------------------------------------------------


def frame_s() -> pin.SE3:
    """Placement in {s} of {s} itself: fixed at O."""
    return pin.SE3.Identity()


def frame_c(pose: Array) -> pin.SE3:
    """{c}: at C, axes of {s}."""
    return pin.SE3(np.eye(3), np.array(pose[:3]))


def frame_b(machine: "Machine", pose: Array) -> pin.SE3:
    """{b}: at B, axes of the platen."""
    turn = rotation(pose[3:])
    return pin.SE3(turn, pose[:3] + turn @ machine.platen.centre_of_gravity)


def frame_p(machine: "Machine", pose: Array, component: Component) -> pin.SE3:
    """{p'_i}: at the platen's particle P'_i of a component, axes of {s}."""
    return pin.SE3(np.eye(3), pose[:3] + _from_c(machine, pose, component))


def frame_n(machine: "Machine", pose: Array, component: Component) -> pin.SE3:
    """{n_i}: at P_i, axes of a bearing's surface plate (Eqs. 4-13, 4-14)."""
    return pin.SE3(plate_rotation(rotation(pose[3:])), pose[:3] + _from_c(machine, pose, component))


def f_J_g(f: pin.SE3, g: pin.SE3) -> Array:
    """Jacobian (6, 6) from the platen's twist in {g} to its twist in {f} (Eq. 3-15).

    Its inverse is the same with f and g exchanged (Eq. 3-16).
    """
    f_R_g = f.rotation.T @ g.rotation
    f_r_FG = f.rotation.T @ (g.translation - f.translation)
    return np.block([[f_R_g, np.zeros((3, 3))], [skew(f_r_FG) @ f_R_g, f_R_g]])


def wrench_transform(f: pin.SE3, g: pin.SE3) -> Array:
    """Matrix (6, 6) from a wrench in {g} to the equal wrench in {f}: (f_J_g^-1)^T (Eq. 4-22)."""
    return f_J_g(g, f).T


def p_J_c(r_CP: ArrayLike) -> Array:
    """Jacobian (6, 6) from the twist in {c} to that in {p'_i}, whose origin is at r_CP from C in {s} (3-14, 3-17)."""
    return np.block([[np.eye(3), np.zeros((3, 3))], [-skew(r_CP), np.eye(3)]])


def c_J_b(machine: "Machine", pose: Array) -> Array:
    """Jacobian (6, 6) from the twist in {b} to that in {c} (Eq. 3-18)."""
    turn = rotation(pose[3:])
    r0_CB = np.array(machine.platen.centre_of_gravity)
    return np.block([[turn, np.zeros((3, 3))], [turn @ skew(r0_CB), turn]])


def twist_c(pose: Array, rate: Array) -> Array:
    """Twist (6,) of the platen in {c} from the rate of its pose (6,): velocity of C and Euler angle rates (3-10)."""
    return np.concatenate([s_J_E(pose[3:]) @ rate[3:], rate[:3]])


# Components (Section 3.4) --------------------------------------------------------------------------------------------


def is_bearing(component: Component) -> bool:
    """True if the component stays vertical and the platen slides over it."""
    return getattr(component, "mount", "swivel") == "bearing"


def swivel_vector(pose: Array, component: Component) -> Array:
    """r_AP (3,) in {s} of a component that swivels at both ends (Eqs. 3-19, 3-21) [m]."""
    return pose[:3] + rotation(pose[3:]) @ component.platen_point - component.base_point


def swivel_jacobian(pose: Array, component: Component) -> Array:
    """L_J_c (6,): the length's rate of a swivelling component per twist in {c} (Eq. 3-22)."""
    vector = swivel_vector(pose, component)
    unit = vector / np.linalg.norm(vector)
    r_CP = rotation(pose[3:]) @ component.platen_point
    return unit @ np.hstack([-skew(r_CP), np.eye(3)])


class Bearing(NamedTuple):
    """Geometry of a vertical actuator under a tilted platen, in {s} [m] (Eqs. 3-23, 3-24)."""

    r_AN: Array  # (3,)
    r_CN: Array  # (3,)
    r0_AP: Array  # (3,) in the control zero-position
    f: float  # r_AN . r_CN [m2]
    a: float  # r0_AP . r_CN [m2]


def bearing_geometry(machine: "Machine", pose: Array, component: Component) -> Bearing:
    """What Eqs. 3-24 to 3-27 are made of."""
    r_CN = rotation(pose[3:]) @ machine.platen.bearing_plane
    r_AN = pose[:3] + r_CN - component.base_point
    r0_AP = np.array(component.platen_point) - component.base_point
    return Bearing(r_AN, r_CN, r0_AP, float(r_AN @ r_CN), float(r0_AP @ r_CN))


def bearing_vector(machine: "Machine", pose: Array, component: Component) -> Array:
    """r_AP (3,) in {s} of a vertical actuator; its length is L = L_0 f/a (Eqs. 3-24, 3-25) [m]."""
    g = bearing_geometry(machine, pose, component)
    return g.f / g.a * g.r0_AP


def bearing_jacobian(machine: "Machine", pose: Array, component: Component) -> Array:
    """L_J_c (6,): the length's rate of a vertical actuator per twist in {c} (Eq. 3-27, Appendix 1)."""
    g = bearing_geometry(machine, pose, component)
    r_AP = g.f / g.a * g.r0_AP
    turning = -(g.r_AN + g.r_CN - r_AP) @ skew(g.r_CN)
    return np.linalg.norm(g.r0_AP) / g.a * np.concatenate([turning, g.r_CN])


def component_vector(machine: "Machine", pose: Array, component: Component) -> Array:
    """Actuator vector r_AP (3,) in {s} from base to platen end [m]; its norm is the length L (Eq. 3-20)."""
    return bearing_vector(machine, pose, component) if is_bearing(component) else swivel_vector(pose, component)


def length_jacobian(machine: "Machine", pose: Array, component: Component) -> Array:
    """L_J_c (6,): a component's length rate per twist in {c} (Eq. 3-22 or 3-27)."""
    return bearing_jacobian(machine, pose, component) if is_bearing(component) else swivel_jacobian(pose, component)


def _from_c(machine: "Machine", pose: Array, component: Component) -> Array:
    """r_CP' = r_OA + r_AP - r_OC in {s} (3,) [m] (Eq. 3-28)."""
    return component.base_point + component_vector(machine, pose, component) - pose[:3]


# Inverse and forward kinematics (Section 3.5) ------------------------------------------------------------------------


def inverse_kinematics(machine: "Machine", pose: Array) -> Array:
    """Lengths L (n,) of the actuators at a pose (Eq. 3-30) [m]."""
    return np.array([np.linalg.norm(component_vector(machine, pose, a)) for a in machine.actuators])


def pose_jacobian(machine: "Machine", pose: Array) -> Array:
    """J_IK (n, 6): rates of the actuators' lengths per rate of the pose (Eqs. 3-31 to 3-33)."""
    rows = np.array([length_jacobian(machine, pose, a) for a in machine.actuators])
    return np.hstack([rows[:, 3:], rows[:, :3] @ s_J_E(pose[3:])])


def forward_kinematics(
    machine: "Machine", length: Array, start: ArrayLike | None = None, *, steps: int = 30, tolerance: float = 1e-13
) -> Array:
    """Pose (6,) whose actuators have the given lengths (n,), in the least-squares sense, by Gauss-Newton (Eq. 3-34).

    start: pose to start from (the zero-position unless given), best that of the sample before. Stops when a step is
    below `tolerance` [m, rad]. Raises SimulationError if `steps` do not suffice or the lengths fit no pose.
    """
    pose = np.zeros(6) if start is None else np.array(start, float)
    free = list(machine.axes)
    for _ in range(steps):
        error = inverse_kinematics(machine, pose) - length
        if not np.all(np.isfinite(error)):
            break
        step = np.linalg.pinv(pose_jacobian(machine, pose)[:, free]) @ error
        pose[free] -= step
        if np.abs(step).max() < tolerance:
            return pose
    raise SimulationError(f"no pose found for actuator lengths {np.asarray(length)} m after {steps} Gauss-Newton steps")


# Bearing plates and their slip (Section 4.3) -------------------------------------------------------------------------


def plate_rotation(s_R_b: Array) -> Array:
    """s_R_n (3, 3) of all surface plates: z along the platen normal, Ry(beta) Rx(alpha), no turn about z (4-13, 4-14).

    The third column of Eq. 4-14 is (sin b cos a, -sin a, cos b cos a), solved for the plate's two angles.
    """
    normal = s_R_b[:, 2]
    return rotation_y(np.arctan2(normal[0], normal[2])) @ rotation_x(-np.arcsin(normal[1]))


def slip_velocity(machine: "Machine", pose: Array, component: Component, c_V: Array) -> Array:
    """Velocity (3,) of the platen relative to a bearing's plate in {n_i}, from the twist in {c} [m/s] (Eq. 4-15).

    v_P' is the platen's (Eq. 3-14), v_P the rod's (Eq. 3-26). The component along the normal vanishes.
    """
    v_platen = (p_J_c(_from_c(machine, pose, component)) @ c_V)[3:]
    vector = component_vector(machine, pose, component)
    v_rod = length_jacobian(machine, pose, component) @ c_V * vector / np.linalg.norm(vector)
    return plate_rotation(rotation(pose[3:])).T @ (v_platen - v_rod)


# Wrench on the platen and its dynamics (Sections 4.4, 4.5) -----------------------------------------------------------


def thrust_direction(machine: "Machine", pose: Array, component: Component) -> Array:
    """Force (3,) in {s} on the platen per unit of a component's axial force (Eq. 4-23).

    The report pushes along the component. A machine with thrust "normal" pushes along the platen normal n instead,
    by n / n_z, which Eq. 3-27 requires for conservation of power.
    """
    if is_bearing(component) and machine.thrust == "normal":
        normal = rotation(pose[3:])[:, 2]
        return normal / normal[2]
    vector = component_vector(machine, pose, component)
    return vector / np.linalg.norm(vector)


def component_force(
    machine: "Machine", pose: Array, component: Component, axial: float, pad: ArrayLike = (0.0, 0.0)
) -> Array:
    """Force (3,) [N] of a component on the platen at P'_i in {p'_i} (Eq. 4-23).

    axial: hydraulic (or gas), seal and viscous force along it [N]; pad (2,): sliding friction in the plane of {n_i}.
    """
    slide = plate_rotation(rotation(pose[3:]))[:, :2] @ np.asarray(pad, float)  # Eq. 4-17
    return axial * thrust_direction(machine, pose, component) + slide


def external_wrench(machine: "Machine", pose: Array, force: Mapping[str, Array]) -> Array:
    """b_F_ext (6,): weight and the components' forces by name, as `component_force` gives them, at B in {b} (4-24)."""
    weight = np.array(machine.platen.mass) * [0.0, 0.0, -machine.platen.gravity]
    total = np.concatenate([np.zeros(3), rotation(pose[3:]).T @ weight])
    for component in machine.components:
        if component.name in force:
            at_p = np.concatenate([np.zeros(3), force[component.name]])
            at_c = p_J_c(_from_c(machine, pose, component)).T @ at_p
            total += c_J_b(machine, pose).T @ at_c
    return total


def inertial_wrench(machine: "Machine", b_V: Array, b_A: Array) -> Array:
    """b_F_inert (6,) of a twist b_V (6,) and its component-wise rate b_A (6,) (Eqs. 4-26, 4-28, 4-29).

    With masses that differ by direction Eq. 4-26 is M (dv/dt + omega x v); Eq. 4-29's compact form, which writes
    omega x (M v), holds for one mass only.
    """
    mass, inertia = np.diag(machine.platen.mass), np.diag(machine.platen.inertia)
    omega, v = b_V[:3], b_V[3:]
    moment = inertia @ b_A[:3] + skew(omega) @ inertia @ omega
    return np.concatenate([moment, mass @ (b_A[3:] + skew(omega) @ v)])
