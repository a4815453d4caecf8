"""Calibration: the parameters of a machine, and the errors of its sensors, from a campaign of tests."""

from .fit import calibrate
from .free_parameters import Knob, drawn_coordinates, machine_knobs, with_knobs
from .result import Calibration, Subset, calibration_numbers

__all__ = [
    "Calibration",
    "Knob",
    "Subset",
    "calibrate",
    "calibration_numbers",
    "drawn_coordinates",
    "machine_knobs",
    "with_knobs",
]
