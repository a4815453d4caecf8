"""Contests: candidates fitted jointly in one another's place, the simplest of those that explain alike, its credit."""

from collections.abc import Sequence

import numpy as np

from ..core.arrays import Array
from ..core.progress import Progress, between, split
from ..identification.calibration.fit import objective_at
from ..identification.calibration.normal_equations import bounds_of
from ..identification.calibration.problem import Problem
from .acceptance import gate, squares_by_column
from .candidates import Candidate
from .estimates import at_bounds
from .joint_fit import JointFit, fit_from_rival, fit_jointly, refined
from .search_state import AddedEffect, FittedCandidate, Scored, Search, fitted_machine

__all__ = ["best_of", "loss_without", "removed"]


def best_of(found: Search, rivals: Sequence[Scored], progress: Progress, least: float | None = None) -> Search | None:
    """The search with the best of these candidates, all fitted jointly; None if none gains `least`, or its gate."""
    numbers, parts = found.numbers, split(between(progress, 0.0, 0.7), len(rivals))
    fitted = _fits_of(found, rivals, parts)
    before, *left = (one.objective for one in (found, *fitted))
    gates = [gate(one.candidate.family, numbers) if least is None else least for one in rivals]
    gaining = [i for i, required in enumerate(gates) if before - left[i] >= required]
    gains = {i: min(before - left[i], loss_without(fitted[i], rivals[i].candidate)) for i in gaining}
    passed = [i for i in gaining if gains[i] >= gates[i]]
    if not passed:
        return None
    lowest = min(left[i] for i in passed)
    leading = fitted[left.index(lowest)]
    apart, near = _apart(found, leading), _apart(found, leading, "accept.simplest")
    settled = _settled([fitted[i].power for i in passed], numbers.number("accept.settled"))
    needless = _needless(rivals, left, numbers.number("accept.simpler"))
    alike = [i for i in passed if left[i] - lowest < near and fitted[i].power <= settled and i not in needless]
    alike = alike or [i for i in passed if left[i] == lowest]
    best = min(alike, key=lambda i: (_complexity(fitted[i], rivals[i].candidate), left[i]))
    order = sorted(range(len(left)), key=lambda i: (i != best, left[i]))
    beyond = [apart if i != best and fitted[i].power > settled else 0.0 for i in range(len(fitted))]
    contest = tuple(
        FittedCandidate(
            rivals[i].candidate, max(float(left[i] - left[best]), beyond[i]), fitted_machine(fitted[i].solution)
        )
        for i in order
    )
    more = refined(fitted[best], between(progress, 0.7, 1.0))
    fall = squares_by_column(found.residual) - squares_by_column(more.residual)
    place, tried = len(found.rounds) - 1, len(found.rounds[-1].scored)
    return more.with_effect(AddedEffect(rivals[best].candidate, gains[best], place, tried, contest, fall, apart))


def _fits_of(found: Search, rivals: Sequence[Scored], parts: Sequence[Progress]) -> list[Search]:
    """Joint fits of candidates; those confused with the best of them, but far behind it, from its numbers, too."""
    fits: list[JointFit] = []
    for rival, part in zip(rivals, parts, strict=True):
        fits.append(fit_jointly(found, rival, part, min(fits, key=lambda fit: fit.search.objective, default=None)))
    fitted = [fit.search for fit in fits]
    lead = min(range(len(fitted)), key=lambda i: fitted[i].objective)
    first, best = rivals[lead].candidate, fitted[lead]
    apart = _apart(found, best)
    for i, one in enumerate(rivals):
        confused = one.candidate.family.named in first.family.confused_with
        if confused and one.candidate.components == first.components and fitted[i].objective - best.objective >= apart:
            again = fit_from_rival(found, one, rivals[lead], best, lambda share: None)
            if again is not None and again.objective < fitted[i].objective:
                fitted[i] = again
    return fitted


def _apart(found: Search, best: Search, share: str = "accept.alike") -> float:
    """Log-likelihood within which two families explain alike: of a large gain a small share is not decisive.

    No real law is exactly that of the library. Nor is the simpler of two the better one where it is behind by more than
    the share `accept.simplest`: though not told apart, the other is then named first.
    """
    n = found.numbers.number
    return max(n("accept.apart"), n(share) * (found.objective - best.objective))


def _settled(powers: Sequence[float], settled: float) -> float:
    """Power of the residual up to which candidates that leave these powers are alike.

    One that leaves much where another leaves noise (up to `settled`), in however few bins, is not like it; where each
    leaves much, another effect being missing, one that leaves as many times more.
    """
    least = min(powers)
    return settled if least <= settled else settled * least


def _needless(rivals: Sequence[Scored], left: Sequence[float], simpler: float) -> set[int]:
    """Places of candidates on more components than another of their family, but hardly a better fit."""
    every = list(enumerate(one.candidate for one in rivals))
    pairs = [(i, j) for i, one in every for j, other in every if other.is_part_of(one)]
    return {i for i, j in pairs if left[j] - left[i] < simpler}


def _complexity(fit: Search, candidate: Candidate) -> tuple[bool, int, int]:
    """By which the simplest of candidates that explain alike is chosen.

    A parameter of the model comes first; then a form with fewest numbers at their bounds, to which it had to be
    stretched; then one with fewest numbers.
    """
    bounded = sum(name.startswith(f"{candidate.name}.") for name in at_bounds(fit))
    return not candidate.release, bounded, len(candidate.family.shapes)


def loss_without(found: Search, candidate: Candidate) -> float:
    """By how much the objective rises without one of the candidates, all other unknowns as they are.

    What a fit gains beyond that is due to the others, which may only have ended elsewhere.
    """
    return objective_at(*removed(found, candidate)) - found.objective


def removed(found: Search, candidate: Candidate) -> tuple[Problem, Array]:
    """The problem of a search without one of its candidates, and all other unknowns (p,) as they are, within bounds."""
    problem = found.problem
    if candidate.release:
        less = problem.with_free(candidate.release, None)
    else:
        parameters = tuple(k for k in problem.parameters if not k.name.startswith(f"{candidate.name}."))
        less = problem.with_machine(problem.machine.without_effect(candidate.name), parameters)
    place = dict(zip(problem.names, found.solution.x, strict=True))
    return less, np.clip([place[name] for name in less.names], *bounds_of(less, found.calibration))
