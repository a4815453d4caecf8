"""The measured actuator wrench as a fit compares it: in the frequency domain, over the compared band."""

import numpy as np

from ...core.arrays import Complex
from ...mechanics.plant import Plant
from ...mechanics.pose import plant_motion
from ..inverse_dynamics import leg_wrenches
from ..prepare import MeasuredTest, actuator_forces
from ..residuals import Residuals
from .problem import Problem

__all__ = ["measured_bins"]


def measured_bins(problem: Problem, plant: Plant, test: MeasuredTest, t: int) -> Complex:
    """Bins (m, 6) of the measured actuator wrench at C of a problem's test in place t; zero where none is measured."""
    force = actuator_forces(plant.machine, test.channels)
    if force is None or not problem.rows("wrench").any():
        return np.zeros((len(problem.frequency[t]), 6), np.complex128)
    wrench = leg_wrenches(plant, plant_motion(plant, test.motion).q, force).sum(axis=1)
    none = np.zeros((len(wrench), 0))
    return problem.bins(Residuals(wrench, none, none, none, none, none), test)[0][:, :6]
