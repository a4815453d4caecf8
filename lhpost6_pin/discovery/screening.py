"""Screening: every candidate of the library scored beside the background, alone and in pairs.

A search adds one effect after the other. Two effects pass only together if each leaves much of the other's residual
unexplained; and one of a wrong form may substitute for two, so that neither is added after it.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.processes import by_processes
from ..core.progress import Progress
from ..identification.calibration.operating_point import OperatingPoint
from ..identification.calibration.problem import Problem
from .acceptance import Lowered, Reweighting, gate, refusal
from .candidate_columns import columns_of_groups
from .candidates import Candidate, list_candidates, list_releases
from .estimates import absorbing, is_absorbed
from .scores import Block, Columns, Score, block_of, less_noise, make_block, score
from .search_state import Linearisation, Round, Scored, Search

__all__ = ["CandidatePair", "is_confused", "left_by_form", "screen", "score_pairs"]


FORM = "may be due to the form of an effect added there or at the supply"
"""Why a candidate is refused that explains little beside an effect found on its components, or on their supply."""

SUPPLY = "supply"
"""Component that all actuators share."""

BATCH = 8
"""Groups of candidates that are scored at once."""


def screen(found: Search, linear: Linearisation, progress: Progress) -> Round:
    """Score all candidates."""
    problem, numbers, base, background = found.problem, found.numbers, linear.base, linear.background
    groups = list_candidates(base.plant.machine, base.tests[0].channels)
    weigh, look = Reweighting(found, background), numbers.number("accept.look")
    ends = absorbing(found)

    def judged(candidate: Candidate, one: Score, explained: Sequence[Array]) -> Scored:
        less = weigh.lowered(explained, one) if explained else Lowered(one.gain, 0.0, 0.0, 0.0)
        why = refusal([candidate.family], one, less, numbers, absorbed=is_absorbed(candidate, ends))
        if not why and less.gain < left_by_form(found, candidate):
            why = FORM
        return Scored(candidate, one, less.gain, less.share, why)

    def scores(group: Sequence[Candidate], parts: Sequence[Array], block: Block) -> list[Score]:
        pairs = zip(group, parts, strict=True)
        return [score(background, block.select(q), *c.bounds, c.spread(numbers), look) for c, q in pairs]

    def of_batch(groups: Sequence[Sequence[Candidate]]) -> list[Scored]:
        """Several groups at once; those that gain are scored again, corrected for noise."""
        columns, parts = columns_of_groups(problem, base, groups)
        block = make_block(background, columns)
        each = [scores(group, own, block) for group, own in zip(groups, parts, strict=True)]
        gaining = [i for i, ones in enumerate(each) if max(one.gain for one in ones) >= look]
        some = [groups[i] for i in gaining]
        noisy = [columns_of_groups(*replica, some) for replica in linear.replicas] if some else []
        for k, i in enumerate(gaining):
            own = _places(parts[i])
            clean, alone = [c.only(own) for c in columns], block.select(np.eye(columns[0].count)[:, own])
            changed = [[c.only(_places(there[k])) for c in seen] for seen, there in noisy]
            corrected = less_noise(background, alone, clean, changed)
            each[i] = scores(groups[i], [part[own] for part in parts[i]], corrected)
        found = []
        for group, own_parts, ones in zip(groups, parts, each, strict=True):
            for candidate, part, one in zip(group, own_parts, ones, strict=True):
                explained = background.explained(columns, part @ one.amplitude) if one.gain >= look else []
                found.append(judged(candidate, one, explained))
        return found

    scored: list[Scored] = []
    free, spread = np.full(1, np.inf), np.full(1, numbers.number("fit.sensor_free"))
    for candidate in list_releases(problem):
        place = problem.names.index(candidate.release)
        one = score(background, block_of(background, place), -free, free, spread)
        along = one.amplitude * (np.arange(len(problem.names)) == place)
        explained = [slope.times(along) for slope in background.slope] if one.gain >= look else []
        scored.append(judged(candidate, one, explained))
    batches = [groups[i : i + BATCH] for i in range(0, len(groups), BATCH)]
    for done, some in enumerate(by_processes(of_batch, batches, problem.jobs)):
        scored += some
        progress((done + 1) / len(batches))
    return Round(tuple(_by_rank(_without_parts(scored), numbers.number("accept.simpler"))))


def _without_parts(scored: Sequence[Scored]) -> list[Scored]:
    """The same; what is on a part of where its family gains more, but may be due to a form, may be so, too."""
    forms = [one for one in scored if one.refused == FORM]

    def is_part(one: Scored) -> bool:
        return any(one.candidate.is_part_of(o.candidate) and o.gain > one.gain for o in forms)

    return [replace(one, refused=FORM) if not one.refused and is_part(one) else one for one in scored]


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


def left_by_form(found: Search, candidate: Candidate) -> float:
    """Log-likelihood of a candidate up to which it may be due to the form of an effect added.

    A share `accept.again` of the gain of one that is often confused with it on some of the same components or their
    supply, or shows in the same residuals on all of them; a share `accept.part` of one that does so on these and more.
    """
    shows, there, least = set(candidate.family.shows_in), set(candidate.components), 0.0
    for added in found.added:
        own, alike = set(added.candidate.components), bool(shows & set(added.candidate.family.shows_in))
        if (_confused(added.candidate, candidate) and _meet(added.candidate, candidate)) or (own == there and alike):
            least = max(least, found.numbers.number("accept.again") * added.gain)
        elif there < own and alike:
            least = max(least, found.numbers.number("accept.part") * added.gain)
    return least


def is_confused(found: Search, candidate: Candidate) -> bool:
    """Whether an effect added on its components, or their supply, is confused with a candidate or of its family."""
    others = (a.candidate for a in found.added if a.candidate != candidate)
    return any(_confused(other, candidate) and (_meet(other, candidate) or _meet(candidate, other)) for other in others)


def _confused(one: Candidate, other: Candidate) -> bool:
    first, second = one.family, other.family
    return first.named == second.named or first.named in second.confused_with or second.named in first.confused_with


def _meet(added: Candidate, candidate: Candidate) -> bool:
    """Whether a candidate is on a component of one added, or on oil that comes from the supply on which that is."""
    from_supply = SUPPLY in added.components and "flow" in candidate.family.shows_in
    return from_supply or bool({*added.components} & {*candidate.components})


def _places(parts: Sequence[Array]) -> NDArray[np.intp]:
    """The columns (k,) of which a group's candidates are combinations (n, q)."""
    return np.flatnonzero(np.hstack(parts).any(axis=1))


