"""Numbers of a search with their intervals, and which of them are at a bound and no estimates."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from ..core.arrays import Array
from ..identification.calibration import FreeParameter
from ..identification.calibration.normal_equations import bounds_of
from ..identification.calibration.sensor_errors import SensorUnknown
from ..machine.parameters import Parameters
from .search_state import AddedEffect, Search

__all__ = ["Estimate", "amplitude_of", "at_bounds", "deviations", "estimates_of", "interval_reach", "owns"]

AT_BOUND = 1e-3
"""Of an unknown's prior deviation: nearer to a bound it counts as at it."""


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


def deviations(found: Search) -> Array:
    """Standard deviations (p,) of the unknowns with their floors; the priors of effects' own parameters are flat."""
    problem = found.problem
    floor = found.calibration.number("fit.floor") * problem.stated
    for i, parameter in enumerate(problem.parameters):
        for one in found.added:
            if parameter.name.startswith(f"{one.candidate.name}."):
                stated = parameter.value if parameter.form == "shift" else 1.0
                floor[i] = found.numbers.number("lengths.form") * stated if one.from_lengths else 0.0
    covariance = np.linalg.inv(found.solution.normal.posterior(problem.prior))
    return np.asarray(np.sqrt(np.diag(covariance) + floor**2))


def interval_reach(numbers: Parameters) -> float:
    """Half width of the intervals of `verdict.probability`, in standard deviations."""
    return float(norm.ppf(0.5 + 0.5 * numbers.number("verdict.probability")))


def estimates_of(found: Search, sd: Array) -> dict[str, Estimate]:
    """All unknowns by name, in their units, with intervals by their standard deviations (p,), `deviations`."""
    every: Sequence[FreeParameter | SensorUnknown] = [*found.problem.parameters, *found.problem.unknowns]
    reach = interval_reach(found.numbers) * sd
    out = {}
    for one, x, half in zip(every, found.solution.x.tolist(), reach.tolist(), strict=True):
        values = [x, x - half, x + half]
        if isinstance(one, FreeParameter):
            values = [one.at(value) for value in values]
        out[one.name] = Estimate(values[0], one.unit, *sorted(values[1:]))
    return out
