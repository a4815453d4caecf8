"""The limits of a motion on a machine, and the demand of a target over each of them.

Limits are the displacement, velocity and acceleration of C by axis (section `limits` of the machine file, Table 2.2),
and those of actuators and parts (`mechanics.motion_demands`): strokes, valve flow, forces with the specimen mounted,
strengths. Of a target, strokes and displacements keep `limits.stroke_reserve` and valve flow `limits.valve_reserve`.
The comparison and the largest scale that fits are in `motions.limits`.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import OutOfRangeError
from ..core.names import AXES
from ..machine.machine import Machine
from ..machine.strength import stated_strength
from ..machine.structure import FLOW_READINGS
from ..mechanics.capacity import with_all_valves
from ..mechanics.interface_wrench import from_interface
from ..mechanics.motion_demands import MotionDemands
from ..mechanics.plant import Plant, make_plant
from ..mechanics.pose import PlatenMotion
from ..motions import (
    Demand,
    LimitsSummary,
    MotionLimits,
    Peak,
    Reference,
    Target,
    check_limits,
    largest_scale,
    limit_peaks,
)
from ..motions.limits import SI, Units

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FLOW", "FlowRemedy", "Judgement", "check_motion_limits", "fitting_scale", "flow_remedies", "judge_motion"]
__all__ += ["judge_record", "refuse_blocked_axes"]

FLOW = "actuator velocity"
"""Name of the limit that the flow of valves sets."""


def check_motion_limits(
    plant: Plant,
    target: Target,
    units: Units = SI,
    *,
    remedies: bool = True,
    size: Callable[[float], str] | None = None,
) -> LimitsSummary:
    """Demand of a target over the capacity of a plant, by limit, with texts in `units`; `size` as in `check_limits`.

    Raises OutOfRangeError that names each limit exceeded and the largest scale that fits; where the flow of valves is
    exceeded, with `remedies` also the scale with all servovalves open and that by the other reading of Eq. 4-2. For a
    guided machine also where the target moves an axis that is not free.
    """
    refuse_blocked_axes(plant, target)
    bounds = _axis_limits(plant)
    try:
        return check_limits(target, bounds, MotionDemands(plant), units, size)
    except OutOfRangeError as error:
        if not remedies or FLOW not in error.exceeded:
            raise
        least, words = error.largest_scale, [str(error)]
        for remedy in flow_remedies(plant.machine):
            fits = fitting_scale(make_plant(remedy.machine), target)
            if least is None or fits > least:  # else other limits govern
                words.append(f"{remedy.words} the largest {size(fits) if size else f'scale is {fits:g}'}")
        raise OutOfRangeError(". ".join(words), least, error.exceeded) from None


class FlowRemedy(NamedTuple):
    """A machine whose valves admit more flow, and how it comes about, as the beginning of a sentence."""

    words: str
    machine: Machine


def flow_remedies(machine: Machine) -> list[FlowRemedy]:
    """All servovalves open, unless they are, and the other reading of Eq. 4-2."""
    (other,) = (word for word in FLOW_READINGS if word != machine.flow_reading)
    reading = f'With the other reading of Eq. 4-2 (machine.flow_reading = "{other}")'
    found = [FlowRemedy(reading, machine.with_flow_reading(other))]
    every = with_all_valves(machine)
    pairs = zip(machine.actuators, every.actuators, strict=True)
    opened = [full for now, full in pairs if full.valves > now.valves]
    if opened:
        kind, count = opened[0].kind, opened[0].valves
        valves = "both servovalves" if count == 2 else f"all {count} servovalves"
        option = f"--valves {count}, or {kind}.valves = {count} in an override"
        found.insert(0, FlowRemedy(f"With {valves} of each {kind} actuator open ({option})", every))
    return found


def refuse_blocked_axes(plant: Plant, target: Target) -> None:
    """Raise OutOfRangeError for a target that moves an axis which is not free."""
    axes = plant.axes
    blocked = [AXES[k] for k in range(6) if k not in axes and np.any(target.displacement[:, k] != 0.0)]
    if blocked:
        free = ",".join(AXES[k] for k in axes)
        raise OutOfRangeError(
            f"{target.reference.motion}: {plant.machine.name} cannot move in {', '.join(blocked)}; choose with --axes "
            f"{free}"
        )


def fitting_scale(plant: Plant, target: Target) -> float:
    """Largest scale of the target's motion within all limits."""
    return largest_scale(target, _axis_limits(plant), MotionDemands(plant))


class Judgement(NamedTuple):
    """A motion against all limits of a plant, and the scale at which its target would be within them."""

    peaks: tuple[Peak, ...]
    fits: float | None  # None: no target


def judge_motion(
    plant: Plant, motion: PlatenMotion, target: Target | None = None, specimen: Array | None = None
) -> Judgement:
    """Demands of an achieved motion on all limits, none refused; raises as `MotionDemands` does.

    specimen (n, 6): its wrench on the platen at B in platen axes [N, N m] in this motion; without it the specimen is
    one rigid body, as it is of the target. Limits are the full ones; the scale at which the target fits keeps the
    reserves of valve flow, strokes and displacements.
    """
    bounds, check = _axis_limits(plant), MotionDemands(plant)
    fits = None if target is None else largest_scale(target, bounds, check)

    def demands(some: slice) -> list[Demand]:
        return check(*(x[some] for x in motion), achieved=True, specimen=None if specimen is None else specimen[some])

    return Judgement(limit_peaks(motion, replace(bounds, reserve=0.0), demands), fits)


def judge_record(plant: Plant, record: "xr.Dataset", *, fits: bool = True) -> Judgement | None:
    """Judgement of a record's achieved motion and, with `fits`, of its target; None without motion or with gaps.

    Raises OutOfRangeError if the actuators cannot hold what is mounted at rest.
    """
    achieved = _motion_of(record, "platen")
    if achieved is None:
        return None
    wanted, target = _motion_of(record, "reference"), None
    if fits and wanted is not None and "scale" in record.attrs:
        attrs = record.attrs
        made = Reference(str(attrs.get("motion", "motion")), "record", float(attrs["scale"]), (), 0.0, 0.0, 0.0)
        target = Target(record["time"].values, *wanted, made)
    return judge_motion(plant, achieved, target, _response_of(plant, record))


def _response_of(plant: Plant, record: "xr.Dataset") -> Array | None:
    """Wrench (n, 6) of the specimen on the platen at B in platen axes, as a simulated record has it; else None."""
    if plant.machine.specimen is None or "specimen_wrench" not in record:
        return None
    wrench = np.asarray(record["specimen_wrench"].values, float)
    return from_interface(plant, wrench) if np.isfinite(wrench).all() else None


def _motion_of(record: "xr.Dataset", who: str) -> PlatenMotion | None:
    names = [f"{who}_{quantity}" for quantity in ("displacement", "velocity", "acceleration")]
    if not all(name in record for name in names):
        return None
    found = PlatenMotion(*(np.ascontiguousarray(record[name].values, float) for name in names))
    return found if all(np.isfinite(x).all() for x in found) else None


def _axis_limits(plant: Plant) -> MotionLimits:
    limits, axes = plant.machine.limits, plant.axes

    def six(values: tuple[float, ...]) -> Array:
        return np.array([values[k] if k in axes else math.inf for k in range(6)])

    rise = stated_strength(plant.machine.parameters).rise
    stated = six(limits.displacement), six(limits.velocity), six(limits.acceleration)
    return MotionLimits(*stated, rise if math.isfinite(rise) else None, limits.stroke_reserve)