class CandidatePair(NamedTuple):
    """Two candidates together."""

    places: tuple[int, int]  # among the candidates
    gain: float  # of log-likelihood, the residual reweighted
    amplitudes: tuple[Array, Array]
    refused: str  # why they may not be added; empty if they may be


def score_pairs(found: Search, linear: Linearisation, candidates: Sequence[Candidate]) -> list[CandidatePair]:
    """All pairs of candidates at the present solution of a search, by falling gain."""
    problem, background, numbers = found.problem, linear.background, found.numbers
    weigh = Reweighting(found, background)
    ends = np.cumsum([0, *(len(c.amplitudes) for c in candidates)])
    columns = _all_columns(problem, linear.base, candidates)
    block = make_block(background, columns)
    if linear.replicas:
        noisy = [_all_columns(again, there, candidates) for again, there in linear.replicas]
        block = less_noise(background, block, columns, noisy)
    low, high = (np.concatenate(x) for x in zip(*(c.bounds for c in candidates), strict=True))
    spread, whole = np.concatenate([c.spread(numbers) for c in candidates]), np.eye(ends[-1])

    def scored(*places: int) -> tuple[NDArray[np.intp], Score]:
        """Amplitudes of some candidates together, and their score."""
        k = np.concatenate([np.arange(ends[i], ends[i + 1]) for i in places])
        return k, score(background, block.select(whole[:, k]), low[k], high[k], spread[k])

    alone = [scored(i)[1].gain for i in range(len(candidates))]
    pairs = []
    for i, j in combinations(range(len(candidates)), 2):
        k, one = scored(i, j)
        less = weigh.lowered(background.explained(columns, whole[:, k] @ one.amplitude), one)
        families = candidates[i].family, candidates[j].family
        why = refusal(families, one, less, numbers)
        if any(one.gain - alone[m] < gate(f, numbers) for f, m in zip(families, (j, i), strict=True)):
            why = "one of them explains as much"
        count = len(candidates[i].amplitudes)
        pairs.append(CandidatePair((i, j), less.gain, (one.amplitude[:count], one.amplitude[count:]), why))
    return sorted(pairs, key=lambda pair: -pair.gain)


def _all_columns(problem: Problem, base: OperatingPoint, candidates: Sequence[Candidate]) -> Columns:
    """Columns of every test, those of all candidates' amplitudes."""
    columns, parts = columns_of_groups(problem, base, [[candidate] for candidate in candidates])
    amplitudes = np.hstack([part for own in parts for part in own])
    return [c.select(amplitudes) for c in columns]
