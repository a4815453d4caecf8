"""The search: refit, screen the library, add what passes, refit everything jointly, and again.

A candidate passes if it gains enough, on tests that it was not fitted on, too, and explains enough of what is more than
noise. Among those that pass, the one with the largest gain is added and its numbers are fitted together with all known
parameters and sensor errors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from ..calibration.fit import Solution, misfit, objective, solve
from ..calibration.knobs import with_knobs
from ..calibration.normal import Normal, bounds_of
from ..calibration.prepare import Prepared
from ..calibration.problem import Base, Problem
from ..calibration.spectra import real_bins
from ..library import Family
from ..machine import Machine
from ..parameters import Parameters
from ..progress import Progress, between
from ..residuals import RESIDUALS
from .background import make_background
from .candidates import Candidate, list_candidates
from .columns import columns_of
from .pairs import score_pairs
from .releases import block_of, list_releases
from .screen import Background, Block, Score, less_noise, make_block, score
from .weighing import Lowered, Weighing, gate, refusal, squares_by_column

__all__ = [
    "Added",
    "Contest",
    "Round",
    "Scored",
    "Search",
    "Standing",
    "fitted_machine",
    "refit",
    "search",
    "stand",
    "weighing",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scored:
    """A candidate with what it explains, and whether it may be added."""

    candidate: Candidate
    score: Score
    gain: float  # of log-likelihood, with what is left weighed anew; without that where the linear gain is too little
    closure: float  # share of what is more than noise where it explains most
    refused: str  # why it is not added; empty if it may be


@dataclass(frozen=True)
class Contest:
    """A family that was fitted in full for the same place, and how far it stands behind the one that was added."""

    candidate: Candidate
    behind: float  # log-likelihood; 0 for the one added, below that for one that is less simple
    machine: Machine  # with it, all numbers as fitted


@dataclass(frozen=True)
class Added:
    """An effect that the search has added."""

    candidate: Candidate
    gain: float  # of log-likelihood and log-prior, of the joint fit
    round: int  # of the search, from 0
    tried: int  # candidates in that round
    contest: tuple[Contest, ...]
    fall: Array  # (c,) of the squares of what is left, by column
    apart: float  # log-likelihood within which two families explained the campaign alike

    @property
    def rivals(self) -> tuple[Contest, ...]:
        """Those of other families that explain the campaign alike."""
        near = [one for one in self.contest[1:] if one.behind < self.apart]
        return tuple(one for one in near if one.candidate.family.named != self.candidate.family.named)


@dataclass(frozen=True)
class Round:
    """One screening of the library; candidates by falling gain."""

    scored: tuple[Scored, ...]
    misfit: float  # mean square of the whitened residuals before it

    @property
    def best(self) -> dict[str, Scored]:
        """The best candidate of each family, by falling gain."""
        found: dict[str, Scored] = {}
        for one in self.scored:
            found.setdefault(one.candidate.family.named, one)
        return found


@dataclass(frozen=True)
class Standing:
    """The search's place, ready for candidates."""

    base: Base
    background: Background
    replicas: tuple[tuple[Problem, Base], ...]  # the same with more noise


@dataclass
class Search:
    """Where a search stands, and how it came there."""

    ready: Prepared
    solution: Solution
    refit: Solution  # without any effect
    added: list[Added] = field(default_factory=list)
    rounds: list[Round] = field(default_factory=list)

    @property
    def problem(self) -> Problem:
        """The problem with the effects added."""
        return self.ready.problem

    @property
    def rest(self) -> list[NDArray[np.complex128]]:
        """What is left at the solution: whitened bins (m, c) of every test."""
        return self.solution.rest

    def misfit(self, kind: str) -> float:
        """Mean square of what is left of one kind, over all tests alike; nan where there is none."""
        return float(np.mean(misfit(self.problem, self.rest)[:, RESIDUALS.index(kind)]))


def refit(ready: Prepared, begin: Normal, calibration: Parameters, progress: Progress) -> Search:
    """Where a search begins: known parameters and sensor errors fitted to a prepared campaign, without any effect.

    begin are its normal equations where all unknowns are zero; calibration are numbers of `models/procedures`.
    """
    start = np.zeros(len(ready.problem.prior))
    share = between(progress, 0.0, 0.85)
    first = solve(ready.problem, ready.replicas, calibration, start, share, first=begin, frugal=True)
    return _weighed_anew(Search(ready, first, first), calibration, between(progress, 0.85, 1.0))


