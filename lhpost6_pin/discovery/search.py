"""The search: refit, screen the library, add what passes, refit everything jointly, and again.

A candidate passes if it gains enough, on tests that it was not fitted on, too, and explains enough of what is more than
noise. Of those that pass the one is added, or the two at once, that explain most when their numbers are fitted together
with all known parameters and sensor errors.
"""

from collections.abc import Callable

import numpy as np

from ..core.progress import Progress, between
from ..identification.calibration.fit import solve
from ..identification.calibration.normal_equations import NormalEquations, bounds_of
from ..identification.calibration.prepare import PreparedProblem
from ..machine.parameters import Parameters
from .acceptance import gate
from .add_effects import add_effect, refined
from .candidates import Candidate
from .screening import linearise, screen
from .search_state import Linearisation, Search

__all__ = ["refit", "search"]


def refit(ready: PreparedProblem, begin: NormalEquations, calibration: Parameters, progress: Progress) -> Search:
    """Where a search begins: known parameters and sensor errors fitted to a prepared campaign, without any effect.

    begin are its normal equations where all unknowns are zero; calibration are numbers of `models/procedures`.
    """
    start = np.zeros(len(ready.problem.prior))
    share = between(progress, 0.0, 0.85)
    first = solve(ready.problem, ready.replicas, calibration, start, share, first=begin, frugal=True)
    return _weighed_anew(Search(ready, first, first), calibration, between(progress, 0.85, 1.0))


def search(
    found: Search, calibration: Parameters, numbers: Parameters, keep: Callable[[Search], None], progress: Progress
) -> tuple[Search, Linearisation]:
    """Search the library for what the machine lacks, from a refit or from where an earlier search was interrupted.

    Returns also what is needed to go on from there; calibration and numbers are those of `models/procedures`. keep is
    called with the search each time that it has come further.
    """
    most = int(numbers.number("accept.effects"))
    for k in range(len(found.rounds), most + 1):
        low, high = (i / (most + 1) for i in (k, k + 1))
        linear = linearise(found.solution, calibration, found.ready.replicas)
        one = screen(found, linear, numbers, between(progress, low, 0.5 * (low + high)))
        found.rounds.append(one)
        if k == most:
            break
        more = add_effect(found, linear, calibration, numbers, between(progress, 0.5 * (low + high), high))
        if more is None:
            break
        found = more
        keep(found)
    if len(found.added) > 1:
        fewer = _pruned(found, calibration, numbers)
        found, linear = fewer, linear if fewer is found else linearise(fewer.solution, calibration)
    progress(1.0)
    return found, linear


def _pruned(found: Search, calibration: Parameters, numbers: Parameters) -> Search:
    """The search without what it can do without, now that more has been added: helpers of what was found later."""
    for one in found.added[:-1]:
        less = _without(found, one.candidate, calibration)
        if less.objective - found.objective + one.from_lengths < gate(one.candidate.family, numbers):
            return _pruned(refined(less, calibration, lambda share: None), calibration, numbers)
    return found


def _without(found: Search, candidate: Candidate, calibration: Parameters) -> Search:
    """The search without one of its effects, everything else refitted."""
    problem = found.problem
    if candidate.release:
        ready = found.ready.without_free(candidate.release)
    else:
        parameters = tuple(k for k in problem.parameters if not k.name.startswith(f"{candidate.name}."))
        ready = found.ready.with_machine(problem.machine.without_effect(candidate.name), parameters)
    place = dict(zip(problem.names, found.solution.x, strict=True))
    start = np.array([place[name] for name in ready.problem.names])
    low, high = bounds_of(ready.problem, calibration)
    solution = solve(
        *(ready.problem, ready.replicas, calibration, np.clip(start, low, high), lambda share: None),
        found.solution.normal,
        frugal=True,
        settled=True,
    )
    kept = [one for one in found.added if one.candidate.name != candidate.name]
    return Search(ready, solution, found.refit, kept, found.rounds)


def _weighed_anew(found: Search, calibration: Parameters, progress: Progress) -> Search:
    """The refit with noise of the power that it has with the numbers found: soft oil makes more of it in the flows."""
    ready, first = found.ready, found.solution
    before, now = (ready.problem.noise_at(ready.noisy, x) for x in (np.zeros(len(first.x)), first.x))
    scale = 1.0 / np.sqrt(np.maximum(1.0 + now - before, 0.25))  # noise has more in it than the sensors'
    ready = ready.scaled(scale)
    known = first.normal.scaled(ready.problem, scale)
    solution = solve(ready.problem, ready.replicas, calibration, first.x, progress, known, frugal=True, settled=True)
    return Search(ready, solution, solution)
