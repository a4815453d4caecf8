"""Pairs of candidates: two effects that together explain what neither explains alone.

A search adds one effect after the other. Two effects of which each leaves much of the other's residual pass only
together; and one of a wrong form may stand in for two, so that neither is added after it.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..identification.calibration.problem import OperatingPoint, Problem
from .acceptance import Reweighting, gate, refusal
from .candidate_columns import Columns, columns_of, side_by_side
from .candidates import Candidate
from .linearisation import Linearisation
from .scores import Score, less_noise, make_block, score
from .search_state import Search

__all__ = ["CandidatePair", "score_pairs"]


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
        less = weigh.lowered(background.explained([c[..., k] for c in columns], one.amplitude), one)
        families = candidates[i].family, candidates[j].family
        why = refusal(families, one, less, numbers)
        if any(one.gain - alone[m] < gate(f, numbers) for f, m in zip(families, (j, i), strict=True)):
            why = "one of them explains as much"
        count = len(candidates[i].amplitudes)
        pairs.append(CandidatePair((i, j), less.gain, (one.amplitude[:count], one.amplitude[count:]), why))
    return sorted(pairs, key=lambda pair: -pair.gain)


def _all_columns(problem: Problem, base: OperatingPoint, candidates: Sequence[Candidate]) -> Columns:
    """Columns (m, c, k) of every test, those of all candidates' amplitudes."""
    each = []
    for candidate in candidates:
        columns, (part,) = columns_of(problem, base, [candidate])
        each.append([c @ part for c in columns])
    return side_by_side(each)
