"""Ground motions: reading, making, finding by name, turning into targets for the table, response spectra."""

from lhpost6_pin.motions.ac156 import required_spectrum
from lhpost6_pin.motions.at2 import load_at2
from lhpost6_pin.motions.csv import load_csv
from lhpost6_pin.motions.library import MotionEntry, find_motion, list_motions
from lhpost6_pin.motions.limits import (
    LegUtilisation,
    LimitsSummary,
    MotionLimits,
    check_limits,
    largest_scale,
)
from lhpost6_pin.motions.motion import AXES, GroundMotion, make_motion
from lhpost6_pin.motions.process import Reference, Target, make_target, with_scale
from lhpost6_pin.motions.readers import load_motion
from lhpost6_pin.motions.spectra import ResponseSpectrum, response_spectrum
from lhpost6_pin.motions.v1 import load_v1

__all__ = [
    "AXES",
    "GroundMotion",
    "LegUtilisation",
    "LimitsSummary",
    "MotionEntry",
    "MotionLimits",
    "Reference",
    "ResponseSpectrum",
    "Target",
    "check_limits",
    "find_motion",
    "largest_scale",
    "list_motions",
    "load_at2",
    "load_csv",
    "load_motion",
    "load_v1",
    "make_motion",
    "make_target",
    "required_spectrum",
    "response_spectrum",
    "with_scale",
]
