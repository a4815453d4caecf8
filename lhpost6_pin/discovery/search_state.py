"""State of a search: candidates with scores, rounds of screening, effects added, the joint solution, linearised."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..core.arrays import Array, Complex, Mask
from ..core.progress import Progress
from ..identification.calibration.bin_rows import BinRows, row_by_column
from ..identification.calibration.expected_scatter import covariance_of_estimate, scatter_factor
from ..identification.calibration.fit import Solution, misfit, objective, solve
from ..identification.calibration.free_parameters import with_parameters
from ..identification.calibration.normal_equations import NormalEquations, bounds_of, positive
from ..identification.calibration.operating_point import OperatingPoint
from ..identification.calibration.problem import Problem
from ..identification.residuals import RESIDUALS
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from .candidates import Candidate
from .scores import Background, Score

__all__ = ["AddedEffect", "FittedCandidate", "Linearisation", "Round", "Scored", "Search", "best_per_family"]
__all__ += ["fitted_machine", "linearise"]


@dataclass(frozen=True)
class Scored:
    """A candidate with its score, and whether it may be added."""

    candidate: Candidate
    score: Score
    gain: float  # of log-likelihood, the residual reweighted; the linear gain where that is below the threshold
    closure: float  # share explained of the residual beyond noise, in the column where it explains most
    refused: str  # why it is not added; empty if it may be


def best_per_family(scored: Sequence[Scored], *, named: bool = False) -> list[Scored]:
    """The first of each entry of the library, or (`named`) of each family that a verdict reports."""
    found: dict[str, Scored] = {}
    for one in scored:
        family = one.candidate.family
        found.setdefault(family.named if named else family.name, one)
    return list(found.values())


@dataclass(frozen=True)
class FittedCandidate:
    """A candidate fitted jointly with all parameters, compared with the one that was added."""

    candidate: Candidate
    behind: float  # log-likelihood; 0 for the one added, and for one that gains more but is less simple
    machine: Machine  # with it, all numbers as fitted


@dataclass(frozen=True)
class AddedEffect:
    """An effect that the search has added."""

    candidate: Candidate
    gain: float  # of log-likelihood and log-prior, of the joint fit, and no more than what removing it costs
    round: int  # of the search, from 0
    tried: int  # candidates in that round
    contest: tuple[FittedCandidate, ...]  # itself, then the candidates fitted in its place
    fall: Array  # (c,) of the sum of squared residuals, by column
    apart: float  # log-likelihood within which two families explain the campaign equally well
    from_lengths: float = 0.0  # log-likelihood of length sensors, which are not among the residuals
    forms: tuple[str, ...] = ()  # families that were compared with it as forms of friction, before any screening

    @property
    def rivals(self) -> tuple[FittedCandidate, ...]:
        """Those of other families that explain the campaign equally well."""
        near = [one for one in self.contest[1:] if one.behind < self.apart]
        return tuple(one for one in near if one.candidate.family.named != self.candidate.family.named)


@dataclass(frozen=True)
class Round:
    """One screening of the library; candidates by falling gain."""

    scored: tuple[Scored, ...]

    @property
    def best(self) -> dict[str, Scored]:
        """The best candidate of each family, by falling gain."""
        return {one.candidate.family.named: one for one in best_per_family(self.scored, named=True)}


@dataclass(frozen=True)
class Search:
    """A search at its current solution."""

    problem: Problem  # with the effects added
    solution: Solution
    refit: Solution  # without any effect
    numbers: Parameters  # of `models/procedures/discovery.toml`
    calibration: Parameters  # of `calibration.toml`, with the entries that `discovery.toml` replaces
    added: tuple[AddedEffect, ...] = ()
    rounds: tuple[Round, ...] = ()
    # by the effects added and the one left out, where it was refitted without that
    without: Mapping[tuple[str, ...], "Search"] = field(default_factory=dict)

    def solved(self, problem: Problem, start: Array, progress: Progress, **options: Any) -> "Search":
        """The search with another problem solved from `start` (p,), by `options` of `solve`.

        Derivatives by unknowns that both problems share are reused.
        """
        known = self.solution.normal
        solution = solve(problem, self.calibration, start, progress, known, frugal=True, **options)
        return replace(self, problem=problem, solution=solution, without={})

    def moved(self, x: Array, again: Mask, progress: Progress) -> "Search":
        """The search at x (p,): derivatives by the unknowns `again` (p,) evaluated there, all others reused."""
        was = self.solution.normal
        normal = NormalEquations(self.problem, x, progress, was, again)
        normal = normal if was.bias is None else normal.less(was.bias)
        solution = self.solution._replace(x=x, at=x, normal=normal.released(), residual=normal.residual)
        return replace(self, solution=solution, without={})

    def restarted(self, progress: Progress) -> "Search":
        """The search with friction's states at the start of tests as they act on its machine, solved again from there.

        How long what is held there lasts, depends on its numbers.
        """
        x, normal = self.solution.x, self.solution.normal
        normal = normal.restarted(self.problem.plant_at(x))
        here = replace(self, problem=normal.problem, solution=self.solution._replace(normal=normal))
        return here.solved(here.problem, x, progress, settled=True)

    @cached_property
    def covariance(self) -> Array:
        """Covariance (p, p) of the unknowns by the expected scatter, the priors of effects' own parameters flat."""
        normal = self.solution.normal
        return covariance_of_estimate(normal, scatter_factor(normal, self.solution.at))

    @property
    def bare(self) -> "Search":
        """The search at its refit, without any effect."""
        return replace(self, problem=self.refit.normal.problem, solution=self.refit, added=(), without={})

    def with_effect(self, effect: AddedEffect) -> "Search":
        """The search with one more effect in its list."""
        return replace(self, added=(*self.added, effect))

    def less(self, candidate: Candidate) -> tuple[str, ...]:
        """Key of `without`."""
        return (*(one.candidate.name for one in self.added), candidate.name)

    @property
    def residual(self) -> list[Complex]:
        """Residual at the solution: whitened bins (m, c) of every test."""
        return self.solution.residual

    @property
    def power(self) -> float:
        """Mean square of the residual, each test with equal weight."""
        columns = self.problem.compared
        return float(np.mean([np.mean(np.abs(r[:, columns]) ** 2) for r in self.residual]))

    @property
    def objective(self) -> float:
        """Negative log-likelihood and log-prior at the solution."""
        return objective(self.problem, self.residual, self.solution.x)

    def misfit(self, kind: str) -> float:
        """Mean square of one kind of residual, each test with equal weight; nan where there is none."""
        return float(np.mean(misfit(self.problem, self.residual)[:, RESIDUALS.index(kind)]))


