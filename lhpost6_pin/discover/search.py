"""The search: refit, screen the library, add what passes, refit everything jointly, and again.

A candidate passes if it gains enough, on tests that it was not fitted on, too, and explains enough of what is more than
noise. Among those that pass, the one with the largest gain is added and its numbers are fitted together with all known
parameters and sensor errors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from ..calibration.fit import Solution, misfit, solve
from ..calibration.knobs import with_knobs
from ..calibration.normal import Normal
from ..calibration.prepare import Prepared
from ..calibration.problem import Base, Problem
from ..machine import Machine
from ..parameters import Parameters
from ..progress import Progress, between
from ..residuals import RESIDUALS
from .background import make_background
from .candidates import Candidate, list_candidates
from .columns import columns_of
from .releases import block_of, list_releases
from .screen import Background, Score, make_block, real_bins, score

__all__ = ["Added", "Contest", "Round", "Scored", "Search", "Standing", "fitted_machine", "search", "stand"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scored:
    """A candidate with what it explains, and whether it may be added."""

    candidate: Candidate
    score: Score
    closure: float  # share of what is more than noise
    refused: str  # why it is not added; empty if it may be


@dataclass(frozen=True)
class Contest:
    """A family that was fitted in full for the same place, and how far it stands behind the one that was added."""

    candidate: Candidate
    behind: float  # log-likelihood; 0 for the one added


@dataclass(frozen=True)
class Added:
    """An effect that the search has added."""

    candidate: Candidate
    gain: float  # linear, of all candidates at that time
    tried: int  # candidates in that round
    contest: tuple[Contest, ...]


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
            found.setdefault(one.candidate.family.name, one)
        return found


@dataclass(frozen=True)
class Standing:
    """The search's place, ready for candidates."""

    base: Base
    background: Background


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

    @cached_property
    def rest(self) -> list[NDArray[np.complex128]]:
        """What is left at the solution: whitened bins (m, c) of every test."""
        return self.problem.whitened(self.solution.x)

    def misfit(self, kind: str) -> float:
        """Mean square of what is left of one kind, over all tests alike; nan where there is none."""
        return float(np.mean(misfit(self.problem, self.rest)[:, RESIDUALS.index(kind)]))


def search(
    ready: Prepared, begin: Normal, calibration: Parameters, numbers: Parameters, progress: Progress
) -> tuple[Search, Standing]:
    """Search the library for what the machine of a prepared campaign lacks; also what is needed to go on from there.

    begin are its normal equations where all unknowns are zero; calibration and numbers those of `models/procedures`.
    """
    start = np.zeros(len(ready.problem.prior))
    share = between(progress, 0.0, 0.4)
    first = solve(ready.problem, ready.replicas, calibration, start, share, first=begin, frugal=True)
    found = Search(ready, first, first)
    most = int(numbers.number("accept.effects"))
    for k in range(most + 1):
        low, high = (0.4 + 0.6 * i / (most + 1) for i in (k, k + 1))
        standing = stand(found, calibration)
        one = screen(found, standing, numbers, between(progress, low, 0.5 * (low + high)))
        found.rounds.append(one)
        passed = [s for s in one.scored if not s.refused]
        if not passed or k == most:
            break
        more = _add(found, passed, calibration, numbers, between(progress, 0.5 * (low + high), high))
        if more is None:
            break
        found = more
    progress(1.0)
    return found, standing


def stand(found: Search, calibration: Parameters) -> Standing:
    """Normal equations of the background about the solution."""
    problem, solution = found.problem, found.solution
    background = make_background(problem, solution.normal, solution.at, calibration)
    return Standing(Base(problem, solution.at), background)


