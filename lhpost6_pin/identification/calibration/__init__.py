"""Calibration: the parameters of a machine, and the errors of its sensors, from a campaign of tests."""

from .fit import calibrate
from .free_parameters import FreeParameter, drawn_coordinates, machine_parameters, with_parameters
from .result import Calibration, Subset, calibration_numbers
from .usable_tests import usable_tests

__all__ = ["Calibration", "FreeParameter", "Subset", "calibrate", "calibration_numbers", "drawn_coordinates"]
__all__ += ["machine_parameters", "usable_tests", "with_parameters"]
