"""Performance of a table under sinusoidal motion: what limits displacement, velocity and acceleration of each axis.

Over frequency f the peak velocity of a sine is the least of 2 pi f D, V and A / (2 pi f): three straight lines on
four-way logarithmic paper. D is limited by strokes and stated travel, each less its reserve, and tilt, V by valve flow
less the reserve and the stated velocity, A by the actuators' forces with what is mounted, the strengths of parts and
the stated acceleration.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES
from ..machine.strength import stated_strength
from .actuator_forces import rest_forces, unit_shares
from .capacity import axis_speeds, axis_travel
from .payload import lock_joints
from .plant import Plant
from .rigid_body import platen_inertia

__all__ = ["QUANTITIES", "AxisPerformance", "Bound", "table_performance"]

QUANTITIES = ("displacement", "velocity", "acceleration")
STATED = "stated limit"


class Bound(NamedTuple):
    """A limit of a sinusoidal motion and what sets it."""

    value: float  # [m, m/s, m/s2, rad, ...]
    by: str


class AxisPerformance(NamedTuple):
    """Limits of one axis, each tuple with the governing one first."""

    axis: str
    displacement: tuple[Bound, ...]
    velocity: tuple[Bound, ...]
    acceleration: tuple[Bound, ...]

    def bound(self, quantity: str) -> Bound:
        """Governing limit of displacement, velocity or acceleration."""
        found: tuple[Bound, ...] = getattr(self, quantity)
        return found[0]

    def peak_velocity(self, frequency: Array) -> Array:
        """Largest peak velocity (n,) of a sine at frequencies (n,) [Hz]."""
        w = 2.0 * np.pi * frequency
        d, v, a = (self.bound(quantity).value for quantity in QUANTITIES)
        return np.minimum(np.minimum(w * d, v), a / w)


def table_performance(plant: Plant) -> tuple[AxisPerformance, ...]:
    """Limits of every free axis of a plant with what is mounted, as `motion_limits` judges a motion."""
    limits, strength = plant.machine.limits, stated_strength(plant.machine.parameters)
    travel, speeds = axis_travel(plant), axis_speeds(plant)
    reserve, usable = 1.0 - limits.valve_reserve, 1.0 - limits.stroke_reserve
    less = f" less {100 * limits.stroke_reserve:g} %" if limits.stroke_reserve else ""
    forces = _force_bounds(plant)
    found = []
    for k in plant.axes:
        axis = AXES[k]
        moved = [
            Bound(usable * limits.displacement[k], STATED + less),
            Bound(usable * float(travel[k]), f"strokes of the actuators{less}"),
        ]
        if axis in ("roll", "pitch") and np.isfinite(strength.tilt):
            moved.append(Bound(strength.tilt, "tilt of the pistons"))
        share = f"valve flow less {100 * limits.valve_reserve:.0f} %"
        rates = [Bound(limits.velocity[k], STATED), Bound(reserve * float(speeds[k].min()), share)]
        found.append(
            AxisPerformance(
                axis, _sorted(moved), _sorted(rates), _sorted([Bound(limits.acceleration[k], STATED), *forces[k]])
            )
        )
    return tuple(found)


def _sorted(bounds: list[Bound]) -> tuple[Bound, ...]:
    return tuple(sorted(bounds, key=lambda bound: bound.value))


def _force_bounds(plant: Plant) -> dict[int, list[Bound]]:
    """Limits of acceleration of C along each axis alone: from the first actuator at an end of its range, and parts."""
    plant = lock_joints(plant)
    machine, strength = plant.machine, stated_strength(plant.machine.parameters)
    mass = platen_inertia(plant.model, machine)[1]
    rest, per = rest_forces(plant), unit_shares(plant)
    rho = plant.body[0]["rho_c"]
    found: dict[int, list[Bound]] = {}
    for k in plant.axes:
        twist = np.eye(6)[k]
        twist[:3] -= np.cross(twist[3:], rho)  # of B while C moves along or turns about the axis alone
        wrench = np.zeros(6)
        wrench[plant.axes] = (mass @ twist)[plant.axes]
        bounds = [_first_actuator(plant, rest.share[0], per @ wrench)]
        if k < 2 and np.isfinite(strength.reaction_mass[k]):
            bounds.append(Bound(strength.reaction_mass[k] / float(abs(wrench[k])), "strength of the reaction mass"))
        if k > 2 and np.isfinite(strength.reaction_moment[k - 3]):
            most = strength.reaction_moment[k - 3] / float(abs(wrench[k]))
            bounds.append(Bound(most, "strength of the reaction mass"))
        if k == 2 and np.isfinite(strength.platen_up):
            margin = strength.platen_up - float(rest.wrench[0, 2])
            bounds.append(Bound(max(margin, 0.0) / float(wrench[2]), "strength of the platen"))
        found[int(k)] = bounds
    return found


def _first_actuator(plant: Plant, rest: Array, per: Array) -> Bound:
    """Acceleration at which the first actuator is at an end of its range, per unit of it (n_actuators,)."""
    size = np.abs(per)
    used = size > 1e-9 * size.max()
    to_most, to_least = np.full((2, len(rest)), np.inf)
    to_most[used], to_least[used] = (1.0 - rest[used]) / size[used], (1.0 + rest[used]) / size[used]
    i = int(np.argmin(np.minimum(to_most, to_least)))
    actuator = plant.machine.actuators[i]
    word = "push" if to_most[i] < to_least[i] else "unloading" if actuator.area_b is None else "pull"
    return Bound(max(float(min(to_most[i], to_least[i])), 0.0), f"{word} of {actuator.name}")
