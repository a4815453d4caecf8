"""Forces that a motion requires of the actuators, with what is mounted, as shares of what each of them can give.

An actuator gives between f_min and f_max [N]: supply in one chamber and return in the other; of a single chamber
between the least pressure that the machine file states (else return) and supply. With f = c + h u, c and h the middle
and half the width of that range, the shares u of all actuators balance a motion at every instant,

    B (c + h u) = required - B_s f_s     required: inertia less weight (`required_wrench`), f_s: pulls of the struts

Of all solutions the one of least |u| is taken: internal forces of a redundant table are shared by capacity.
The motion is possible where |u| <= 1. Friction is neglected. Poses beyond a chamber's end are judged in the zero
position.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.cholesky import solve_positive
from ..core.compiled import compiled
from ..machine.strength import stated_strength
from .gas_pressure import strut_pressures
from .interface_wrench import bare
from .payload import lock_joints
from .plant import Plant
from .ports import evaluate_ports, platen_pose
from .pose import PlatenMotion, leg_displacements, plant_motion, rotation
from .required_wrench import required_wrench

__all__ = ["AxisCapacity", "ForceRange", "RequiredForces", "axis_capacity", "force_range", "required_forces"]
__all__ += ["rest_forces", "unit_shares", "wrench_at_bearings"]


class ForceRange(NamedTuple):
    """Range of each actuator's force, (n_actuators,) [N]."""

    least: Array
    most: Array

    @property
    def middle(self) -> Array:
        """Middle of the range."""
        return 0.5 * (self.least + self.most)

    @property
    def half(self) -> Array:
        """Half the width of the range."""
        return 0.5 * (self.most - self.least)


class RequiredForces(NamedTuple):
    """What a motion of n samples requires."""

    share: Array  # (n, n_actuators) u, -1 at the least and 1 at the largest force
    wrench: Array  # (n, 6) inertia less weight at B, platen axes, free axes only [N, N m]
    pull: Array  # (n, n_struts) forces of the struts, negative [N]
    turn: Array  # (n, 3, 3) s_R_b


def force_range(plant: Plant) -> ForceRange:
    """Forces between supply and return pressure; of a single chamber not below the least pressure stated."""
    high, low = plant.supply[:2]
    area_a, area_b = plant.actuators.area_a, plant.actuators.area_b
    least = max(low, stated_strength(plant.machine.parameters).least_pressure)
    return ForceRange(
        np.where(area_b > 0.0, low * area_a - high * area_b, least * area_a), high * area_a - low * area_b
    )


def required_forces(
    plant: Plant, motion: PlatenMotion, legs: Array | None = None, specimen: Array | None = None
) -> RequiredForces:
    """Shares of the actuators' ranges that a motion of C and Euler angles requires.

    legs (n, n_legs): elongations of the legs on this motion (`leg_displacements`), where they are known. specimen
    (n, 6): wrench of the specimen on the platen at B in platen axes [N, N m], where it is known; without it the
    specimen is one rigid body, its joints locked.
    """
    plant = lock_joints(plant) if specimen is None else bare(plant)
    if legs is None:
        legs, _ = leg_displacements(plant, motion.displacement)
    rooms = [a.room for a in plant.machine.actuators]
    reachable = np.all(np.abs(legs[:, : plant.spools]) < rooms, axis=1, keepdims=True)
    motion = motion._replace(displacement=np.where(reachable, motion.displacement, 0.0))
    moved = plant_motion(plant, motion)
    turn = rotation(motion.displacement[:, 3:])
    wrench = required_wrench(plant, moved, turn)
    if specimen is not None:
        wrench[:, plant.axes] -= specimen[:, plant.axes]
    elongation = np.where(reachable, legs[:, plant.spools :], 0.0)
    pull = -strut_pressures(plant.machine, elongation) * [s.area for s in plant.machine.struts]
    share, span = np.zeros((len(wrench), plant.spools)), force_range(plant)
    q = np.ascontiguousarray(moved.q)
    _shares(q, wrench, np.ascontiguousarray(pull), plant.tables, len(plant.ports), span.middle, span.half, share)
    return RequiredForces(share, wrench, pull, turn)


