"""The limits of a motion on a machine, and the demand of a target over each of them.

Limits are the displacement, velocity and acceleration of C by axis (section `limits` of the machine file, Table 2.2),
the stroke of each actuator, and its unloaded velocity at full spool less `limits.valve_reserve`. The capacity of the
actuators is computed in `mechanics.capacity`; the comparison and the largest scale that fits, in `motions.limits`.
"""

import math

import numpy as np

from ..core.arrays import Array
from ..core.errors import OutOfRangeError
from ..core.names import AXES
from ..mechanics.capacity import make_actuator_check
from ..mechanics.plant import Plant
from ..motions import LimitsSummary, MotionLimits, Target, check_limits

__all__ = ["check_motion_limits"]


def check_motion_limits(plant: Plant, target: Target) -> LimitsSummary:
    """Demand of a target over the capacity of a plant, by limit.

    Raises OutOfRangeError that names each limit exceeded and the largest scale that fits; for a guided machine also
    where the target moves an axis that is not free.
    """
    machine, axes = plant.machine, plant.axes
    blocked = [AXES[k] for k in range(6) if k not in axes and np.any(target.displacement[:, k] != 0.0)]
    if blocked:
        free = ",".join(AXES[k] for k in axes)
        raise OutOfRangeError(
            f"{target.reference.motion}: {machine.name} cannot move in {', '.join(blocked)}; choose with --axes {free}"
        )

    def six(values: tuple[float, ...]) -> Array:
        return np.array([values[k] if k in axes else math.inf for k in range(6)])

    limits = machine.limits
    bounds = MotionLimits(six(limits.displacement), six(limits.velocity), six(limits.acceleration))
    return check_limits(target, bounds, make_actuator_check(plant))
