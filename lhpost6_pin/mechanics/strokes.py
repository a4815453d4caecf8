"""Actuators that reach the end of their stroke in a motion, simulated or measured."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.extremes import finite_peaks
from .plant import Plant

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


def stroke_ends(plant: Plant, time: ArrayLike, elongation: Array) -> list[StrokeEnd]:
    """Actuators that reach their stroke at a time (n,) [s], in file order, of elongations (n, n_actuators) [m]."""
    found = []
    for actuator, peak, moved in zip(plant.machine.actuators, finite_peaks(elongation), elongation.T, strict=True):
        if peak >= (reached := _REACHED * actuator.stroke):
            first = float(np.asarray(time, float)[int((np.abs(moved) >= reached).argmax())])
            found.append(StrokeEnd(actuator.name, first, float(peak), actuator.stroke))
    return found
