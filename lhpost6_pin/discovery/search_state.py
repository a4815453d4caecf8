"""What a search knows: candidates as scored, rounds of screening, effects added, and where it stands."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..identification.calibration.fit import Solution, misfit, objective
from ..identification.calibration.free_parameters import with_parameters
from ..identification.calibration.prepare import PreparedProblem
from ..identification.calibration.problem import OperatingPoint, Problem
from ..identification.residuals import RESIDUALS
from ..machine.machine import Machine
from .candidates import Candidate
from .scores import Background, Score

__all__ = [
    "AddedEffect",
    "FittedCandidate",
    "Round",
    "Scored",
    "Search",
    "Linearisation",
    "best_per_family",
    "fitted_machine",
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


def best_per_family(scored: Sequence[Scored], *, named: bool = False) -> list[Scored]:
    """The first of each entry of the library, or of each name that a verdict gives."""
    found: dict[str, Scored] = {}
    for one in scored:
        family = one.candidate.family
        found.setdefault(family.named if named else family.name, one)
    return list(found.values())


@dataclass(frozen=True)
class FittedCandidate:
    """A family that was fitted in full for the same place, and how far it stands behind the one that was added."""

    candidate: Candidate
    behind: float  # log-likelihood; 0 for the one added, below that for one that is less simple
    machine: Machine  # with it, all numbers as fitted


@dataclass(frozen=True)
class AddedEffect:
    """An effect that the search has added."""

    candidate: Candidate
    gain: float  # of log-likelihood and log-prior, of the joint fit
    round: int  # of the search, from 0
    tried: int  # candidates in that round
    contest: tuple[FittedCandidate, ...]
    fall: Array  # (c,) of the squares of what is left, by column
    apart: float  # log-likelihood within which two families explained the campaign alike
    from_lengths: float = 0.0  # log-likelihood of what is not in the search's residuals: lengths

    @property
    def rivals(self) -> tuple[FittedCandidate, ...]:
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
        return {one.candidate.family.named: one for one in best_per_family(self.scored, named=True)}


@dataclass(frozen=True)
class Linearisation:
    """The search's place, ready for candidates."""

    base: OperatingPoint
    background: Background
    replicas: tuple[tuple[Problem, OperatingPoint], ...]  # the same with more noise


@dataclass
class Search:
    """Where a search stands, and how it came there."""

    ready: PreparedProblem
    solution: Solution
    refit: Solution  # without any effect
    added: list[AddedEffect] = field(default_factory=list)
    rounds: list[Round] = field(default_factory=list)

    @property
    def problem(self) -> Problem:
        """The problem with the effects added."""
        return self.ready.problem

    @property
    def residual(self) -> list[NDArray[np.complex128]]:
        """What is left at the solution: whitened bins (m, c) of every test."""
        return self.solution.residual

    @property
    def power(self) -> float:
        """Mean square of what is left, over all tests alike."""
        return float(np.mean([np.mean(np.abs(r) ** 2) for r in self.residual]))

    @property
    def objective(self) -> float:
        """Negative log-likelihood and log-prior at the solution."""
        return objective(self.problem, self.residual, self.solution.x)

    def misfit(self, kind: str) -> float:
        """Mean square of what is left of one kind, over all tests alike; nan where there is none."""
        return float(np.mean(misfit(self.problem, self.residual)[:, RESIDUALS.index(kind)]))


def fitted_machine(solution: Solution) -> Machine:
    """The machine of a solution, all numbers as fitted: with its effects, or as refitted without any."""
    problem = solution.normal.problem
    return with_parameters(problem.machine, problem.parameters, solution.x[: len(problem.parameters)])
