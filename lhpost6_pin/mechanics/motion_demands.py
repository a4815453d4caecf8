"""Demands of a motion on actuators and parts of a machine, with what is mounted on it.

Of actuators: velocity over what the valves can feed, elongation over stroke, force between that at rest and the end of
the actuator's range (`actuator_forces`): push, pull, and of a bearing actuator, which cannot pull, the loss of its
pressure down to the least stated, beyond which it would lose contact. Of parts, where the machine file states their
strength: reaction mass, platen, tilt of the pistons, payload. Beside them the required force or moment along each axis
over the capacity along this axis alone, which does not decide: axes share the actuators.
"""

import numpy as np

from ..core.arrays import Array
from ..core.errors import OutOfRangeError
from ..core.names import AXES
from ..machine.strength import Strength, stated_strength
from ..motions import Demand
from ..motions.limits import less_reserve
from .actuator_forces import axis_capacity, force_range, required_forces, rest_forces, wrench_at_bearings
from .equilibrium import actuator_speeds, rest_remedy
from .plant import Plant
from .pose import PlatenMotion, leg_displacements, rotation
from .specimen_joints import specimen_mass

__all__ = ["MotionDemands"]

OVERTURNING = ("roll", "pitch")
OF_SPEED = "of the unloaded velocity of its valves"


class MotionDemands:
    """The demands of motions on a plant; called as a `MotionCheck`, and so of motion that was achieved."""

    def __init__(self, plant: Plant) -> None:
        """Raise SimulationError or OutOfRangeError if the actuators cannot hold what is mounted at rest."""
        self._plant, self._full = plant, actuator_speeds(plant)
        self._strength, self._rest = stated_strength(plant.machine.parameters), rest_forces(plant)
        _refuse_unheld(plant, self._rest.share[0])
        self._along, self._span = axis_capacity(plant), force_range(plant)

    def __call__(
        self,
        displacement: Array,
        velocity: Array,
        acceleration: Array,
        *,
        achieved: bool = False,
        specimen: Array | None = None,
    ) -> list[Demand]:
        """Return the demands of a motion: displacement, velocity, acceleration of C and Euler angles, (n, 6) each.

        Valves can feed the steady unloaded speed at full spool, less limits.valve_reserve for feedback and load; of
        strokes limits.stroke_reserve is kept for overshoot. In a motion that was `achieved` these have taken what they
        needed: there is no reserve. The wrench `specimen` (n, 6) of what is mounted, on the platen at B in platen axes
        [N, N m], is that of its response where it is known; without it the specimen is one rigid body.
        """
        plant, rest, span, kept = self._plant, self._rest, self._span, self._plant.machine.limits
        strokes, names = np.array([a.stroke for a in plant.machine.actuators]), plant.machine.actuator_names
        single = np.array([a.area_b is None for a in plant.machine.actuators])
        flow, travel = (0.0, 0.0) if achieved else (kept.valve_reserve, kept.stroke_reserve)
        speeds, usable = (1.0 - flow) * self._full, (1.0 - travel) * strokes
        legs, rate = leg_displacements(plant, displacement, velocity)
        moved, rate = legs[:, : plant.spools], rate[:, : plant.spools]
        fed = np.where(rate >= 0.0, rate / speeds[:, 0], -rate / speeds[:, 1])
        found = [
            Demand("actuator velocity", names, fed, OF_SPEED + less_reserve(flow), rate),
            Demand("actuator stroke", names, np.abs(moved) / usable, "of its stroke" + less_reserve(travel), moved),
        ]
        needed = required_forces(plant, PlatenMotion(displacement, velocity, acceleration), legs, specimen)
        beyond, at = needed.share - rest.share, rest.share[0]
        push, pull = np.maximum(beyond, 0.0) / (1.0 - at), np.maximum(-beyond, 0.0) / (1.0 + at)
        more, less = span.half * np.maximum(beyond, 0.0), span.half * np.maximum(-beyond, 0.0)  # of force, from rest
        found.append(Demand("actuator push", names, push, "of its push beyond rest", more, "N"))
        for some, quantity, of in (
            (~single, "actuator pull", "of its pull beyond rest"),
            (single, "actuator unloading", "of its force at rest down to its least chamber pressure"),
        ):
            if some.any():
                these = [name for name, own in zip(names, some, strict=True) if own]
                found.append(Demand(quantity, these, pull[:, some], of, less[:, some], "N"))
        in_space = np.einsum("nij,nj->ni", needed.turn, needed.wrench[:, :3])
        wrench = needed.wrench - rest.wrench
        found += _on_parts(plant, self._strength, displacement, in_space, wrench[:, 3:])
        return [*found, *_along_axes(plant, wrench_at_bearings(plant, wrench), self._along)]


