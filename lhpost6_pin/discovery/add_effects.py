"""Adding an effect: the best candidates are fitted in full, jointly with everything, and the best of these counts.

Or two at once, where no one does as well.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.progress import Progress, between
from ..identification.calibration.fit import solve
from ..identification.calibration.free_parameters import FreeParameter
from ..identification.calibration.prepare import PreparedProblem
from ..identification.calibration.problem import Problem
from ..machine.parameters import Parameters
from .acceptance import gate, squares_by_column
from .candidates import Candidate
from .pairs import score_pairs
from .screening import weighing
from .search_state import AddedEffect, FittedCandidate, Linearisation, Scored, Search, best_per_family, fitted_machine

__all__ = ["add_effect", "refined", "with_candidate"]

Array = NDArray[np.float64]


def add_effect(
    found: Search, linear: Linearisation, calibration: Parameters, numbers: Parameters, progress: Progress
) -> Search | None:
    """The search with one more effect, or with two where no one does as well; None if nothing is to be added."""
    scored = found.rounds[-1].scored
    passed = [one for one in scored if not one.refused]
    more = _add(found, passed, calibration, numbers, between(progress, 0.0, 0.7)) if passed else None
    few = _strongest(scored, numbers)
    beyond = sorted((one.gain - gate(one.candidate.family, numbers) for one in few), reverse=True)
    hopeless = len(few) < 2 or beyond[0] + beyond[1] < 0.0
    full = len(found.added) + 2 > numbers.number("accept.effects")
    if hopeless or full or (more is not None and more.power < numbers.number("accept.settled")):
        return more
    weigh = weighing(found, linear, numbers)
    candidates = [one.candidate for one in few]
    pairs = score_pairs(found.problem, linear, weigh, candidates, numbers)
    first = pairs[0]
    stands_in = more is None or more.added[-1].candidate.family.named not in {
        candidates[i].family.named for i in first.places
    }
    if first.refused or not stands_in:
        return more
    two = [
        replace(few[i], score=replace(few[i].score, amplitude=a))
        for i, a in zip(first.places, first.amplitudes, strict=True)
    ]
    return _better(found, more, two, calibration, numbers, between(progress, 0.7, 1.0))


def _strongest(scored: Sequence[Scored], numbers: Parameters) -> list[Scored]:
    """The best candidate of each family, of the families that gain most."""
    look = numbers.number("accept.look")
    some = [one for one in scored if one.score.gain >= look and not one.candidate.release]
    return best_per_family(some, named=True)[: int(numbers.number("accept.paired"))]


def _better(
    found: Search,
    more: Search | None,
    two: Sequence[Scored],
    calibration: Parameters,
    numbers: Parameters,
    progress: Progress,
) -> Search | None:
    """The search with one more effect, or with two others if all of them earn their place."""
    both = found
    for i, one in enumerate(two):
        share = between(progress, 0.5 * i, 0.5 * (i + 1))
        rivals = [one, *_in_its_place(both, one, numbers)]
        both = _best_of(both, rivals, calibration, numbers, share, least=-np.inf) or both
    gates = [gate(one.candidate.family, numbers) for one in two]
    if found.objective - both.objective < sum(gates):
        return more
    return both if more is None or more.objective - both.objective >= max(gates) else more


def _in_its_place(found: Search, one: Scored, numbers: Parameters) -> list[Scored]:
    """The best of other families on the same components that come near a candidate, but for what was added."""
    near = numbers.number("accept.near") * one.gain
    taken = {one.candidate.family.name, *(a.candidate.family.name for a in found.added)}
    some = [o for o in found.rounds[-1].scored if o.gain >= near and not o.candidate.release]
    there = best_per_family([o for o in some if o.candidate.components == one.candidate.components])
    rivals = [o for o in there if o.candidate.family.name not in taken]
    return rivals[: int(numbers.number("accept.rivals")) - 1]


def _add(
    found: Search, passed: Sequence[Scored], calibration: Parameters, numbers: Parameters, progress: Progress
) -> Search | None:
    """Add the best candidate: the first of each family that comes near it is fitted in full, with its shapes.

    Of those that explain the campaign alike the simplest counts. Where none of them lowers what is left when it is
    fitted in full, those next in gain are tried; None if none of these does either.
    """
    waiting = best_per_family(passed)
    most, batches = int(numbers.number("accept.rivals")), int(numbers.number("accept.batches"))
    for batch in range(batches):
        near = numbers.number("accept.near") * waiting[0].gain if waiting else 0.0
        rivals = [one for one in waiting if one.gain >= near][:most]
        if not rivals:
            return None
        waiting = [one for one in waiting if one not in rivals]
        part = between(progress, batch / batches, (batch + 1) / batches)
        if (best := _best_of(found, rivals, calibration, numbers, part)) is not None:
            return best
    return None


def _best_of(
    found: Search,
    rivals: Sequence[Scored],
    calibration: Parameters,
    numbers: Parameters,
    progress: Progress,
    least: float | None = None,
) -> Search | None:
    """The search with the best of these candidates, all fitted in full; None if none gains `least`, or its gate."""
    fitted = []
    for i, rival in enumerate(rivals):
        share = between(progress, 0.7 * i / len(rivals), 0.7 * (i + 1) / len(rivals))
        fitted.append(_fit_jointly(found, rival, calibration, numbers, share))
    before, *left = (one.objective for one in (found, *fitted))
    gates = [gate(one.candidate.family, numbers) if least is None else least for one in rivals]
    passed = [i for i, required in enumerate(gates) if before - left[i] >= required]
    if not passed:
        return None
    lowest = min(left[i] for i in passed)
    # laws are never quite those of the table: of large gains a share decides nothing
    apart = max(numbers.number("accept.apart"), numbers.number("accept.alike") * (before - lowest))
    alike = [i for i in passed if left[i] - lowest < apart]
    # the simplest of them: what the model knows already, then what has the fewest numbers
    best = min(alike, key=lambda i: (not rivals[i].candidate.release, len(rivals[i].candidate.family.shapes), left[i]))
    order = sorted(range(len(left)), key=lambda i: (i != best, left[i]))
    contest = tuple(
        FittedCandidate(rivals[i].candidate, float(left[i] - left[best]), fitted_machine(fitted[i].solution))
        for i in order
    )
    more = refined(fitted[best], calibration, between(progress, 0.7, 1.0))
    first, last = (squares_by_column(one.residual) for one in (found, more))
    place, tried = len(found.rounds) - 1, len(found.rounds[-1].scored)
    added = AddedEffect(rivals[best].candidate, before - left[best], place, tried, contest, first - last, apart)
    more.added.append(added)
    return more


def refined(found: Search, calibration: Parameters, progress: Progress) -> Search:
    """The search with everything's derivatives evaluated again."""
    problem, at, known = found.problem, found.solution.x, found.solution.normal
    solution = solve(problem, found.ready.replicas, calibration, at, progress, known=known, frugal=True)
    return Search(found.ready, solution, found.refit, found.added, found.rounds)


