"""Releases: parameters and sensor errors released from their priors, as candidates of a search.

In every refit parameters stay within a few prior deviations, and sensor errors within their ranges: a missing effect
must not bias them. One that truly is far off is identified like an effect, by the gain of its release.
"""

from ..data.channels import LAYOUT
from ..identification.calibration.problem import Problem
from ..machine.library import find_family
from .candidates import Candidate
from .scores import Background, Block

__all__ = ["block_of", "list_releases"]


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
    """All parameters and sensor errors that are not released yet and correspond to a family of the library."""
    found = []
    for parameter in problem.parameters:
        section, _, name = parameter.name.partition(".")
        family = "" if parameter.of else _PARAMETER.get(name.split(".")[-1].split("[")[0], "")
        if family and parameter.name not in problem.free:
            where = tuple(c.name for c in problem.machine.components if c.kind == section) or (section,)
            found.append(Candidate(find_family(family), where, (), parameter.name))
    for unknown in problem.unknowns:  # those of the platen's motion were cross-checked before
        if unknown.name in problem.free or (unknown.kind == "delay" and unknown.column >= 0):
            continue
        if unknown.kind == "delay" or LAYOUT[unknown.channel].role == "sensor":
            family = "channel_delay" if unknown.kind == "delay" else LAYOUT[unknown.channel].fault
            found.append(Candidate(find_family(family), (unknown.name,), (), unknown.name))
    return tuple(found)


def block_of(background: Background, place: int) -> Block:
    """Block of one unknown of the background, repeated without its prior."""
    cross = background.matrix[:, :, place : place + 1]
    return Block(cross, cross[:, place : place + 1], background.side[:, place : place + 1])
