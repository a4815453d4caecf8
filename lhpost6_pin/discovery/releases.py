"""Releases: parameters and sensor errors that are set free of what is stated of them, as candidates of a search.

In every refit known parameters stay within a few of their stated deviations, and sensor errors within their ranges:
what is missing must not bend them beyond recognition. One that truly is far off is found as an effect is: by what it
gains to set it free.
"""

import numpy as np
from numpy.typing import NDArray

from ..data.channels import LAYOUT
from ..identification.calibration import FreeParameter
from ..identification.calibration.problem import Problem
from ..identification.calibration.sensor_errors import SensorUnknown
from ..machine.library import find_family
from .candidates import Candidate
from .scores import Background, Block

__all__ = ["block_of", "list_releases"]

Array = NDArray[np.float64]

_PARAMETER = {
    "flow": "flow_curve_error",
    "flow_curve": "flow_curve_error",
    "bulk_modulus": "entrained_air",
    "chamber_a": "dead_volume",
    "chamber_b": "dead_volume",
    "leakage": "piston_leakage",
    "viscous": "local_viscous",
    "pad_friction": "bearing_friction",
    "polytropic_index": "gas_heat_transfer",
    "mass": "added_mass",
    "inertia": "inertia_coupling",
}
"""Family of a parameter that is far off."""


def list_releases(problem: Problem) -> tuple[Candidate, ...]:
    """All parameters and sensor errors that are not free yet and have a name when they are far off."""
    found = []
    for parameter in problem.parameters:
        family = "" if parameter.of else _PARAMETER.get(parameter.name.split(".")[-1].split("[")[0], "")
        if family and parameter.name not in problem.free:
            found.append(Candidate(find_family(family), _where(problem, parameter), (), parameter.name))
    for unknown in problem.unknowns:  # those of the platen's motion were asked of each other before
        if unknown.name in problem.free or (unknown.kind == "delay" and unknown.column >= 0):
            continue
        if unknown.kind == "delay" or LAYOUT[unknown.channel].role == "sensor":
            found.append(Candidate(find_family(_family(unknown)), (unknown.name,), (), unknown.name))
    return tuple(found)


def _family(unknown: SensorUnknown) -> str:
    return "channel_delay" if unknown.kind == "delay" else LAYOUT[unknown.channel].fault


def _where(problem: Problem, parameter: FreeParameter) -> tuple[str, ...]:
    section = parameter.name.split(".")[0]
    return tuple(c.name for c in problem.machine.components if c.kind == section) or (section,)


def block_of(background: Background, place: int) -> Block:
    """Block of one unknown of the background, once more: without its prior."""
    cross = background.matrix[:, :, place : place + 1]
    return Block(cross, cross[:, place : place + 1], background.side[:, place : place + 1])
