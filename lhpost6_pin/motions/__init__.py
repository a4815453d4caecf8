"""Ground motions: reading, making, finding by name, turning into targets for the table, response spectra."""

from .ac156 import required_spectrum
from .adjust import adjust_motion, with_rotation, with_taper, with_time_scale
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
)
from .motion import AXES, GroundMotion, make_motion
from .motion_options import MotionOption
from .process import Reference, Target, make_target, smooth_step, with_scale
from .readers import load_motion
from .response_spectra import ResponseSpectrum, response_spectrum
from .spectral_match import SpectrumMatch, match_spectrum, spectrum_errors
from .spectrum_file import load_spectrum
from .target_spectrum import TargetSpectrum

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
    "SpectrumMatch",
    "Target",
    "TargetSpectrum",
    "adjust_motion",
    "check_limits",
    "find_motion",
    "largest_scale",
    "limit_peaks",
    "list_motions",
    "motion_entry",
    "load_csv",
    "load_motion",
    "load_spectrum",
    "make_motion",
    "make_target",
    "match_spectrum",
    "motion_options",
    "required_spectrum",
    "response_spectrum",
    "smooth_step",
    "spectrum_errors",
    "with_rotation",
    "with_scale",
    "with_taper",
    "with_time_scale",
]