def screen(found: Search, standing: Standing, numbers: Parameters, progress: Progress) -> Round:
    """Score all candidates."""
    problem, base, background = found.problem, standing.base, standing.background
    taken = {a.candidate.name for a in found.added}
    groups = [g for g in list_candidates(base.plant.machine) if not taken & {c.name for c in g}]
    rest = found.solution.normal.rest
    left = float(sum(np.sum(np.abs(r) ** 2) for r in rest) / sum(r.size for r in rest))
    first = excess_by_kind(found.refit.normal.problem, found.refit.normal.rest)

    def judged(candidate: Candidate, one: Score, explained: Callable[[], Sequence[Array]]) -> Scored:
        less = Lowered(0.0, 0.0, 0.0)
        if one.gain >= numbers.number("accept.gain"):
            less = lowered(problem, background, explained(), one, first)
        return Scored(candidate, one, less.share, _refusal(one, less, left, numbers))

    def of_group(group: Sequence[Candidate]) -> list[Scored]:
        columns, parts = columns_of(problem, base, group)
        block = make_block(background, columns)
        scored = []
        for candidate, part in zip(group, parts, strict=True):
            one = score(background, block.select(part), *_bounds(candidate))
            scored.append(judged(candidate, one, partial(_explained, background, columns, part @ one.amplitude)))
        return scored

    scored: list[Scored] = []
    for candidate in list_releases(problem):
        place = problem.names.index(candidate.release)
        free = np.full(1, np.inf)
        one = score(background, block_of(background, place), -free, free)
        scored.append(judged(candidate, one, partial(_of_unknown, background, place, one.amplitude)))
    with Parallel(n_jobs=problem.jobs, prefer="threads", return_as="generator") as parallel:
        for done, some in enumerate(parallel(delayed(of_group)(g) for g in groups)):
            scored += some
            progress((done + 1) / len(groups))
    return Round(tuple(sorted(scored, key=lambda one: -one.score.gain)), left)


def _explained(background: Background, columns: Sequence[NDArray[np.complex128]], amplitude: Array) -> list[Array]:
    """Real bins (n,) of every test that columns (m, c, k) explain."""
    return [real_bins(c, root) @ amplitude for c, root in zip(columns, background.root, strict=True)]


def _of_unknown(background: Background, place: int, amplitude: Array) -> list[Array]:
    """Real bins (n,) of every test that an unknown of the background explains."""
    return [slope[:, place] * amplitude for slope in background.slope]


class Lowered(NamedTuple):
    """By how much a candidate lowers the squares of what is left, with the refit that comes with it."""

    squares: float  # twice a log-likelihood
    share: float  # of what is more than noise
    of_first: float  # in the kind where this is most: of what was more than noise before any effect was added


def lowered(
    problem: Problem,
    background: Background,
    explained: Sequence[Array],
    one: Score,
    first: dict[str, float],
) -> Lowered:
    """How a candidate lowers what is left, explained (n,) of every test; first: excess by kind before any was added."""
    before: list[Array] = []
    after: list[Array] = []
    for slope, rest, root, more in zip(background.slope, background.rest, background.root, explained, strict=True):
        for sums, left in (
            (before, rest + slope @ background.alone),
            (after, rest + slope @ one.change + more),
        ):
            half = root.size
            sums.append(((left[:half] ** 2 + left[half:] ** 2).reshape(root.shape) * root**2).sum(axis=0))
    old, new = np.sum(before, axis=0), np.sum(after, axis=0)  # by column
    count = float(sum(len(rest) for rest in background.rest))
    fall = float((old - new).sum())
    of_first = max(float((old - new)[problem.rows(kind)].sum()) / more for kind, more in first.items())
    return Lowered(fall, fall / max(float(old.sum()) - count, abs(fall), 1e-9), of_first)


def excess_by_kind(problem: Problem, rest: Sequence[NDArray[np.complex128]]) -> dict[str, float]:
    """Squares of whitened residuals beyond noise, twice, by kind; no less than a tenth of what noise has."""
    found = {}
    for kind in problem.kinds:
        rows = problem.rows(kind)
        if rows.any():
            count = 2.0 * sum(r[:, rows].size for r in rest)
            found[kind] = max(2.0 * sum(float(np.sum(np.abs(r[:, rows]) ** 2)) for r in rest) - count, 0.1 * count)
    return found


