"""The background of a search: what is refitted in every comparison, at its joint solution."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..identification.calibration.normal_equations import NormalEquations, bounds_of, positive
from ..identification.calibration.problem import Problem
from ..identification.calibration.whitened_residuals import real_bins, real_rows
from ..machine.parameters import Parameters
from .scores import Background

__all__ = ["make_background"]

Array = NDArray[np.float64]


def make_background(problem: Problem, normal: NormalEquations, x: Array, numbers: Parameters) -> Background:
    """Background from the normal equations at the solution x (p,); `normal` is corrected for noise.

    What is at its bound there, as `numbers` of the fit set it, goes no further: beyond it something else is wrong.
    """
    prior = problem.prior

    def rows(slopes: Sequence[NDArray[np.complex128]], root: Array) -> Array:
        """Real rows (n, p) of derivatives (m, c), in units of the priors."""
        return (real_rows(slopes, root) * prior[:, None]).T

    slope, rest, root, matrix, side = [], [], [], [], []
    for t, (own, left, power) in enumerate(zip(normal.slope, normal.residual, normal.power, strict=True)):
        w = np.sqrt(power)
        slope.append(rows(own, w))
        rest.append(real_bins(left, w))
        root.append(w)
        corrected, right = normal.of([t])
        matrix.append(positive(corrected * np.outer(prior, prior), np.ones(len(prior))))
        side.append(right * prior)
    noise = []
    if normal.bias is not None:
        for slopes, rests in zip(normal.bias.slope, normal.bias.residual, strict=True):
            changes = [rows(own, w) for own, w in zip(slopes, root, strict=True)]
            noise.append((changes, [real_bins(r, w) for r, w in zip(rests, root, strict=True)]))
    low, high = bounds_of(problem, numbers)
    near = 1e-3 * prior
    inward = (x <= low + near).astype(float) - (x >= high - near)
    return Background(slope, rest, root, np.array(matrix), np.array(side), x / prior, inward, noise)
