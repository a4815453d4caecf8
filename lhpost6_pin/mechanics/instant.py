"""One instant on Pinocchio's types: poses are `pin.SE3`, twists `pin.Motion`, wrenches `pin.Force`.

    pose = platen_pose_at([0.1, 0, 0, 0, 0, 0.02])            # C at x = 0.1 m, yaw 0.02 rad
    wrench = wrench_at(plant, pose, force)                    # of actuator forces (n_actuators,) [N]
    wrench.linear, wrench.angular                             # [N], [N m] at C in {c}

A pose places the platen's axes at C, the centre of its top, in {s}. The frame {c} has its origin there as well and the
axes of {s}: twists and wrenches in it are the report's (Sections 3.3 and 4.4), with the linear part named, not first or
last. Whole records are arrays: `pose`, `ledger`.
"""

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..core.arrays import Array
from .leg_model import LegModel
from .plant import Plant
from .port_path import ports_along
from .pose import PlatenMotion, leg_displacements, plant_motion

__all__ = ["displacement_of", "legs_at", "motion_at", "platen_pose_at", "required_wrench_at", "wrench_at"]


def platen_pose_at(displacement: ArrayLike) -> pin.SE3:
    """Pose of a platen displacement (6,): position of C in {s} [m] and Euler angles [rad] (Eq. 3-5)."""
    values = np.asarray(displacement, float)
    return pin.SE3(pin.rpy.rpyToMatrix(values[3:]), values[:3])


def displacement_of(pose: pin.SE3) -> Array:
    """Platen displacement (6,) of a pose, the inverse of `platen_pose_at`."""
    return np.concatenate([pose.translation, pin.rpy.matrixToRpy(pose.rotation)])


def motion_at(pose: pin.SE3, twist: pin.Motion) -> tuple[Array, Array]:
    """Displacement and velocity (6,) of C in {s} and Euler angles, of a pose and the twist at C in platen axes."""
    displacement = displacement_of(pose)
    turning = pin.rpy.computeRpyJacobianInverse(displacement[3:], pin.LOCAL) @ twist.angular
    return displacement, np.concatenate([pose.rotation @ twist.linear, turning])


def wrench_at(plant: Plant, pose: pin.SE3, force: ArrayLike) -> pin.Force:
    """Wrench at C in {c} of forces (n_actuators,) [N] along the actuators, positive where they push (4-22 to 4-24).

    Forces (n_legs,) are those of actuators, then struts. Raises RecordError for a pose out of an actuator's stroke.
    """
    forces = np.asarray(force, float)
    motion = plant_motion(plant, PlatenMotion(displacement_of(pose)[None], *np.zeros((2, 1, 6))))
    column = ports_along(plant, motion).column[0, : len(forces)]  # (n, 6) at B in platen axes
    return _body_in_c(plant, pose).act(pin.Force(column.T @ forces))


def legs_at(plant: Plant, pose: pin.SE3, twist: pin.Motion | None = None) -> tuple[Array, Array]:
    """Elongations (n_legs,) [m] of actuators, then struts, and their rates [m/s] of a twist at C in {c}."""
    displacement = displacement_of(pose)
    rates = np.zeros(6)
    if twist is not None:
        rates[:3] = twist.linear
        rates[3:] = pin.rpy.computeRpyJacobianInverse(displacement[3:], pin.WORLD) @ twist.angular
    s, rate = leg_displacements(plant, displacement, rates)
    return s[0], rate[0]


def required_wrench_at(plant: Plant, pose: pin.SE3, twist: pin.Motion, acceleration: pin.Motion) -> pin.Force:
    """Wrench at C in {c} that gives the platen its inertial force and holds its weight (Eqs. 4-24 to 4-29).

    twist at C in {c}; acceleration is the rate of its components. For a platen that is free, with a rigid specimen at
    most: pin.rnea, and what the directional mass or moving parts as bodies add.
    """
    turned = pin.SE3(pose.rotation, np.zeros(3))
    rate = turned.actInv(acceleration)
    omega, v = (turned.actInv(twist).angular, turned.actInv(twist).linear)
    rho = plant.body[0]["rho_c"]
    # of B in platen axes: the classical acceleration, less omega x v, is the rate of the body twist
    v_b = v - np.cross(omega, rho)
    a_b = rate.linear - np.cross(rate.angular, rho) - np.cross(omega, np.cross(omega, rho))
    q = np.concatenate([pose.act(-rho), pin.Quaternion(pose.rotation).coeffs()])
    body = np.concatenate([v_b, omega]), np.concatenate([a_b - np.cross(omega, v_b), rate.angular])
    pin.rnea(plant.model, data := plant.model.createData(), q, *body)
    total = data.f[1]
    extra = plant.body[0]["mass_extra"] * a_b + plant.body[0]["weight_extra"] * pose.rotation[2]
    if plant.machine.bodies == "full":
        total = total + LegModel(plant).required_wrench(q, *body)
    return _body_in_c(plant, pose).act(total + pin.Force(extra, np.zeros(3)))


def _body_in_c(plant: Plant, pose: pin.SE3) -> pin.SE3:
    """Placement of {b}, at B with the platen's axes, in {c}."""
    return pin.SE3(pose.rotation, -pose.rotation @ plant.body[0]["rho_c"])
