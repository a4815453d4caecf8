"""Adding an effect: the best candidates are fitted jointly with all parameters, and the best of these fits is kept.

Two effects are added at once where no single one does as well.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..core.arrays import Array
from ..core.progress import Progress, between
from ..identification.calibration.free_parameters import FreeParameter
from ..identification.calibration.problem import Problem
from .acceptance import gate, squares_by_column
from .candidates import Candidate
from .linearisation import Linearisation
from .screening import score_pairs
from .search_state import AddedEffect, FittedCandidate, Scored, Search, best_per_family, fitted_machine

__all__ = ["add_effect", "refined", "with_candidate"]


def add_effect(found: Search, linear: Linearisation, progress: Progress) -> Search | None:
    """The search with one more effect, or with two where no one does as well; None if nothing is to be added."""
    n, scored = found.numbers.number, found.rounds[-1].scored
    passed = [one for one in scored if not one.refused]
    more = _add(found, passed, between(progress, 0.0, 0.7)) if passed else None
    strong = [one for one in scored if one.score.gain >= n("accept.look") and not one.candidate.release]
    few = best_per_family(strong, named=True)[: int(n("accept.paired"))]
    beyond = sorted((one.gain - gate(one.candidate.family, found.numbers) for one in few), reverse=True)
    hopeless = len(few) < 2 or beyond[0] + beyond[1] < 0.0
    full = len(found.added) + 2 > n("accept.effects")
    if hopeless or full or (more is not None and more.power < n("accept.settled")):
        return more
    first = score_pairs(found, linear, [one.candidate for one in few])[0]
    names = {few[i].candidate.family.named for i in first.places}
    if first.refused or (more is not None and more.added[-1].candidate.family.named in names):
        return more
    two = [
        replace(few[i], score=replace(few[i].score, amplitude=a))
        for i, a in zip(first.places, first.amplitudes, strict=True)
    ]
    return _better(found, more, two, between(progress, 0.7, 1.0))


def _better(found: Search, more: Search | None, two: Sequence[Scored], progress: Progress) -> Search | None:
    """The search with one more effect, or with two others if each of them is worth its threshold."""
    both = found
    for i, one in enumerate(two):
        rivals = [one, *_in_its_place(both, one)]
        both = _best_of(both, rivals, between(progress, 0.5 * i, 0.5 * (i + 1)), least=-np.inf) or both
    gates = [gate(one.candidate.family, found.numbers) for one in two]
    if found.objective - both.objective < sum(gates):
        return more
    return both if more is None or more.objective - both.objective >= max(gates) else more


def _in_its_place(found: Search, one: Scored) -> list[Scored]:
    """The best of other families on the same components that nearly match a candidate, but for what was added."""
    near = found.numbers.number("accept.near") * one.gain
    taken = {one.candidate.family.name, *(a.candidate.family.name for a in found.added)}
    some = [o for o in found.rounds[-1].scored if o.gain >= near and not o.candidate.release]
    there = best_per_family([o for o in some if o.candidate.components == one.candidate.components])
    rivals = [o for o in there if o.candidate.family.name not in taken]
    return rivals[: int(found.numbers.number("accept.rivals")) - 1]


def _add(found: Search, passed: Sequence[Scored], progress: Progress) -> Search | None:
    """Add the best candidate: the first of each family with nearly the largest gain is fitted jointly.

    Of those that explain the campaign equally well the simplest is kept. Where none of them passes after its joint fit,
    those next in gain are tried; None if none of these does either.
    """
    n, waiting = found.numbers.number, best_per_family(passed)
    batches = int(n("accept.batches"))
    for batch in range(batches):
        near = n("accept.near") * waiting[0].gain if waiting else 0.0
        rivals = [one for one in waiting if one.gain >= near][: int(n("accept.rivals"))]
        if not rivals:
            return None
        waiting = [one for one in waiting if one not in rivals]
        if (best := _best_of(found, rivals, between(progress, batch / batches, (batch + 1) / batches))) is not None:
            return best
    return None


def _best_of(found: Search, rivals: Sequence[Scored], progress: Progress, least: float | None = None) -> Search | None:
    """The search with the best of these candidates, all fitted jointly; None if none gains `least`, or its gate."""
    numbers, fitted = found.numbers, []
    for i, rival in enumerate(rivals):
        share = between(progress, 0.7 * i / len(rivals), 0.7 * (i + 1) / len(rivals))
        fitted.append(_fit_jointly(found, rival, share))
    before, *left = (one.objective for one in (found, *fitted))
    gates = [gate(one.candidate.family, numbers) if least is None else least for one in rivals]
    passed = [i for i, required in enumerate(gates) if before - left[i] >= required]
    if not passed:
        return None
    lowest = min(left[i] for i in passed)
    # no real law is exactly that of the library: of a large gain a small share is not decisive
    apart = max(numbers.number("accept.apart"), numbers.number("accept.alike") * (before - lowest))
    alike = [i for i in passed if left[i] - lowest < apart]
    # the simplest of them: a parameter of the model first, then the fewest numbers
    best = min(alike, key=lambda i: (not rivals[i].candidate.release, len(rivals[i].candidate.family.shapes), left[i]))
    order = sorted(range(len(left)), key=lambda i: (i != best, left[i]))
    contest = tuple(
        FittedCandidate(rivals[i].candidate, float(left[i] - left[best]), fitted_machine(fitted[i].solution))
        for i in order
    )
    more = refined(fitted[best], between(progress, 0.7, 1.0))
    fall = squares_by_column(found.residual) - squares_by_column(more.residual)
    place, tried = len(found.rounds) - 1, len(found.rounds[-1].scored)
    gain = before - left[best]
    return more.with_effect(AddedEffect(rivals[best].candidate, gain, place, tried, contest, fall, apart))


def refined(found: Search, progress: Progress) -> Search:
    """The search with all derivatives evaluated again."""
    return found.solved(found.problem, found.solution.x, progress)


def _fit_jointly(found: Search, one: Scored, progress: Progress) -> Search:
    """The search with a candidate fitted jointly with all parameters, from its linear estimate.

    Where the residual stays large, it is fitted from the stated parameters, too, since a missing effect may have biased
    them out of reach; and from other shapes that explain nearly as much.
    """
    n = found.numbers.number
    same = [s for s in found.rounds[-1].scored if s.candidate.of_one_form(one.candidate) and s is not one]
    others = [s for s in same if s.gain >= n("accept.near") * one.gain][: int(n("accept.shapes"))]
    starts = [(one, False), (one, True), *((other, False) for other in others)]
    fits: list[Search] = []
    for i, (start, afresh) in enumerate(starts):
        share = between(progress, i / len(starts), (i + 1) / len(starts))
        fits.append(_fit_from(found, start, share, afresh=afresh))
        if fits[-1].power < n("accept.settled"):
            break
    return min(fits, key=lambda fit: fit.objective)


def _fit_from(found: Search, one: Scored, progress: Progress, *, afresh: bool) -> Search:
    """The search with a candidate fitted jointly, from the present solution or from the stated parameters (`afresh`).

    Derivatives by everything else are reused: accurate enough to compare candidates.
    """
    problem, candidate, start = found.problem, one.candidate, found.solution.at
    if candidate.release:
        kind = "known" if problem.names.index(candidate.release) < len(problem.parameters) else "sensor"
        problem = problem.with_free(candidate.release, found.numbers.number(f"fit.{kind}_free"))
    else:
        amplitudes = tuple(np.clip(one.score.amplitude, *candidate.bounds).tolist())
        own = candidate.fit_parameters(amplitudes, found.numbers)
        problem, start = with_candidate(problem, candidate, amplitudes, own, start)
    # derivatives that change much with an effect: for one of the oil, those by numbers of oil and valves
    flows = [*(k.shows_in == ("flow",) for k in problem.parameters), *(u.alone[1] >= 0 for u in problem.unknowns)]
    near = np.array(flows) & ("flow" in candidate.family.shows_in)
    return found.solved(problem, np.zeros_like(start) if afresh else start, progress, settled=True, near=near)


def with_candidate(
    problem: Problem, candidate: Candidate, amplitudes: tuple[float, ...], own: Sequence[FreeParameter], x: Array
) -> tuple[Problem, Array]:
    """The problem with a candidate in the machine and its parameters in the fit; and x (p,) with zeros for these."""
    machine = candidate.on(problem.machine, amplitudes)
    more = problem.with_machine(machine, (*problem.parameters, *own))
    return more, np.insert(x, len(problem.parameters), np.zeros(len(own)))