def fitted_machine(solution: Solution) -> Machine:
    """The machine of a solution, all numbers as fitted: with its effects, or as refitted without any."""
    problem = solution.normal.problem
    return with_parameters(problem.machine, problem.parameters, solution.x[: len(problem.parameters)])


class Linearisation(NamedTuple):
    """A solution of a search, linearised."""

    base: OperatingPoint
    background: Background  # that is refitted in every comparison
    replicas: tuple[tuple[Problem, OperatingPoint], ...]  # the same with more noise


def linearise(solution: Solution, calibration: Parameters, *, replicas: bool = False) -> Linearisation:
    """The background about a solution, corrected for noise; with replicas if candidates are to be screened.

    An unknown at its bound may only move inward.
    """
    normal, x = solution.normal, solution.at
    problem, prior, root = normal.problem, normal.problem.prior, [np.sqrt(power) for power in normal.power]

    def slopes(every: Sequence[BinRows]) -> list[BinRows]:
        """Rows of every test's derivatives, in units of the priors."""
        return [rows.weighed(w).scaled(prior) for rows, w in zip(every, root, strict=True)]

    def rests(every: Sequence[Complex]) -> list[Array]:
        return [row_by_column(r, w) for r, w in zip(every, root, strict=True)]

    equations = [normal.of([t]) for t in range(len(root))]
    matrix = np.array([positive(h * np.outer(prior, prior), np.ones(len(prior))) for h, _ in equations])
    side = np.array([g * prior for _, g in equations])
    bias = normal.bias
    noise = [] if bias is None else list(zip(map(slopes, bias.rows), map(rests, bias.residual), strict=True))
    low, high = bounds_of(problem, calibration)
    near = 1e-3 * prior
    inward = (x <= low + near).astype(float) - (x >= high - near)
    background = Background(slopes(normal.rows), rests(normal.residual), root, matrix, side, x / prior, inward, noise)
    more = tuple((r, OperatingPoint(r, x)) for r in problem.replicas) if replicas else ()
    normal.released()
    return Linearisation(OperatingPoint(problem, x), background, more)