def search(
    found: Search, calibration: Parameters, numbers: Parameters, keep: Callable[[Search], None], progress: Progress
) -> tuple[Search, Standing]:
    """Search the library for what the machine lacks, from a refit or from where an earlier search was interrupted.

    Returns also what is needed to go on from there; calibration and numbers are those of `models/procedures`. keep is
    called with the search each time that it has come further.
    """
    most = int(numbers.number("accept.effects"))
    for k in range(len(found.rounds), most + 1):
        low, high = (i / (most + 1) for i in (k, k + 1))
        standing = stand(found.solution, calibration, found.ready.replicas)
        one = screen(found, standing, numbers, between(progress, low, 0.5 * (low + high)))
        found.rounds.append(one)
        if k == most:
            break
        more = _further(found, standing, calibration, numbers, between(progress, 0.5 * (low + high), high))
        if more is None:
            break
        found = more
        keep(found)
    if len(found.added) > 1:
        fewer = _pruned(found, calibration, numbers)
        found, standing = fewer, standing if fewer is found else stand(fewer.solution, calibration)
    progress(1.0)
    return found, standing


def _pruned(found: Search, calibration: Parameters, numbers: Parameters) -> Search:
    """The search without what it can do without, now that more has been added: helpers of what was found later."""
    for one in found.added[:-1]:
        less = _without(found, one.candidate, calibration)
        if _objective(less) - _objective(found) < gate(one.candidate.family, numbers):
            return _pruned(_refined(less, calibration, lambda share: None), calibration, numbers)
    return found


def _without(found: Search, candidate: Candidate, calibration: Parameters) -> Search:
    """The search without one of its effects, everything else refitted."""
    problem = found.problem
    if candidate.release:
        ready = found.ready.without_free(candidate.release)
    else:
        knobs = tuple(k for k in problem.knobs if not k.name.startswith(f"{candidate.name}."))
        ready = found.ready.with_machine(problem.machine.without_effect(candidate.name), knobs)
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


def stand(solution: Solution, calibration: Parameters, replicas: Sequence[Problem] = ()) -> Standing:
    """Normal equations of the background about a solution, with replicas of its problem where candidates are asked."""
    problem, at = solution.normal.problem, solution.at
    background = make_background(problem, solution.normal, at, calibration)
    return Standing(Base(problem, at), background, tuple((one, Base(one, at)) for one in replicas))


def weighing(found: Search, standing: Standing, numbers: Parameters) -> Weighing:
    """What weighs candidates there."""
    first = squares_by_column(found.refit.normal.rest)
    return Weighing(found.refit.normal.problem, standing.background, first, numbers)


def screen(found: Search, standing: Standing, numbers: Parameters, progress: Progress) -> Round:
    """Score all candidates."""
    problem, base, background = found.problem, standing.base, standing.background
    taken = {a.candidate.name for a in found.added}
    groups = [g for g in list_candidates(base.plant.machine) if not taken & {c.name for c in g}]
    rest = found.solution.normal.rest
    left = float(sum(np.sum(np.abs(r) ** 2) for r in rest) / sum(r.size for r in rest))
    weigh = weighing(found, standing, numbers)

    def judged(candidate: Candidate, one: Score, explained: Callable[[], Sequence[Array]]) -> Scored:
        less = Lowered(one.gain, 0.0, 0.0, 0.0)
        if one.gain >= numbers.number("accept.look"):
            less = weigh.lowered(explained(), one)
        why = refusal([candidate.family], one, less, numbers)
        if not why and less.gain < numbers.number("accept.again") * _found_there(found, candidate):
            why = "may be the form of what was found there"
        return Scored(candidate, one, less.gain, less.share, why)

    def of_group(group: Sequence[Candidate]) -> list[Scored]:
        columns, parts = columns_of(problem, base, group)
        block = make_block(background, columns)

        def scores(block: Block) -> list[Score]:
            pairs = zip(group, parts, strict=True)
            return [score(background, block.select(q), *c.bounds, c.spread(numbers)) for c, q in pairs]

        found = scores(block)
        if max(one.gain for one in found) >= numbers.number("accept.look"):
            noisy = [columns_of(again, there, group)[0] for again, there in standing.replicas]
            found = scores(less_noise(background, block, columns, noisy))
        scored = []
        for candidate, part, one in zip(group, parts, found, strict=True):
            scored.append(judged(candidate, one, partial(_explained, background, columns, part @ one.amplitude)))
        return scored

    scored: list[Scored] = []
    for candidate in list_releases(problem):
        place = problem.names.index(candidate.release)
        free = np.full(1, np.inf)
        one = score(background, block_of(background, place), -free, free, np.full(1, numbers.number("fit.sensor_free")))
        scored.append(judged(candidate, one, partial(_of_unknown, background, place, one.amplitude)))
    with Parallel(n_jobs=problem.jobs, prefer="threads", return_as="generator") as parallel:
        for done, some in enumerate(parallel(delayed(of_group)(g) for g in groups)):
            scored += some
            progress((done + 1) / len(groups))
    return Round(tuple(_by_rank(scored, numbers.number("accept.simpler"))), left)


