"""Numbers of a search with their intervals, and which of them are at a bound and no estimates."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from ..core.arrays import Array
from ..identification.calibration import FreeParameter
from ..identification.calibration.normal_equations import bounds_of
from ..identification.calibration.sensor_errors import SensorUnknown
from ..machine.library import find_family
from .candidates import Candidate, attributed
from .search_state import AddedEffect, Search

__all__ = [
    *("Absorbing", "Estimate", "absorbing", "amplitude_of", "at_bounds", "covariance_of", "deviations"),
    *("estimates_of", "interval_reach", "is_absorbed", "moved_together", "owns", "sums_of"),
]

AT_BOUND = 1e-6
"""Of an unknown's prior deviation: nearer to a bound it counts as at it. Flat priors are wide."""


@dataclass(frozen=True)
class Estimate:
    """A number with its interval."""

    value: float
    unit: str
    low: float
    high: float


def amplitude_of(one: AddedEffect) -> str:
    """Name of the unknown in proportion to which an effect vanishes."""
    return one.candidate.release or f"{one.candidate.name}.{one.candidate.amplitudes[0].name}"


def owns(one: AddedEffect, unknown: str) -> bool:
    """Whether an unknown is a number of an effect."""
    return unknown == one.candidate.release or unknown.startswith(f"{one.candidate.name}.")


def at_bounds(found: Search) -> tuple[str, ...]:
    """Unknowns at a bound: not estimates."""
    x, problem = found.solution.x, found.problem
    low, high = bounds_of(problem, found.calibration)
    natural = np.zeros(len(x), bool)
    natural[: len(problem.parameters)] = [p.natural for p in problem.parameters]
    near = AT_BOUND * problem.prior
    ends = (x <= low + near) & ~(natural & (low == problem.lowest)) | (x >= high - near)
    return tuple(name for name, end in zip(problem.names, ends, strict=True) if end)


class Absorbing(NamedTuple):
    """A parameter at its bound, or masses shifted in common, which may have taken up a part of an effect."""

    components: frozenset[str]  # that it is of
    family: str  # that it is attributed to; empty for a component's own number, which takes up what its residuals show
    shows_in: frozenset[str]


def absorbing(found: Search) -> tuple[Absorbing, ...]:
    """Parameters of the machine at a bound, or masses shifted in common: a reason to look for an effect there.

    Not of components on which an effect was added: these take up what its form leaves.
    """
    bounded, machine, ends = set(at_bounds(found)), found.problem.machine, []
    occupied = {component for one in found.added for component in one.candidate.components}
    for parameter in (p for p in found.problem.parameters if p.name in bounded):
        family, where = attributed(parameter, machine)
        if (parameter.of or family) and occupied.isdisjoint(where):
            ends.append(Absorbing(frozenset(where), family, frozenset(parameter.shows_in)))
    return (*ends, *moved_together(found))


def moved_together(found: Search) -> tuple[Absorbing, ...]:
    """Masses of the platen along several axes, all far from their stated values in one direction.

    Independent errors seldom agree so: they indicate a mass on the platen. Masses stated alike along all axes are one
    number with one error, which must be farther off. None beside an effect on the platen, whose form masses take up.
    """
    parameters = found.problem.parameters
    moved = [(p, float(x / s)) for p, x, s in zip(parameters, found.solution.x, found.problem.prior, strict=False)]
    masses = [(p, x) for p, x in moved if p.name.startswith("platen.mass[")]
    if len(masses) < 2 or any(c.startswith("platen") for one in found.added for c in one.candidate.components):
        return ()
    alike = len({p.value for p, _ in masses}) == 1
    far = found.numbers.number("outlying.far" if alike else "accept.moved")
    if min(abs(x) for _, x in masses) < far or len({x > 0.0 for _, x in masses}) > 1:
        return ()
    first = masses[0][0]
    family, where = attributed(first, found.problem.machine)
    return (Absorbing(frozenset(where), family, frozenset(first.shows_in)),)


def is_absorbed(candidate: Candidate, ends: Sequence[Absorbing]) -> bool:
    """Whether a part of a candidate may be in parameters at their bounds."""
    family, there = candidate.family, set(candidate.components)
    return any(
        there & end.components and (end.family == family.named if end.family else end.shows_in & {*family.shows_in})
        for end in ends
    )


def covariance_of(found: Search) -> Array:
    """Covariance (p, p) of the unknowns with their floors; the priors of effects' own parameters are flat."""
    problem = found.problem
    floor = found.calibration.number("fit.floor") * problem.stated
    for i, parameter in enumerate(problem.parameters):
        for one in found.added:
            if parameter.name.startswith(f"{one.candidate.name}."):
                stated = parameter.value if parameter.form == "shift" else 1.0
                floor[i] = found.numbers.number("lengths.form") * stated if one.from_lengths else 0.0
    return found.covariance + np.diag(floor**2)


def deviations(found: Search) -> Array:
    """Standard deviations (p,) of the unknowns, `covariance_of`."""
    return np.asarray(np.sqrt(np.diag(covariance_of(found))))


def interval_reach(probability: float) -> float:
    """Half width of an interval that holds the truth with a probability, in standard deviations."""
    return float(ndtri(0.5 + 0.5 * probability))


def estimates_of(found: Search, sd: Array) -> dict[str, Estimate]:
    """All unknowns by name, in their units, with intervals by their standard deviations (p,), `deviations`."""
    every: Sequence[FreeParameter | SensorUnknown] = [*found.problem.parameters, *found.problem.unknowns]
    reach = interval_reach(found.numbers.number("verdict.probability")) * sd
    out = {}
    for one, x, half in zip(every, found.solution.x.tolist(), reach.tolist(), strict=True):
        values = [x, x - half, x + half]
        if isinstance(one, FreeParameter):
            values = [one.at(value) for value in values]
        out[one.name] = Estimate(values[0], one.unit, *sorted(values[1:]))
    return out


def sums_of(found: Search, covariance: Array) -> dict[tuple[str, str], Estimate]:
    """Sums of two unknowns of which the tests determine no more, by their names, with intervals.

    That of a number of a component and an effect of the background in its path, where the channel between them is not
    measured (`Family.sum_with`). A single one of them depends on what a fit does not determine: its interval is none.
    """
    problem = found.problem
    place = {p.name: i for i, p in enumerate(problem.parameters)}
    channels, machine = problem.tests[0].channels, problem.machine
    reach = interval_reach(found.numbers.number("verdict.probability"))
    sums = {}
    for name, entry in machine.parameters.effects.items():
        family = find_family(entry.family)
        if not family.sum_with or family.background_without in channels:
            continue
        second, kinds = f"{name}.{family.shapes[0].name}", {a.name: a.kind for a in machine.actuators}
        owners = dict.fromkeys(owner for c in entry.components for owner in (c, kinds[c]))
        for first in (f"{owner}.{family.sum_with}" for owner in owners):
            if {first, second} <= set(place):
                pair = [place[first], place[second]]
                both, x = [problem.parameters[i] for i in pair], found.solution.x[pair].tolist()
                slope = np.array([one.slope(at) for one, at in zip(both, x, strict=True)])
                value = sum(one.at(at) for one, at in zip(both, x, strict=True))
                half = reach * float(np.sqrt(slope @ covariance[np.ix_(pair, pair)] @ slope))
                sums[first, second] = Estimate(value, both[0].unit, value - half, value + half)
    return sums