def _refuse_unheld(plant: Plant, share: Array) -> None:
    """Raise OutOfRangeError if an actuator is out of its range at rest."""
    if (np.abs(share) < 1.0).all():
        return
    worst = int(np.argmax(np.abs(share)))
    name, span = plant.machine.actuator_names[worst], force_range(plant)
    force = span.middle[worst] + span.half[worst] * share[worst]
    unloaded = bool(share[worst] < 0.0) and plant.machine.actuators[worst].area_b is None
    bound = (span.least if share[worst] < 0.0 else span.most)[worst]
    what, quantity = f"beyond its limit of {bound:.4g} N", "actuator pull" if share[worst] < 0.0 else "actuator push"
    if unloaded:
        least = bound / plant.actuators.area_a[worst] / 1e6
        what = f"which unloads it: its chamber is to keep {least:.3g} MPa, {bound:.4g} N"
        quantity = "actuator unloading"
    raise OutOfRangeError(
        f"{plant.machine.name} cannot run with what is mounted: {name} must give {force:.4g} N at rest, {what}; "
        f"{rest_remedy(plant.machine, unloaded=unloaded)}",
        0.0,
        (quantity,),
    )


def _on_parts(plant: Plant, strength: Strength, displacement: Array, force: Array, moment: Array) -> list[Demand]:
    """Demands on strengths that are stated.

    force (n, 3) in {s}, required of the actuators less the struts' [N]; moment (n, 3) at B in platen axes, beyond rest.
    """
    found = []
    if np.isfinite(strength.reaction_mass).all():
        level = force[:, :2]
        share = np.abs(level) / strength.reaction_mass
        found.append(Demand("reaction mass strength", ("x", "y"), share, "of its strength", level, "N"))
    if plant.machine.motion == "free" and np.isfinite(strength.reaction_moment).all():
        share = np.abs(moment) / strength.reaction_moment
        found.append(Demand("reaction mass moment", AXES[3:], share, "of its strength", moment, "N m"))
    if np.isfinite(strength.platen_up):
        up = np.maximum(force[:, 2:], 0.0)
        found.append(Demand("platen strength", ("z up",), up / strength.platen_up, "of its strength", up, "N"))
    if np.isfinite(strength.tilt) and plant.machine.motion == "free":
        tilt = np.arccos(np.clip(rotation(displacement[:, 3:])[:, 2, 2], -1.0, 1.0))[:, None]
        found.append(
            Demand("piston tilt", ("platen",), tilt / strength.tilt, "of what the pistons' seals allow", tilt, "rad")
        )
    if np.isfinite(strength.payload) and plant.machine.specimen is not None:
        weight = np.full((len(force), 1), specimen_mass(plant) * plant.machine.platen.gravity)
        name = plant.machine.specimen.name
        found.append(Demand("payload", (name,), weight / strength.payload, "of the payload", weight, "N", False))
    return found


def _along_axes(plant: Plant, wrench: Array, along: tuple[Array, Array]) -> list[Demand]:
    """Demands by axis, of wrenches (n, 6) beyond rest at N in platen axes."""
    rise, fall = along
    share = np.where(wrench >= 0.0, wrench / rise, -wrench / fall)
    groups: dict[str, list[tuple[str, Array, Array]]] = {}
    for k in plant.axes:
        axis = AXES[k]
        kind = "force" if k < 3 else "overturning moment" if axis in OVERTURNING else "yaw moment"
        if axis == "z":
            for word, sign in (("z up", 1.0), ("z down", -1.0)):
                part = np.where(sign * wrench[:, k] >= 0.0, share[:, k], 0.0)
                groups.setdefault(kind, []).append((word, part, np.where(part > 0.0, wrench[:, k], 0.0)))
        else:
            groups.setdefault(kind, []).append((axis, share[:, k], wrench[:, k]))
    found = []
    for kind, rows in groups.items():
        names, shares, values = zip(*rows, strict=True)
        unit = "N" if kind == "force" else "N m"
        of = "of what the actuators give along this axis alone"
        found.append(Demand(f"axis {kind}", names, np.column_stack(shares), of, np.column_stack(values), unit, False))
    return found
