"""Estimates by single groups of residuals, to be compared with the joint estimate.

One step from the joint estimate x by the normal equations H, g of the group, corrected for noise in the derivatives,
with the prior's matrix P:

    estimate = x - A (g + P x),    A = (H + P)^-1,    covariance = A (H + B + B / n + P) A

B is the correction that H and g are less, a mean over n simulated draws. This is the covariance of corrected normal
equations (Fuller: Measurement Error Models, Wiley 1987, chapter 3) with the sampling of B in it; it is A where the
derivatives have no noise. In a single group some of them are mostly noise: A would be far too small. Along an
eigenvector of H with a negative eigenvalue the correction exceeds the signal: that direction, of right side and matrix
alike, is left to the prior.
"""

from collections.abc import Iterator

import numpy as np

from ...core.arrays import Array, Mask
from ...core.names import AXES
from ...machine.parameters import Parameters
from .normal_equations import NormalEquations
from .problem import Problem
from .result import Subset

__all__ = ["estimate_by", "subset_estimates"]


def subset_estimates(
    normal: NormalEquations, x: Array, factor: Array, floor: Array, numbers: Parameters
) -> tuple[Subset, ...]:
    """Estimates from the wrench along each axis, flows of each kind of actuator, and gas law alone, about x (p,).

    Predicted deviations have the factors (p,) of the joint estimate's (`expected_scatter`). NaN where they exceed
    `report.informative` of the prior's; none is below `floor` (p,).
    """
    problem = normal.problem
    found, tests = [], range(len(normal.residual))
    for name, columns in _groups(problem):
        matrix, right = normal.of(tests, columns)
        noise = normal.correction(tests, columns)[0]
        estimate, sd = estimate_by(matrix, right, noise, len(problem.again), x, problem.prior)
        sd = factor * sd
        known = sd < numbers.number("report.informative") * problem.prior
        found.append(Subset(name, np.where(known, estimate, np.nan), np.where(known, np.hypot(sd, floor), np.nan)))
    return tuple(found)


def estimate_by(matrix: Array, right: Array, noise: Array, draws: int, x: Array, prior: Array) -> tuple[Array, Array]:
    """Estimate and predicted deviations (p,) by corrected normal equations at x (p,), with priors (p,).

    `noise` (p, p) is what was subtracted to correct `matrix` (p, p), a mean over `draws`.
    """
    scale = np.outer(prior, prior)
    value, vector = np.linalg.eigh(matrix * scale)
    kept = vector[:, value > 0.0]
    held = kept @ kept.T
    inverse = np.linalg.inv((kept * value[value > 0.0]) @ kept.T + np.eye(len(x)))
    spread = held @ ((matrix + (1.0 + 1.0 / max(draws, 1)) * noise) * scale) @ held + np.eye(len(x))
    step = inverse @ (held @ (right * prior) + x / prior)
    return x - step * prior, np.sqrt(np.diag(inverse @ spread @ inverse)) * prior


def _groups(problem: Problem) -> Iterator[tuple[str, Mask]]:
    """Names of groups of residuals, and their columns (c,), if any.

    Whitening mixes columns with those before them; by the order of `RESIDUALS`, wrench and flow depend on no others.
    """
    flow, kinds = problem.rows("flow"), [a.kind for a in problem.machine.actuators]
    groups = [(f"wrench, {axis}", problem.rows("wrench", k)) for k, axis in enumerate(AXES)]
    for kind in dict.fromkeys(kinds):
        own = [problem.rows_of_actuator(i) for i, k in enumerate(kinds) if k == kind]
        groups.append((f"flow, {kind}", flow & np.any(own, axis=0)))
    groups.append(("gas law", problem.rows("gas")))
    return ((name, columns) for name, columns in groups if columns.any())
