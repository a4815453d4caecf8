"""Calibration: the parameters of a machine, and the errors of its sensors, from a campaign of tests."""

from .fit import calibrate
from .free_parameters import FreeParameter, drawn_coordinates, machine_parameters, with_parameters
from .result import Calibration, Subset, calibration_numbers

__all__ = ["Calibration", "FreeParameter", "Subset", "calibrate", "calibration_numbers", "drawn_coordinates"]
__all__ += ["machine_parameters", "with_parameters"]
