"""The search: refit, screen the library, add a candidate that passes, refit everything jointly, and repeat.

A candidate passes if it gains enough, also in cross-validation, and explains enough of the residual beyond noise. Of
those that pass, the one (or two) that explains most in a joint fit with all parameters and sensor errors is added.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..core.progress import Progress, between
from ..identification.calibration.fit import solve
from ..identification.calibration.normal_equations import NormalEquations, bounds_of
from ..identification.calibration.problem import Problem
from ..machine.parameters import Parameters
from .acceptance import gate
from .add_effects import add_effect, refined
from .candidates import Candidate
from .linearisation import Linearisation, linearise
from .screening import screen
from .search_state import Search

__all__ = ["refit", "search"]


def refit(
    problem: Problem, begin: NormalEquations, numbers: Parameters, calibration: Parameters, progress: Progress
) -> Search:
    """Start of a search: parameters and sensor errors fitted to a campaign, without any effect.

    begin are its normal equations where all unknowns are zero. The residual is then weighed by the noise at the fitted
    parameters: soft oil, for instance, amplifies it in the flows.
    """
    zero = np.zeros(len(problem.prior))
    first = solve(problem, calibration, zero, between(progress, 0.0, 0.85), first=begin, frugal=True)
    before, now = problem.noise_at(zero), problem.noise_at(first.x)
    scale = 1.0 / np.sqrt(np.maximum(1.0 + now - before, 0.25))  # noise has other sources than the sensors
    scaled = problem.scaled(scale)
    rest = first.x, between(progress, 0.85, 1.0), first.normal.scaled(scaled, scale)
    solution = solve(scaled, calibration, *rest, frugal=True, settled=True)
    return Search(scaled, solution, solution, numbers, calibration)


def search(found: Search, keep: Callable[[Search], None], progress: Progress) -> tuple[Search, Linearisation]:
    """Search the library for missing effects, from a refit or from the state of an interrupted search.

    Returns the search and its linearisation. keep is called with the search whenever an effect is added.
    """
    most = int(found.numbers.number("accept.effects"))
    for k in range(len(found.rounds), most + 1):
        low, high = (i / (most + 1) for i in (k, k + 1))
        linear = linearise(found.solution, found.calibration, replicas=True)
        one = screen(found, linear, between(progress, low, 0.5 * (low + high)))
        found = replace(found, rounds=(*found.rounds, one))
        if k == most:
            break
        more = add_effect(found, linear, between(progress, 0.5 * (low + high), high))
        if more is None:
            break
        found = more
        keep(found)
    if len(found.added) > 1 and (fewer := _pruned(found)) is not found:
        found, linear = fewer, linearise(fewer.solution, found.calibration)
    progress(1.0)
    return found, linear


def _pruned(found: Search) -> Search:
    """The search without effects that have become superfluous since others were added."""
    for one in found.added[:-1]:
        less = _without(found, one.candidate)
        if less.objective - found.objective + one.from_lengths < gate(one.candidate.family, found.numbers):
            return _pruned(refined(less, lambda share: None))
    return found


def _without(found: Search, candidate: Candidate) -> Search:
    """The search without one of its effects, everything else refitted."""
    problem = found.problem
    if candidate.release:
        less = problem.with_free(candidate.release, None)
    else:
        parameters = tuple(k for k in problem.parameters if not k.name.startswith(f"{candidate.name}."))
        less = problem.with_machine(problem.machine.without_effect(candidate.name), parameters)
    place = dict(zip(problem.names, found.solution.x, strict=True))
    start = np.clip([place[name] for name in less.names], *bounds_of(less, found.calibration))
    kept = tuple(one for one in found.added if one.candidate.name != candidate.name)
    return replace(found.solved(less, start, lambda share: None, settled=True), added=kept)
