"""Pairs of candidates: what two effects explain together, where one by one they would not be found.

A search adds one effect after the other. Two of which each explains too little of what both have left pass only
together; and one of a wrong form may stand in for two, so that neither is added after it.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..identification.calibration.problem import OperatingPoint, Problem
from ..machine.parameters import Parameters
from .acceptance import Reweighting, gate, refusal
from .candidate_columns import Columns, columns_of, side_by_side
from .candidates import Candidate
from .scores import less_noise, make_block, score
from .search_state import Linearisation

__all__ = ["CandidatePair", "score_pairs"]

Array = NDArray[np.float64]


class CandidatePair(NamedTuple):
    """Two candidates together."""

    places: tuple[int, int]  # among the candidates
    gain: float  # of log-likelihood, with what is left weighed anew
    amplitudes: tuple[Array, Array]
    refused: str  # why they may not be added; empty if they may be


def score_pairs(
    problem: Problem, linear: Linearisation, weigh: Reweighting, candidates: Sequence[Candidate], numbers: Parameters
) -> list[CandidatePair]:
    """All pairs of candidates where a search of the problem stands, by falling gain."""
    background = linear.background
    ends = np.cumsum([0, *(len(c.amplitudes) for c in candidates)])
    columns = _all_columns(problem, linear.base, candidates)
    noisy = [_all_columns(again, there, candidates) for again, there in linear.replicas]
    block = make_block(background, columns)
    if noisy:
        block = less_noise(background, block, columns, noisy)
    low, high = (np.concatenate(x) for x in zip(*(c.bounds for c in candidates), strict=True))
    spread = np.concatenate([c.spread(numbers) for c in candidates])

    def together(*places: int) -> NDArray[np.intp]:
        return np.concatenate([np.arange(ends[i], ends[i + 1]) for i in places])

    whole = np.eye(ends[-1])
    alone = [score(background, block.select(whole[:, k]), low[k], high[k], spread[k]).gain
             for k in map(together, range(len(candidates)))]  # fmt: skip
    found = []
    for i, j in combinations(range(len(candidates)), 2):
        k = together(i, j)
        one = score(background, block.select(whole[:, k]), low[k], high[k], spread[k])
        less = weigh.lowered(background.explained([c[..., k] for c in columns], one.amplitude), one)
        families = candidates[i].family, candidates[j].family
        why = refusal(families, one, less, numbers)
        required = all(
            one.gain - other >= gate(family, numbers)
            for family, other in zip(families, (alone[j], alone[i]), strict=True)
        )
        count = len(candidates[i].amplitudes)
        amplitudes = one.amplitude[:count], one.amplitude[count:]
        found.append(CandidatePair((i, j), less.gain, amplitudes, why if required else "one of them explains as much"))
    return sorted(found, key=lambda pair: -pair.gain)


def _all_columns(problem: Problem, base: OperatingPoint, candidates: Sequence[Candidate]) -> Columns:
    """Columns (m, c, k) of every test, those of all candidates' amplitudes."""
    each = []
    for candidate in candidates:
        columns, (part,) = columns_of(problem, base, [candidate])
        each.append([c @ part for c in columns])
    return side_by_side(each)
