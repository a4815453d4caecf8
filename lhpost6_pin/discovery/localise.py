"""Location of a misfit: every column of residuals in groups of frequency bands."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..core.arrays import Complex
from ..core.names import AXES
from ..identification.calibration.problem import Problem
from ..identification.residuals import RESIDUALS

__all__ = ["Spot", "gap_map", "worst_spots"]


_GROUPS = (0, 2, 4, 6)  # first bands of groups
_MOST = 4  # spots that are reported


class Spot(NamedTuple):
    """A column of residuals in a group of bands, over all tests."""

    kind: str  # of residuals
    label: str  # axis, chamber, strut or actuator
    band: tuple[float, float]  # [Hz]
    misfit: float  # mean square of whitened bins: 1 is noise alone; nan without bins
    excess: float  # squares beyond noise

    @property
    def description(self) -> str:
        """As in ``flow H3 A, 3 to 12 Hz``."""
        return f"{self.kind} {self.label}, {self.band[0]:g} to {self.band[1]:g} Hz"


def gap_map(problem: Problem, residual: Sequence[Complex]) -> list[list[Spot]]:
    """Of every column of a problem's residuals its spots by rising frequency; `residual` by test (m, c)."""
    edges = problem.whitener.edges
    bands = list(pairwise(float(edges[k]) for k in (*_GROUPS, len(edges) - 1)))
    starts, f = [low for low, _ in bands], np.concatenate(problem.frequency)
    group = np.searchsorted(starts, f, side="right") - 1
    squares = np.abs(np.concatenate(residual)) ** 2
    found = []
    for kind in RESIDUALS:
        columns = np.flatnonzero(problem.rows(kind))
        for label, column in zip(_labels(problem, kind), columns.tolist(), strict=False):
            spots = []
            for k, band in enumerate(bands):
                own = squares[group == k, column]
                mean = float(own.mean()) if own.size else float("nan")
                spots.append(Spot(kind, label, band, mean, float(np.sum(own - 1.0))))
            found.append(spots)
    return found


def worst_spots(problem: Problem, residual: Sequence[Complex]) -> list[Spot]:
    """The few spots with most of the residual beyond noise, by falling share."""
    spots = [spot for row in gap_map(problem, residual) for spot in row if spot.excess > 0.0]
    spots.sort(key=lambda spot: -spot.excess)
    least = 0.1 * sum(spot.excess for spot in spots)
    return [spot for spot in spots if spot.excess >= least][:_MOST] or spots[:1]


def _labels(problem: Problem, kind: str) -> Sequence[str]:
    """Names of the columns of a kind of residuals that are compared."""
    machine = problem.machine
    chambers = [f"{name} A" for name in machine.actuator_names] + [f"{name} B" for name in machine.double_acting]
    named = {
        "wrench": [AXES[i] for i in problem.axes],
        "flow": chambers,
        "gas": machine.strut_names,
        "supply": ("pressure",),
    }
    return named.get(kind, machine.actuator_names)
