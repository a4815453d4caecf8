"""What noise does to a campaign's residuals and to the estimates from them, by simulated draws.

Covariance of the estimate by corrected normal equations (matrix H, less the mean B of n draws, with the prior's P):

    F A (H + B + B / n + P) A F,    A = (H + P)^-1

B + B / n is the noise in the derivatives and in its correction (Fuller: Measurement Error Models, Wiley 1987,
chapter 3). H takes noise to be alike along a test. That of friction is not: it is in the reversals, and so are the
derivatives by its numbers. The steps A J^T W dr that the draws' own residuals dr would cause scatter by more than
A (H + B) A then; the factors F, one at least, are what they do so by.
"""

import numpy as np

from ...core.arrays import Array
from .normal_equations import NormalEquations, positive
from .problem import Problem
from .whitened_residuals import mean_squares

__all__ = ["covariance_of_estimate", "noise_at", "scatter_factor"]


def noise_at(problem: Problem, x: Array) -> Array:
    """Mean squares (t, b, c) of whitened noise with the unknowns at x (p,)."""
    found = np.zeros((len(problem.tests), len(problem.whitener.edges) - 1, sum(problem.widths)))
    for t, (draws, f) in enumerate(zip(problem.noise_draws(x), problem.frequency, strict=True)):
        squares = np.mean([np.abs(bins) ** 2 for bins in draws], axis=0)
        found[t, np.unique(problem.whitener.band(f))] = mean_squares(problem.whitener, squares, f)[0]
    return found


def scatter_factor(normal: NormalEquations, x: Array) -> Array:
    """Factors F (p,) on predicted deviations by the draws of noise, of normal equations evaluated at x (p,)."""
    matrix, noise, inverse = _matrices(normal)
    draws = zip(*normal.problem.noise_draws(x), strict=True)
    steps = np.array([inverse @ normal.right_side(draw) for draw in draws])
    expected = np.diag(inverse @ (matrix + noise) @ inverse)
    seen = np.mean(steps**2, axis=0)
    ratio = np.divide(seen, expected, out=np.ones(len(seen)), where=expected > 0.0)  # zero: in no residual
    return np.asarray(np.sqrt(np.maximum(1.0, ratio)))


def covariance_of_estimate(normal: NormalEquations, factor: Array) -> Array:
    """Covariance (p, p) of the estimate by normal equations, with factors (p,) on its deviations."""
    matrix, noise, inverse = _matrices(normal)
    problem = normal.problem
    spread = matrix + (1.0 + 1.0 / max(len(problem.again), 1)) * noise + np.diag(problem.prior**-2.0)
    return np.asarray(np.outer(factor, factor) * (inverse @ spread @ inverse))


def _matrices(normal: NormalEquations) -> tuple[Array, Array, Array]:
    """H, B and A, (p, p) each."""
    prior = normal.problem.prior
    matrix, noise = positive(normal.whole[0], prior), normal.correction(range(len(normal.residual)))[0]
    return matrix, noise, np.asarray(np.linalg.inv(matrix + np.diag(prior**-2.0)), np.float64)