def _by_rank(scored: Sequence[Scored], simpler: float) -> list[Scored]:
    """By falling gain; but of one family, fewer components come before more that gain less than `simpler` over them."""
    found = sorted(scored, key=lambda one: -one.gain)
    most: dict[str, float] = {}
    for one in found:
        most.setdefault(one.candidate.family.name, one.gain)

    def rank(one: Scored) -> tuple[float, int, float]:
        best = most[one.candidate.family.name]
        near = one.gain > best - simpler
        return -best if near else -one.gain, len(one.candidate.components) if near else 0, -one.gain

    return sorted(found, key=rank)


def _found_there(found: Search, candidate: Candidate) -> float:
    """Largest gain of what was added on the same components, and shows in the same residuals or is often confused."""
    one = candidate.family

    def alike(other: Family) -> bool:
        named = one.named in other.confused_with or other.named in one.confused_with
        return named or bool(set(one.shows_in) & set(other.shows_in))

    same = [a for a in found.added if a.candidate.components == candidate.components]
    return max((a.gain for a in same if alike(a.candidate.family)), default=0.0)


def _explained(background: Background, columns: Sequence[NDArray[np.complex128]], amplitude: Array) -> list[Array]:
    """Real bins (n,) of every test that columns (m, c, k) explain."""
    return [real_bins(c, root) @ amplitude for c, root in zip(columns, background.root, strict=True)]


def _of_unknown(background: Background, place: int, amplitude: Array) -> list[Array]:
    """Real bins (n,) of every test that an unknown of the background explains."""
    return [slope[:, place] * amplitude for slope in background.slope]


def _further(
    found: Search, standing: Standing, calibration: Parameters, numbers: Parameters, progress: Progress
) -> Search | None:
    """The search with one more effect, or with two where no one does as well; None if nothing is to be added."""
    scored = found.rounds[-1].scored
    passed = [one for one in scored if not one.refused]
    more = _add(found, passed, calibration, numbers, between(progress, 0.0, 0.7)) if passed else None
    few = _strongest(scored, numbers)
    beyond = sorted((one.gain - gate(one.candidate.family, numbers) for one in few), reverse=True)
    hopeless = len(few) < 2 or beyond[0] + beyond[1] < 0.0
    full = len(found.added) + 2 > numbers.number("accept.effects")
    if hopeless or full or (more is not None and _settled(more, numbers)):
        return more
    weigh = weighing(found, standing, numbers)
    candidates = [one.candidate for one in few]
    pairs = score_pairs(found.problem, standing.base, standing.replicas, weigh, candidates, numbers)
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
    best: dict[str, Scored] = {}
    for one in scored:
        if one.score.gain >= numbers.number("accept.look") and not one.candidate.release:
            best.setdefault(one.candidate.family.named, one)
    return list(best.values())[: int(numbers.number("accept.paired"))]


def _settled(found: Search, numbers: Parameters) -> bool:
    """Whether no more is left than a good fit leaves."""
    left = [float(np.mean(np.abs(r) ** 2)) for r in found.rest]
    return float(np.mean(left)) < numbers.number("accept.settled")


def _better(
    found: Search,
    more: Search | None,
    two: Sequence[Scored],
    calibration: Parameters,
    numbers: Parameters,
    progress: Progress,
) -> Search | None:
    """The search with one more effect, or with two others if all of them earn their place."""
    both: Search | None = found
    for i, one in enumerate(two):
        share = between(progress, 0.5 * i, 0.5 * (i + 1))
        rivals = [one, *_in_its_place(found, one, numbers)]
        both = _best_of(both, rivals, calibration, numbers, share, least=-np.inf) if both else None
    gates = [gate(one.candidate.family, numbers) for one in two]
    if both is None or _objective(found) - _objective(both) < sum(gates):
        return more
    return both if more is None or _objective(more) - _objective(both) >= max(gates) else more


