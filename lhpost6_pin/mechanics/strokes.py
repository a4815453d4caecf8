"""Actuators that reach the end of their stroke in a motion, simulated or measured."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core.arrays import Array
from .plant import Plant
from .pose import leg_displacements

__all__ = ["StrokeEnd", "stroke_ends"]

_REACHED = 0.999
"""Share of a stroke from which it counts as reached: sensors and rounding."""


class StrokeEnd(NamedTuple):
    """An actuator at the end of its stroke."""

    actuator: str
    time: float  # first [s]
    reached: float  # largest elongation either way [m]
    stroke: float  # [m]

    def __str__(self) -> str:
        """A sentence."""
        return (
            f"{self.actuator} reached the end of its stroke of {self.stroke:g} m at {self.time:.3f} s "
            f"(up to {self.reached:.4g} m)"
        )


def stroke_ends(plant: Plant, time: ArrayLike, displacement: Array) -> list[StrokeEnd]:
    """Actuators that reach their stroke along a motion of C and Euler angles (n, 6), in file order; time (n,) [s]."""
    legs, _ = leg_displacements(plant, displacement)
    moved, found = np.abs(legs[:, : plant.spools]), []
    for actuator, size in zip(plant.machine.actuators, moved.T, strict=True):
        there = size >= _REACHED * actuator.stroke
        if there.any():
            first = float(np.asarray(time, float)[int(there.argmax())])
            found.append(StrokeEnd(actuator.name, first, float(np.nanmax(size)), actuator.stroke))
    return found
