"""A round of screening: every candidate of the library scored beside the background, and whether it may be added."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from joblib import Parallel, delayed

from ..core.arrays import Array
from ..core.progress import Progress
from ..machine.library import Family
from .acceptance import Lowered, Reweighting, refusal
from .candidate_columns import Columns, columns_of, side_by_side
from .candidates import Candidate, list_candidates
from .linearisation import Linearisation
from .releases import block_of, list_releases
from .scores import Background, Block, Score, less_noise, make_block, score
from .search_state import Round, Scored, Search

__all__ = ["screen"]


BATCH = 8
"""Groups of candidates that are scored at once."""


def screen(found: Search, linear: Linearisation, progress: Progress) -> Round:
    """Score all candidates."""
    problem, numbers, base, background = found.problem, found.numbers, linear.base, linear.background
    taken = {a.candidate.name for a in found.added}
    groups = [g for g in list_candidates(base.plant.machine) if not taken & {c.name for c in g}]
    residual = found.solution.normal.residual
    misfit = float(sum(np.sum(np.abs(r) ** 2) for r in residual) / sum(r.size for r in residual))
    weigh, look = Reweighting(found, background), numbers.number("accept.look")

    def judged(candidate: Candidate, one: Score, explained: Callable[[], Sequence[Array]]) -> Scored:
        less = weigh.lowered(explained(), one) if one.gain >= look else Lowered(one.gain, 0.0, 0.0, 0.0)
        why = refusal([candidate.family], one, less, numbers)
        if not why and less.gain < numbers.number("accept.again") * _found_there(found, candidate):
            why = "may be due to the form of an effect added there"
        return Scored(candidate, one, less.gain, less.share, why)

    def of_group(group: Sequence[Candidate], columns: Columns, parts: Sequence[Array], block: Block) -> list[Scored]:
        def scores(block: Block) -> list[Score]:
            pairs = zip(group, parts, strict=True)
            return [score(background, block.select(q), *c.bounds, c.spread(numbers)) for c, q in pairs]

        ones = scores(block)
        if max(one.gain for one in ones) >= look:
            noisy = [columns_of(again, there, group)[0] for again, there in linear.replicas]
            ones = scores(less_noise(background, block, columns, noisy))
        return [
            judged(candidate, one, partial(background.explained, columns, part @ one.amplitude))
            for candidate, part, one in zip(group, parts, ones, strict=True)
        ]

    def of_batch(groups: Sequence[Sequence[Candidate]]) -> list[Scored]:
        """Several groups with one pass through the background, which dominates the cost."""
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
    free = np.full(1, np.inf)
    for candidate in list_releases(problem):
        place = problem.names.index(candidate.release)
        spread = np.full(1, numbers.number("fit.sensor_free"))
        one = score(background, block_of(background, place), -free, free, spread)
        scored.append(judged(candidate, one, partial(_of_unknown, background, place, one.amplitude)))
    with Parallel(n_jobs=problem.jobs, prefer="threads", return_as="generator") as parallel:
        batches = [groups[i : i + BATCH] for i in range(0, len(groups), BATCH)]
        for done, some in enumerate(parallel(delayed(of_batch)(batch) for batch in batches)):
            scored += some
            progress((done + 1) / len(batches))
    return Round(tuple(_by_rank(scored, numbers.number("accept.simpler"))), misfit)


def _by_rank(scored: Sequence[Scored], simpler: float) -> list[Scored]:
    """By falling gain; within a family, fewer components precede more that gain less than `simpler` over them."""
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
    """Largest gain of an effect added on the same components that shows in the same residuals or is often confused."""
    one = candidate.family

    def alike(other: Family) -> bool:
        named = one.named in other.confused_with or other.named in one.confused_with
        return named or bool(set(one.shows_in) & set(other.shows_in))

    same = [a for a in found.added if a.candidate.components == candidate.components]
    return max((a.gain for a in same if alike(a.candidate.family)), default=0.0)


def _of_unknown(background: Background, place: int, amplitude: Array) -> list[Array]:
    """Real bins (n,) of every test that an unknown of the background explains."""
    return [slope[:, place] * amplitude for slope in background.slope]
