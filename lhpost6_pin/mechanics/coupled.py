"""The interface of a specimen that is not part of the plant's equations: motion of its base in, wrench out.

    class Tower:
        inertia = pin.Inertia(2.0e4, np.array([0, 0, 0.3]), 1e4 * np.eye(3))    # rigidly attached part

        def init(self, base, gravity):                                # at rest under gravity
            return memory, wrench

        def step(self, memory, base, dt):                             # dt [s] after the last call
            return wrench

`lhpost6 run MOTION --specimen tower.py:Tower` mounts it; so does `machine.with_specimen(Tower())` in Python.

The wrench (`pin.Force`) is that of the specimen on the platen at the base point in base axes, weight included; a bar
pulled upwards by the platen pulls it down. The base point and its axes are placed on the platen (`position`, `rpy`).

The part of the specimen that is rigidly attached to its base, `inertia` (`pin.Inertia` at the base point, base axes;
`pin.Inertia.Zero()` if there is none), belongs to the platen in the plant's equations; the wrench contains it all the
same. A method `interface_mass(dt)` may state the whole matrix M_inf (6, 6), linear first, with which the wrench follows
an acceleration of the base at once; without it, or where it returns None, the specimen is probed beforehand
(`simulation.coupling`).
"""

from typing import Any, NamedTuple, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.errors import SimulationError
from ..core.user_code import call_user
from ..machine.machine import Machine
from .specimen_mount import placement_of

__all__ = ["BaseMotion", "CoupledSpecimen", "base_at_rest", "checked_wrench"]
__all__ += ["motion_numbers", "motion_of_numbers", "rigid_wrench", "start_coupled", "step_coupled"]
__all__ += ["wrench_of"]


class BaseMotion(NamedTuple):
    """Motion of a specimen's base at one instant.

    pose in {s}; twist and acceleration at the base point in base axes. acceleration.linear is the classical one of the
    base point, as accelerometers measure it, less gravity; acceleration.angular the rate of the angular velocity.
    """

    pose: pin.SE3
    twist: pin.Motion
    acceleration: pin.Motion


def motion_numbers(base: BaseMotion) -> Array:
    """Motion of a base (18,): position [m], Euler angles [rad], twist, acceleration, as links and FMUs hand it on."""
    pose = base.pose
    parts = pose.translation, pin.rpy.matrixToRpy(pose.rotation), base.twist.vector, base.acceleration.vector
    return np.concatenate(parts)


def motion_of_numbers(numbers: Array) -> BaseMotion:
    """Motion of a base from the numbers of `motion_numbers`."""
    pose = pin.SE3(pin.rpy.rpyToMatrix(numbers[3:6]), numbers[:3])
    return BaseMotion(pose, pin.Motion(numbers[6:12]), pin.Motion(numbers[12:18]))


def wrench_of(numbers: ArrayLike) -> pin.Force:
    """Wrench of six numbers, force first, or itself."""
    return numbers if isinstance(numbers, pin.Force) else pin.Force(np.array(numbers, float))


class CoupledSpecimen(Protocol):
    """A specimen that exchanges motion and wrench with the platen. It may hold its state in `memory`."""

    inertia: pin.Inertia

    def init(self, base: BaseMotion, gravity: float) -> tuple[Any, pin.Force]:
        """Memory of one run and wrench, at rest under gravity [m/s2] on a base at rest."""

    def step(self, memory: Any, base: BaseMotion, dt: float) -> pin.Force:
        """Wrench dt [s] after the last call, of the motion of the base at that instant; called in order."""


def base_at_rest(machine: Machine) -> BaseMotion:
    """Base of a machine's specimen at rest in the zero-position."""
    assert machine.specimen is not None
    return BaseMotion(placement_of(machine.specimen), pin.Motion.Zero(), pin.Motion.Zero())


def start_coupled(coupled: CoupledSpecimen, base: BaseMotion, gravity: float) -> tuple[Any, pin.Force]:
    """Memory and wrench of a specimen at rest; raises SimulationError naming what fails."""
    found = call_user(coupled, "init", "", SimulationError, base, gravity)
    if not isinstance(found, tuple) or len(found) != 2:
        raise SimulationError(f"{type(coupled).__name__}.init must return (memory, wrench); it returned {found!r}")
    return found[0], checked_wrench(coupled, found[1], "at rest")


def step_coupled(coupled: CoupledSpecimen, memory: Any, base: BaseMotion, dt: float, when: str) -> pin.Force:
    """Wrench of a specimen after dt [s]; raises SimulationError naming the specimen and `when` it fails."""
    wrench = call_user(coupled, "step", f" {when}", SimulationError, memory, base, dt)
    return checked_wrench(coupled, wrench, when)


def checked_wrench(coupled: object, wrench: Any, when: str) -> pin.Force:
    """Wrench as finite numbers; raises SimulationError naming the specimen and `when` it gave it."""
    name = type(coupled).__name__
    if not isinstance(wrench, pin.Force):
        raise SimulationError(f"{name} returned {type(wrench).__name__} {when}; a wrench is a pin.Force")
    if not np.isfinite(wrench.vector).all():
        axis = ("fx", "fy", "fz", "mx", "my", "mz")[int(np.argmin(np.isfinite(wrench.vector)))]
        raise SimulationError(f"{name} returned a wrench {when} whose {axis} is not finite")
    return wrench


def rigid_wrench(inertia: pin.Inertia, base: BaseMotion, gravity: float) -> pin.Force:
    """Wrench on the platen of a rigid body attached to the base: -(I (a - g) + v x* I v), at the base point."""
    twist = base.twist
    spatial = pin.Motion(base.acceleration.linear - np.cross(twist.angular, twist.linear), base.acceleration.angular)
    spatial.linear = spatial.linear + gravity * base.pose.rotation[2]
    return -(inertia * spatial + twist.cross(inertia * twist))
