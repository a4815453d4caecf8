"""The measured actuator wrench as a fit compares it: in the frequency domain, over the compared band."""

import numpy as np

from ...core.arrays import Array, Complex
from ...mechanics.plant import Plant
from ...mechanics.pose import plant_motion
from ..inverse_dynamics import leg_wrenches
from ..prepare import MeasuredTest, actuator_forces
from ..residuals import Residuals
from .problem import Problem

__all__ = ["measured_bins", "wrench_bins"]


def wrench_bins(problem: Problem, wrench: Array, test: MeasuredTest) -> Complex:
    """Bins (m, 6) of a wrench (n, 6) at C along a problem's test, as its residual would have them."""
    none = np.zeros((len(wrench), 0))
    return problem.bins(Residuals(wrench, none, none, none, none, none), test)[0][:, :6]


def measured_bins(problem: Problem, plant: Plant, test: MeasuredTest, t: int) -> Complex:
    """Bins (m, 6) of the measured actuator wrench at C of a problem's test in place t; zero where none is measured."""
    force = actuator_forces(plant.machine, test.channels)
    if force is None or not problem.rows("wrench").any():
        return np.zeros((len(problem.frequency[t]), 6), np.complex128)
    wrench = leg_wrenches(plant, plant_motion(plant, test.motion).q, force).sum(axis=1)
    return wrench_bins(problem, wrench, test)
