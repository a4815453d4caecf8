"""Barrels and rods of all legs as a Pinocchio model, whose motion follows from the platen's: M = sum G' M_leg G.

A leg on swivels has two rotations at its base point and a slider; a bearing actuator's rod slides upright. Positions x,
velocities G V and bias accelerations G' V of these joints are functions of the platen's pose and twist (`leg_motion`).
CRBA gives the legs' mass matrix, RNEA at the bias acceleration the forces that hold them on that motion and carry them:

    (M_platen + G' M_legs G) dV/dt = tau - h_platen - G' rnea(x, G V, G' V)

Measured against constrained dynamics (`scripts/moving_parts.py`): the projection has no constraint to drift, no
singular massless bearing, and costs less.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from ..core.arrays import Array
from ..machine.components import Actuator, Strut
from ..machine.machine import Machine
from .leg_bodies import LegBody, leg_bodies
from .leg_motion import follow_platen, leg_joints, solve_projected
from .plant import Plant
from .rigid_body import platen_inertia

__all__ = ["Dynamics", "LegModel", "make_dynamics", "make_leg_model"]

Dynamics = Callable[[Array, Array, Array], Array]
"""Acceleration (nv,) of a plant's model from q (nq,), v (nv,) and tau (nv,)."""


class LegModel:
    """Pinocchio model of the legs of a plant, and its projection onto the platen."""

    def __init__(self, plant: Plant) -> None:
        """Build the model; raises ParameterError for legs whose masses cannot be split."""
        self.plant = plant
        self.model, self._zero = make_leg_model(plant.machine)
        self._data = self.model.createData()
        n, slots = self.model.nv, [[c.kind] * (1 if _upright(c) else 3) for c in plant.machine.components]
        self.kinds = [kind for kinds in slots for kind in kinds]  # of each joint's component
        self.buffer = np.zeros(9 * n)
        self.position, self.velocity, self.bias, self.jacobian = leg_joints(self.buffer)

    def follow(self, q: Array, v: Array) -> None:
        """Fill position, Jacobian, velocity and bias acceleration of the legs' joints for a pose and twist."""
        follow_platen(q, v, self.plant.tables.packed, self._zero, self.buffer)

    def forces(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Mass matrix (n, n) and forces (n,) of the legs' joints on the platen's motion with dV/dt = 0."""
        self.follow(q, v)
        mass = pin.crba(self.model, self._data, self.position)
        return mass, pin.rnea(self.model, self._data, self.position, self.velocity, self.bias)

    def projected(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Mass matrix (6, 6) and bias with weight (6,) of the legs at B in platen axes."""
        mass, force = self.forces(q, v)
        return self.jacobian.T @ mass @ self.jacobian, self.jacobian.T @ force

    def required_wrench(self, q: Array, twist: Array, rate: Array) -> pin.Force:
        """Wrench at B in platen axes that moves and holds the legs, and moves the platen's `extra`, by RNEA.

        twist (6,) and its rate (6,) are those of B in platen axes, linear first.
        """
        self.follow(q, twist[self.plant.axes])
        onward = self.jacobian @ rate + self.bias
        force = pin.rnea(self.model, self._data, self.position, self.velocity, onward)
        extra = self.plant.tables.inertia[0]["extra"]
        turned = pin.Motion(twist).cross(pin.Force(extra @ twist))
        return pin.Force(self.jacobian.T @ force + extra @ rate) + turned


def make_leg_model(machine: Machine) -> tuple[Any, Array]:
    """The pin.Model of barrels and rods, and the legs' axes in the zero-position (n_legs, 3, 3), x along the leg."""
    model = pin.Model()
    model.name = f"{machine.name}_legs"
    model.gravity.linear = np.array([0.0, 0.0, -machine.platen.gravity])
    zero = np.zeros((len(machine.components), 3, 3))
    for k, (component, body) in enumerate(zip(machine.components, leg_bodies(machine), strict=True)):
        zero[k] = _axes_along(np.subtract(component.platen_point, component.base_point))
        place = pin.SE3(zero[k], np.array(component.base_point))
        parent = 0
        if not _upright(component):
            parent = model.addJoint(0, pin.JointModelRZ(), place, f"{component.name}_turn")
            place = pin.SE3.Identity()
            parent = model.addJoint(parent, pin.JointModelRY(), place, f"{component.name}_tilt")
            model.appendBodyToJoint(parent, _slender(body.barrel_mass, body.barrel_length, 0.5), place)
        slider = model.addJoint(parent, pin.JointModelPX(), place, f"{component.name}_extension")
        model.appendBodyToJoint(slider, _rod(body), pin.SE3.Identity())
    return model, zero


def _upright(component: Actuator | Strut) -> bool:
    """Whether a leg has the slider alone: a bearing actuator."""
    return getattr(component, "mount", "none") == "bearing"


def _rod(body: LegBody) -> Any:
    return _slender(body.rod_mass, body.rod_length, -0.5)


def _slender(mass: float, length: float, centre: float) -> Any:
    """Inertia of a slender bar along x with its centre at a share of its length."""
    across = mass * length**2 / 12.0
    return pin.Inertia(mass, np.array([centre * length, 0.0, 0.0]), np.diag([0.0, across, across]))


def _axes_along(direction: Array) -> Array:
    """Rotation whose x axis has this direction."""
    x = direction / np.linalg.norm(direction)
    y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def make_dynamics(plant: Plant, armature: Array | None = None) -> Dynamics:
    """Forward dynamics of a plant on Pinocchio: ABA, with moving parts as bodies the projection of CRBA and RNEA.

    armature (nv,): inertia of the coordinates beside the model's own.

    ABA divides the torque by the mass M of platen and specimen as a rigid body; modes leave M - sum G G^T (`modes`),
    both constant in platen axes: its acceleration is (M - sum G G^T)^-1 M times that of ABA.
    """
    model, free = plant.model, np.ix_(plant.axes, plant.axes)
    if armature is not None:
        model = model.copy()
        model.armature = model.armature + armature
    data = model.createData()
    modal = plant.tables.inertia[0]["modal"][free]
    if plant.machine.bodies == "lumped":
        aba = partial(pin.aba, model, data)
        if not plant.modes.size:
            return aba
        mass = platen_inertia(model, plant.machine)[1][free]
        ratio = np.linalg.solve(mass - modal, mass)
        return lambda q, v, tau: ratio @ aba(q, v, tau)
    legs, packed = LegModel(plant), plant.tables.packed
    crba, effects, n = pin.crba, pin.nonLinearEffects, plant.axes.size

    def acceleration(q: Array, v: Array, tau: Array) -> Array:
        mass, force = legs.forces(q, v)
        own, bias = np.ascontiguousarray(crba(model, data, q)), effects(model, data, q, v)
        own[:n, :n] -= modal
        return np.asarray(solve_projected(own, bias, mass, force, legs.buffer, packed, q, v, tau))

    return acceleration
