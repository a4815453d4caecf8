"""Calibration: the parameters of a machine, and the errors of its sensors, from a campaign of tests."""

from .fit import Calibration, Subset, calibrate, calibration_numbers
from .knobs import Knob, machine_knobs, with_knobs

__all__ = ["Calibration", "Knob", "Subset", "calibrate", "calibration_numbers", "machine_knobs", "with_knobs"]