def _refusal(one: Score, less: Lowered, left: float, numbers: Parameters) -> str:
    """Why a candidate may not be added."""
    if one.gain < numbers.number("accept.gain"):
        return "gains too little"
    if less.squares < one.gain:  # twice it, if what is left is noise: the noise in derivatives is all it has
        return "does not lower what is left"
    held = one.held_out
    if held.sum() < numbers.number("accept.held_out") * one.gain:
        return "does not hold on tests that it was not fitted on"
    if np.mean(held > -numbers.number("accept.worse") * one.gain) < numbers.number("accept.better"):
        return "makes tests worse that it was not fitted on"
    if left > numbers.number("accept.noise") and less.share < numbers.number("accept.closure"):
        return "explains too little of what is more than noise"
    if less.of_first < numbers.number("accept.of_first"):
        return "explains too little of what was there at first"
    return ""


def _bounds(candidate: Candidate) -> tuple[Array, Array]:
    shapes = candidate.amplitudes
    return np.array([s.low for s in shapes]), np.array([s.high for s in shapes])


def _add(
    found: Search, passed: Sequence[Scored], calibration: Parameters, numbers: Parameters, progress: Progress
) -> Search | None:
    """Add the best candidate: the first of each family that comes near it is fitted in full, with its shapes.

    None if none of them lowers what is left when it is fitted in full.
    """
    near = numbers.number("accept.near") * passed[0].score.gain
    firsts: dict[str, Scored] = {}
    for one in passed:
        if one.score.gain >= near:
            firsts.setdefault(one.candidate.family.name, one)
    rivals = list(firsts.values())[: int(numbers.number("accept.rivals"))]
    fitted = []
    for i, rival in enumerate(rivals):
        share = between(progress, i / len(rivals), (i + 1) / len(rivals))
        fitted.append(_fit_jointly(found, rival, calibration, numbers, share))
    power = found.solution.normal.power
    before, *left = (_objective(one, power) for one in (found, *fitted))
    order = np.argsort(left)
    best = int(order[0])
    if before - left[best] < numbers.number("accept.gain"):
        return None
    contest = tuple(Contest(rivals[i].candidate, float(left[i] - left[best])) for i in order)
    added = Added(rivals[best].candidate, rivals[best].score.gain, len(found.rounds[-1].scored), contest)
    fitted[best].added.append(added)
    return fitted[best]


def _fit_jointly(
    found: Search, one: Scored, calibration: Parameters, numbers: Parameters, progress: Progress
) -> Search:
    """The search with a candidate fitted together with everything, from where the linear estimate puts it."""
    problem, candidate = found.problem, one.candidate
    count, start = len(problem.knobs), found.solution.at
    if candidate.release:
        sort = "known" if problem.names.index(candidate.release) < count else "sensor"
        ready = found.ready.with_free(candidate.release, numbers.number(f"fit.{sort}_free"))
    else:
        low, high = _bounds(candidate)
        amplitudes = tuple(float(a) for a in np.clip(one.score.amplitude, low, high))
        own = candidate.knobs(amplitudes, numbers.number("fit.spread"), numbers.number("fit.factor"))
        ready = found.ready.with_machine(candidate.on(problem.machine, amplitudes), (*problem.knobs, *own))
        start = np.insert(start, count, np.zeros(len(own)))
    before = found.solution.normal
    solution = solve(ready.problem, ready.replicas, calibration, start, progress, known=before, frugal=True)
    return Search(ready, solution, found.refit, list(found.added), found.rounds)


def _objective(found: Search, power: Sequence[Array]) -> float:
    """Negative log-likelihood and log-prior at the solution, residuals weighed as before anything was added."""
    squares = sum(float(np.sum(np.abs(r) ** 2 / p)) for r, p in zip(found.rest, power, strict=True))
    return squares + 0.5 * float(np.sum((found.solution.x / found.problem.prior) ** 2))


def fitted_machine(found: Search) -> Machine:
    """The machine with its effects, all numbers as fitted."""
    problem = found.problem
    return with_knobs(problem.machine, problem.knobs, found.solution.x[: len(problem.knobs)])
