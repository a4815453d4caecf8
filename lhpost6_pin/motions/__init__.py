"""Ground motions: reading, making, finding by name, turning into targets for the table, response spectra."""

from .ac156 import required_spectrum
from .csv import load_csv
from .library import MotionEntry, find_motion, list_motions, motion_entry, motion_options
from .limits import (
    Demand,
    LimitsSummary,
    MotionCheck,
    MotionLimits,
    Peak,
    check_limits,
    largest_scale,
    limit_peaks,
    peak_of_demand,
)
from .motion import AXES, GroundMotion, make_motion
from .motion_options import MotionOption
from .process import Reference, Target, make_target, smooth_step, with_scale
from .readers import load_motion
from .response_spectra import ResponseSpectrum, response_spectrum

__all__ = [
    "AXES",
    "GroundMotion",
    "Demand",
    "LimitsSummary",
    "MotionCheck",
    "MotionEntry",
    "MotionLimits",
    "MotionOption",
    "Peak",
    "Reference",
    "ResponseSpectrum",
    "Target",
    "check_limits",
    "find_motion",
    "largest_scale",
    "limit_peaks",
    "list_motions",
    "motion_entry",
    "load_csv",
    "load_motion",
    "make_motion",
    "make_target",
    "motion_options",
    "peak_of_demand",
    "required_spectrum",
    "response_spectrum",
    "smooth_step",
    "with_scale",
]