def _in_its_place(found: Search, one: Scored, numbers: Parameters) -> list[Scored]:
    """The best of other families on the same components that come near a candidate."""
    near = numbers.number("accept.near") * one.gain
    firsts: dict[str, Scored] = {}
    for other in found.rounds[-1].scored:
        there = other.candidate.components == one.candidate.components and not other.candidate.release
        if there and other.gain >= near and other.candidate.family.name != one.candidate.family.name:
            firsts.setdefault(other.candidate.family.name, other)
    return list(firsts.values())[: int(numbers.number("accept.rivals")) - 1]


def _add(
    found: Search, passed: Sequence[Scored], calibration: Parameters, numbers: Parameters, progress: Progress
) -> Search | None:
    """Add the best candidate: the first of each family that comes near it is fitted in full, with its shapes.

    Of those that explain the campaign alike the simplest counts. Where none of them lowers what is left when it is
    fitted in full, those next in gain are tried; None if none of these does either.
    """
    firsts: dict[str, Scored] = {}
    for one in passed:
        firsts.setdefault(one.candidate.family.name, one)
    waiting = list(firsts.values())
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
    before, *left = (_objective(one) for one in (found, *fitted))
    gates = [gate(one.candidate.family, numbers) if least is None else least for one in rivals]
    passed = [i for i, needed in enumerate(gates) if before - left[i] >= needed]
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
        Contest(rivals[i].candidate, float(left[i] - left[best]), fitted_machine(fitted[i].solution)) for i in order
    )
    refined = _refined(fitted[best], calibration, between(progress, 0.7, 1.0))
    first, last = (squares_by_column(one.rest) for one in (found, refined))
    place, tried = len(found.rounds) - 1, len(found.rounds[-1].scored)
    added = Added(rivals[best].candidate, before - left[best], place, tried, contest, first - last, apart)
    refined.added.append(added)
    return refined


def _refined(found: Search, calibration: Parameters, progress: Progress) -> Search:
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
        if _settled(fits[-1], numbers):
            break
    return min(fits, key=_objective)


def _fit_from(
    found: Search, one: Scored, calibration: Parameters, numbers: Parameters, progress: Progress, *, afresh: bool
) -> Search:
    """The search with a candidate fitted together with everything, which begins where it is, or afresh.

    Derivatives by everything else are those from before: enough to tell which candidate is the best.
    """
    problem, candidate = found.problem, one.candidate
    count, start = len(problem.knobs), found.solution.at
    if candidate.release:
        sort = "known" if problem.names.index(candidate.release) < count else "sensor"
        ready = found.ready.with_free(candidate.release, numbers.number(f"fit.{sort}_free"))
    else:
        low, high = candidate.bounds
        amplitudes = tuple(float(a) for a in np.clip(one.score.amplitude, low, high))
        own = candidate.knobs(amplitudes, numbers.number("fit.spread"), numbers.number("fit.factor"))
        ready = found.ready.with_machine(candidate.on(problem.machine, amplitudes), (*problem.knobs, *own))
        start = np.insert(start, count, np.zeros(len(own)))
    solution = solve(
        *(ready.problem, ready.replicas, calibration, np.zeros_like(start) if afresh else start, progress),
        found.solution.normal,
        frugal=True,
        settled=True,
        near=_near(ready.problem, candidate),
    )
    return Search(ready, solution, found.refit, list(found.added), found.rounds)


def _near(problem: Problem, candidate: Candidate) -> NDArray[np.bool_]:
    """Unknowns (p,) whose derivatives change much with an effect: of oil and valves, those of oil and valves."""
    knobs = [k.shows_in == ("flow",) for k in problem.knobs]
    return np.array([*knobs, *(u.alone[1] >= 0 for u in problem.unknowns)]) & ("flow" in candidate.family.shows_in)


def _objective(found: Search) -> float:
    """Negative log-likelihood and log-prior at the solution."""
    return objective(found.problem, found.rest, found.solution.x)


def fitted_machine(solution: Solution) -> Machine:
    """The machine of a solution, all numbers as fitted: with its effects, or as refitted without any."""
    problem = solution.normal.problem
    return with_knobs(problem.machine, problem.knobs, solution.x[: len(problem.knobs)])