def rest_forces(plant: Plant) -> RequiredForces:
    """What rest in the zero-position requires, one sample."""
    return required_forces(plant, PlatenMotion(*np.zeros((3, 1, 6))))


class AxisCapacity(NamedTuple):
    """Largest components of force and moment along single axes beyond those at rest, the others as at rest."""

    rise: Array  # (6,) [N, N m], in the positive direction; infinity on axes that are not free
    fall: Array  # (6,) magnitudes in the negative direction


def axis_capacity(plant: Plant) -> AxisCapacity:
    """Capacity of the actuators along single axes of the platen, at N, the foot of C on the bearing plane.

    Zero where at rest an actuator is at or beyond an end of its range.
    """
    rest = rest_forces(plant).share[0]
    per = unit_shares(plant) @ np.linalg.inv(_to_bearings(plant))  # (n_actuators, 6) at N
    rise, fall = np.full((2, 6), np.inf)
    for k in plant.axes:
        used = np.abs(per[:, k]) > 1e-9 * np.abs(per[:, k]).max()
        share, at = per[used, k], rest[used]
        up, down = (1.0 - at) / np.abs(share), (1.0 + at) / np.abs(share)
        rise[k], fall[k] = np.where(share > 0.0, up, down).min(), np.where(share > 0.0, down, up).min()
    return AxisCapacity(np.maximum(rise, 0.0), np.maximum(fall, 0.0))


def wrench_at_bearings(plant: Plant, wrench: Array) -> Array:
    """Wrenches (n, 6) in platen axes at N of those at B."""
    return wrench @ _to_bearings(plant).T


def _to_bearings(plant: Plant) -> Array:
    """Matrix (6, 6) that takes a wrench at B to N, `plane` above it: the moment less r x f."""
    height = float(plant.body[0]["plane"])
    matrix = np.eye(6)
    matrix[3, 1], matrix[4, 0] = height, -height
    return matrix


def unit_shares(plant: Plant) -> Array:
    """Shares per unit of the wrench required at B, (n_actuators, 6) [1/N, 1/(N m)], in the zero-position."""
    plant = lock_joints(plant)
    span = force_range(plant)
    wrench, pull = np.vstack([np.zeros(6), np.eye(6)]), np.zeros((7, len(plant.machine.struts)))
    share = np.zeros((7, plant.spools))
    q = np.ascontiguousarray(np.tile(plant.zero_state().q, (7, 1)))
    _shares(q, wrench, pull, plant.tables, len(plant.ports), span.middle, span.half, share)
    return (share[1:] - share[0]).T


@compiled
def _shares(q, wrench, pull, tables, n_ports, middle, half, share):  # type: ignore[no-untyped-def]
    axes, legs, body = tables.axes, tables.legs, tables.body
    free, count = axes.size, middle.size
    frame, s = np.zeros((8, 3)), np.zeros(n_ports)
    J, B = np.zeros((n_ports, 6)), np.zeros((n_ports, 6))
    normal, right = np.zeros((free, free)), np.zeros(free)
    for k in range(q.shape[0]):
        platen_pose(q[k], axes, body, frame)
        evaluate_ports(frame, legs, body, s, J, B)
        for a in range(free):
            right[a] = wrench[k, axes[a]]
            for i in range(count):
                right[a] -= B[i, axes[a]] * middle[i]
            for i in range(pull.shape[1]):
                right[a] -= B[count + i, axes[a]] * pull[k, i]
            for b in range(a + 1):
                total = 0.0
                for i in range(count):
                    total += B[i, axes[a]] * half[i] * half[i] * B[i, axes[b]]
                normal[a, b] = total
        solve_positive(normal, right)
        for i in range(count):
            total = 0.0
            for a in range(free):
                total += half[i] * B[i, axes[a]] * right[a]
            share[k, i] = total
