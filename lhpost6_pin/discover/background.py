"""The background of a search: what is refitted in every comparison.

Known parameters and sensor errors at their joint solution, and scatter: twins (actuators of a kind) are never quite
alike, so that each may differ a little in what `models/procedures/discovery.toml` states under [scatter].
"""

from collections.abc import Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from ..calibration.normal import Normal, positive
from ..calibration.problem import Base, Problem
from ..library import find_family
from .candidates import Candidate
from .columns import columns_of
from .screen import Background, real_bins

__all__ = ["make_background", "scatter_of"]

Array = NDArray[np.float64]


def scatter_of(problem: Problem, families: Sequence[tuple[str, str]], share: float) -> list[tuple[Candidate, float]]:
    """Candidates of scatter with the standard deviations of their amplitudes: a share of the components' own numbers.

    families pairs a family with the number of a component that its amplitude adds to.
    """
    found = []
    for name, number in families:
        family = find_family(name)
        for component in problem.machine.components:
            own = getattr(component, number, None)
            if own and component.name in family.components(problem.machine):
                found.append((Candidate(family, (component.name,), ()), share * own))
    return found


def make_background(
    problem: Problem,
    normal: Normal,
    x: Array,
    base: Base,
    scatter: Sequence[tuple[Candidate, float]],
) -> Background:
    """Background from the normal equations at the solution x (p,); `normal` is corrected for noise."""
    alike = [list(group) for _, group in groupby((c for c, _ in scatter), key=lambda c: c.family.name)]
    columns = []
    for group in alike:
        found, parts = columns_of(problem, base, group)
        columns.append([c @ np.hstack(parts) for c in found])
    count, prior = len(problem.prior), np.append(problem.prior, [sd for _, sd in scatter])
    slope, rest, root, matrix, side = [], [], [], [], []
    for t, (own, r, power) in enumerate(zip(normal.slope, normal.rest, normal.power, strict=True)):
        w = np.sqrt(power)
        j = real_bins(np.concatenate([own, *(c[t] for c in columns)], axis=-1), w) * prior
        left = real_bins(r, w)
        h, g = j.T @ j, j.T @ left
        corrected, right = normal.of([t])
        h[:count, :count] = corrected * np.outer(problem.prior, problem.prior)
        g[:count] = right * problem.prior
        slope.append(j)
        rest.append(left)
        root.append(w)
        matrix.append(positive(h, np.ones(len(h))))
        side.append(g)
    place = np.append(x / problem.prior, np.zeros(len(scatter)))
    return Background(slope, rest, root, np.array(matrix), np.array(side), place)
