"""Linearisation of a search about its joint solution: the background that is refitted in every comparison."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array, Complex
from ..identification.calibration.fit import Solution
from ..identification.calibration.normal_equations import NormalEquations, bounds_of, positive
from ..identification.calibration.problem import OperatingPoint, Problem
from ..identification.calibration.whitened_residuals import real_bins, real_rows
from ..machine.parameters import Parameters
from .scores import Background

__all__ = ["Linearisation", "linearise"]


class Linearisation(NamedTuple):
    """The solution of a search, ready for candidates."""

    base: OperatingPoint
    background: Background
    replicas: tuple[tuple[Problem, OperatingPoint], ...]  # the same with more noise


def linearise(solution: Solution, calibration: Parameters, *, replicas: bool = False) -> Linearisation:
    """Background about a solution, with replicas of its problem if candidates are to be screened."""
    problem, at = solution.normal.problem, solution.at
    background = _background(problem, solution.normal, at, calibration)
    more = tuple((r, OperatingPoint(r, at)) for r in problem.replicas) if replicas else ()
    return Linearisation(OperatingPoint(problem, at), background, more)


def _background(problem: Problem, normal: NormalEquations, x: Array, calibration: Parameters) -> Background:
    """Background from the normal equations at the solution x (p,); `normal` is corrected for noise.

    An unknown at its bound may only move inward.
    """
    prior = problem.prior

    def rows(slopes: Sequence[Complex], root: Array) -> Array:
        """Real rows (n, p) of derivatives (m, c), in units of the priors."""
        return (real_rows(slopes, root) * prior[:, None]).T

    root = [np.sqrt(power) for power in normal.power]
    slope = [rows(own, w) for own, w in zip(normal.slope, root, strict=True)]
    residual = [real_bins(r, w) for r, w in zip(normal.residual, root, strict=True)]
    equations = [normal.of([t]) for t in range(len(root))]
    matrix = np.array([positive(h * np.outer(prior, prior), np.ones(len(prior))) for h, _ in equations])
    side = np.array([g * prior for _, g in equations])
    noise = []
    if normal.bias is not None:
        for slopes, rests in zip(normal.bias.slope, normal.bias.residual, strict=True):
            changes = [rows(own, w) for own, w in zip(slopes, root, strict=True)]
            noise.append((changes, [real_bins(r, w) for r, w in zip(rests, root, strict=True)]))
    low, high = bounds_of(problem, calibration)
    near = 1e-3 * prior
    inward = (x <= low + near).astype(float) - (x >= high - near)
    return Background(slope, residual, root, matrix, side, x / prior, inward, noise)
