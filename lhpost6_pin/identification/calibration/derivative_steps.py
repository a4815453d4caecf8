"""Steps of the unknowns of a calibration for derivatives by differences."""

from collections.abc import Sequence

import numpy as np

from ...core.arrays import Array
from .free_parameters import FreeParameter
from .sensor_errors import SensorUnknown

__all__ = ["derivative_steps"]


def derivative_steps(every: Sequence[FreeParameter | SensorUnknown], share: float) -> Array:
    """Steps of the coordinates (p,) for derivatives: a share of each one's deviation, of delays the same time.

    A one-sided difference of a shift in time is the derivative half a step later. Where residuals show only a sum of
    delays, unequal steps would seem to tell its parts apart: a valve's delay is added, a sensor's removed.
    """
    steps = np.array([one.step or share * one.sd for one in every])
    later = np.array([_later(one) for one in every])
    if (late := later != 0.0).any():
        steps[late] = np.abs(steps * later)[late].min() / later[late]
    return steps


def _later(one: FreeParameter | SensorUnknown) -> float:
    """Time by which a channel comes later per unit of a coordinate; zero of what is no delay."""
    if isinstance(one, SensorUnknown):
        return -1.0 if one.kind == "delay" else 0.0
    return one.slope(0.0) if one.name.endswith(".valve_delay") else 0.0
