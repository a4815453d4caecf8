"""A round of screening: every candidate of the library scored beside the background, and whether it may be added."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from ..core.progress import Progress
from ..identification.calibration.fit import Solution
from ..identification.calibration.problem import OperatingPoint, Problem
from ..machine.library import Family
from ..machine.parameters import Parameters
from .acceptance import Lowered, Reweighting, refusal, squares_by_column
from .background import make_background
from .candidate_columns import Columns, columns_of, side_by_side
from .candidates import Candidate, list_candidates
from .releases import block_of, list_releases
from .scores import Background, Block, Score, less_noise, make_block, score
from .search_state import Linearisation, Round, Scored, Search

__all__ = ["linearise", "screen", "weighing"]

Array = NDArray[np.float64]

BATCH = 8
"""Groups of candidates that are weighed at once."""


def linearise(solution: Solution, calibration: Parameters, replicas: Sequence[Problem] = ()) -> Linearisation:
    """Normal equations of the background about a solution, with replicas of its problem where candidates are asked."""
    problem, at = solution.normal.problem, solution.at
    background = make_background(problem, solution.normal, at, calibration)
    return Linearisation(
        OperatingPoint(problem, at), background, tuple((one, OperatingPoint(one, at)) for one in replicas)
    )


def weighing(found: Search, linear: Linearisation, numbers: Parameters) -> Reweighting:
    """What weighs candidates there."""
    first = squares_by_column(found.refit.normal.residual)
    return Reweighting(found.refit.normal.problem, linear.background, first, numbers)


def screen(found: Search, linear: Linearisation, numbers: Parameters, progress: Progress) -> Round:
    """Score all candidates."""
    problem, base, background = found.problem, linear.base, linear.background
    taken = {a.candidate.name for a in found.added}
    groups = [g for g in list_candidates(base.plant.machine) if not taken & {c.name for c in g}]
    rest = found.solution.normal.residual
    left = float(sum(np.sum(np.abs(r) ** 2) for r in rest) / sum(r.size for r in rest))
    weigh = weighing(found, linear, numbers)

    def judged(candidate: Candidate, one: Score, explained: Callable[[], Sequence[Array]]) -> Scored:
        less = Lowered(one.gain, 0.0, 0.0, 0.0)
        if one.gain >= numbers.number("accept.look"):
            less = weigh.lowered(explained(), one)
        why = refusal([candidate.family], one, less, numbers)
        if not why and less.gain < numbers.number("accept.again") * _found_there(found, candidate):
            why = "may be the form of what was found there"
        return Scored(candidate, one, less.gain, less.share, why)

    def of_group(group: Sequence[Candidate], columns: Columns, parts: Sequence[Array], block: Block) -> list[Scored]:
        def scores(block: Block) -> list[Score]:
            pairs = zip(group, parts, strict=True)
            return [score(background, block.select(q), *c.bounds, c.spread(numbers)) for c, q in pairs]

        found = scores(block)
        if max(one.gain for one in found) >= numbers.number("accept.look"):
            noisy = [columns_of(again, there, group)[0] for again, there in linear.replicas]
            found = scores(less_noise(background, block, columns, noisy))
        scored = []
        for candidate, part, one in zip(group, parts, found, strict=True):
            scored.append(judged(candidate, one, partial(background.explained, columns, part @ one.amplitude)))
        return scored

    def of_batch(groups: Sequence[Sequence[Candidate]]) -> list[Scored]:
        """Several groups with one pass through the background, which is what takes time."""
        each = [columns_of(problem, base, group) for group in groups]
        block = make_block(background, side_by_side([columns for columns, _ in each]))
        ends = np.cumsum([0, *(columns[0].shape[-1] for columns, _ in each)])
        own = [block.select(part) for part in np.split(np.eye(ends[-1]), ends[1:-1], axis=1)]
        return [
            one
            for group, (columns, parts), b in zip(groups, each, own, strict=True)
            for one in of_group(group, columns, parts, b)
        ]

    scored: list[Scored] = []
    for candidate in list_releases(problem):
        place = problem.names.index(candidate.release)
        free = np.full(1, np.inf)
        one = score(background, block_of(background, place), -free, free, np.full(1, numbers.number("fit.sensor_free")))
        scored.append(judged(candidate, one, partial(_of_unknown, background, place, one.amplitude)))
    with Parallel(n_jobs=problem.jobs, prefer="threads", return_as="generator") as parallel:
        batches = [groups[i : i + BATCH] for i in range(0, len(groups), BATCH)]
        for done, some in enumerate(parallel(delayed(of_batch)(batch) for batch in batches)):
            scored += some
            progress((done + 1) / len(batches))
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


def _of_unknown(background: Background, place: int, amplitude: Array) -> list[Array]:
    """Real bins (n,) of every test that an unknown of the background explains."""
    return [slope[:, place] * amplitude for slope in background.slope]
