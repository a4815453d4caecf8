"""Which uncertain number matters most: first-order Sobol indices of an ensemble's results, by random balance designs.

The index of a number is the share of a result's variance that the number explains alone. Random balance designs with
Fourier amplitudes (RBD-FAST; Tarantola et al. 2006, Tissot and Prieur 2012) estimate it from any space-filling sample,
such as that of an ensemble, by SALib.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import ParameterError
from ..machine.parameters import Parameters

__all__ = ["Importance", "importances"]

FEWEST = 60
"""Machines below which no index is estimated: its interval would be half as wide as its range."""


class Importance(NamedTuple):
    """First-order Sobol index of one number for one result."""

    parameter: str
    first_order: float  # share of the result's variance
    half_width: float  # of its interval

    @property
    def sure(self) -> bool:
        """Whether its interval is above zero."""
        return self.first_order > self.half_width


def importances(names: list[str], coordinates: Array, result: Array, numbers: Parameters) -> tuple[Importance, ...]:
    """Indices of all numbers for a result (n,) of machines at `coordinates` (n, k), the largest first.

    Empty with too few finite results, or a result that does not vary. Raises ParameterError if SALib is not installed.
    """
    try:
        from SALib.analyze import rbd_fast
    except ImportError:
        raise ParameterError('importance needs SALib: pip install "lhpost6-pin[ensembles]"') from None
    some = np.isfinite(result)
    y, x = result[some], coordinates[some]
    if len(y) < FEWEST or np.ptp(y) <= 1e-12 * np.abs(y).max():
        return ()
    n = numbers.number
    harmonics = min(int(n("importance.harmonics")), len(y) // 4 - 1)
    problem = {"num_vars": len(names), "names": names, "bounds": np.stack([x.min(axis=0), x.max(axis=0)], 1).tolist()}
    found = rbd_fast.analyze(
        problem,
        x,
        y,
        M=harmonics,
        num_resamples=int(n("importance.resamples")),
        conf_level=n("risk.confidence"),
        seed=0,
    )
    rows = zip(names, found["S1"], found["S1_conf"], strict=True)
    return tuple(sorted((Importance(a, float(b), float(c)) for a, b, c in rows), key=lambda one: -one.first_order))