def _fit_jointly(
    found: Search, one: Scored, calibration: Parameters, numbers: Parameters, progress: Progress
) -> Search:
    """The search with a candidate fitted together with everything, from where the linear estimate puts it.

    Where much is left, it is fitted from where nothing else is off, too: what was missing may have bent everything out
    of reach; and from other shapes that explain nearly as much.
    """
    same = [s for s in found.rounds[-1].scored if s.candidate.of_one_form(one.candidate) and s is not one]
    near = numbers.number("accept.near") * one.gain
    others = [s for s in same if s.gain >= near][: int(numbers.number("accept.shapes"))]
    starts = [(one, False), (one, True), *((other, False) for other in others)]
    fits: list[Search] = []
    for i, (start, afresh) in enumerate(starts):
        share = between(progress, i / len(starts), (i + 1) / len(starts))
        fits.append(_fit_from(found, start, calibration, numbers, share, afresh=afresh))
        if fits[-1].power < numbers.number("accept.settled"):
            break
    return min(fits, key=lambda fit: fit.objective)


def _fit_from(
    found: Search, one: Scored, calibration: Parameters, numbers: Parameters, progress: Progress, *, afresh: bool
) -> Search:
    """The search with a candidate fitted together with everything, which begins where it is, or afresh.

    Derivatives by everything else are those from before: enough to tell which candidate is the best.
    """
    problem, candidate = found.problem, one.candidate
    count, start = len(problem.parameters), found.solution.at
    if candidate.release:
        sort = "known" if problem.names.index(candidate.release) < count else "sensor"
        ready = found.ready.with_free(candidate.release, numbers.number(f"fit.{sort}_free"))
    else:
        low, high = candidate.bounds
        amplitudes = tuple(float(a) for a in np.clip(one.score.amplitude, low, high))
        own = candidate.parameters(amplitudes, numbers.number("fit.spread"), numbers.number("fit.factor"))
        ready, start = with_candidate(found, candidate, amplitudes, own, start)
    solution = solve(
        *(ready.problem, ready.replicas, calibration, np.zeros_like(start) if afresh else start, progress),
        found.solution.normal,
        frugal=True,
        settled=True,
        near=_near(ready.problem, candidate),
    )
    return Search(ready, solution, found.refit, list(found.added), found.rounds)


def with_candidate(
    found: Search, candidate: Candidate, amplitudes: tuple[float, ...], own: Sequence[FreeParameter], x: Array
) -> tuple[PreparedProblem, Array]:
    """The search's tests with a candidate in the machine and its unknowns in the fit; and its place x with theirs."""
    problem = found.problem
    ready = found.ready.with_machine(candidate.on(problem.machine, amplitudes), (*problem.parameters, *own))
    return ready, np.insert(x, len(problem.parameters), np.zeros(len(own)))


def _near(problem: Problem, candidate: Candidate) -> NDArray[np.bool_]:
    """Unknowns (p,) whose derivatives change much with an effect: of oil and valves, those of oil and valves."""
    parameters = [k.shows_in == ("flow",) for k in problem.parameters]
    return np.array([*parameters, *(u.alone[1] >= 0 for u in problem.unknowns)]) & ("flow" in candidate.family.shows_in)
