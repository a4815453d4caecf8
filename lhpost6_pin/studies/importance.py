"""Which uncertain number matters most: first-order Sobol indices of an ensemble's results, by random balance designs.

The index of a number is the share of a result's variance that the number explains alone. Random balance designs with
Fourier amplitudes (RBD-FAST; Tarantola et al. 2006, Tissot and Prieur 2012) estimate it from any space-filling sample,
such as that of an ensemble, by SALib.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import ParameterError
from ..core.optional import INSTALL
from ..machine.parameters import Parameters

__all__ = ["Importance", "importances"]

FEWEST = 60
"""Machines below which no index is estimated: its interval would be half as wide as its range."""


class Importance(NamedTuple):
    """First-order Sobol index of one number for one result."""

    parameter: str
    first_order: float  # share of the result's variance
    chance: float  # what the largest of all indices exceeds by chance alone, as rarely as intervals err

    @property
    def sure(self) -> bool:
        """Whether it is beyond chance."""
        return self.first_order > self.chance


FEWEST = 60
"""Machines below which no index is estimated: chance alone would exceed a third of the variance."""


def importances(names: list[str], coordinates: Array, result: Array, numbers: Parameters) -> tuple[Importance, ...]:
    """Indices of all numbers for a result (n,) of machines at `coordinates` (n, k), the largest first.

    The level of chance is that of the largest index after permutations of the result, which follows from nothing then.
    Empty with too few finite results, or a result that does not vary. Else raises ParameterError if SALib is not
    installed.
    """
    some = np.isfinite(result)
    y, x = result[some], coordinates[some]
    if len(y) < FEWEST or np.ptp(y) <= 1e-12 * np.abs(y).max():
        return ()
    try:
        from SALib.analyze import rbd_fast
    except ImportError:
        raise ParameterError(f"importance needs SALib: {INSTALL['SALib']}") from None
    harmonics = min(int(numbers.number("importance.harmonics")), len(y) // 4 - 1)
    problem = {"num_vars": len(names), "names": names, "bounds": np.stack([x.min(axis=0), x.max(axis=0)], 1).tolist()}

    def first_order(values: Array) -> Array:
        return np.asarray(rbd_fast.analyze(problem, x, values, M=harmonics, num_resamples=2, seed=0)["S1"], float)

    rng = np.random.default_rng(0)
    largest = [first_order(rng.permutation(y)).max() for _ in range(int(numbers.number("importance.permutations")))]
    chance = float(np.quantile(largest, numbers.number("risk.confidence")))
    rows = zip(names, first_order(y).tolist(), strict=True)
    return tuple(sorted((Importance(name, share, chance) for name, share in rows), key=lambda one: -one.first_order))
