"""Play identified from actuator lengths, before the library is searched.

Play is clearest in a length sensor on the rod, compared with the platen's pose: the rod changes sides with the sign of
its force. Lengths are regressed on that sign jointly with the errors of sensors and geometry, each with its prior. The
estimate is the prior of the play in the search.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.progress import Progress, split
from ..data.consistency import scaled_inverse
from ..data.sensor_pairs import loose_lengths
from ..data.sensor_view import SensorComparison
from ..data.sensors import SensorSet
from ..machine.library import find_family, in_size_of
from ..machine.parameters import Parameters
from ..mechanics.plant import Plant
from .acceptance import squares_by_column
from .candidates import Candidate, first_shape
from .joint_fit import with_candidate
from .search_state import AddedEffect, FittedCandidate, Search, fitted_machine

__all__ = ["LostMotion", "lost_motion", "with_lost_motion"]


_REWEIGHED = 3
"""Times that the residual is reweighted by its own power."""


class LostMotion(NamedTuple):
    """Play of one actuator: its rod leads the platen by the sign of its force."""

    component: str
    half_play: float  # [m]
    deviation: float  # standard

    @property
    def gain(self) -> float:
        """Log-likelihood of the lengths."""
        return 0.5 * (self.half_play / self.deviation) ** 2


def lost_motion(
    plant: Plant, records: Sequence[xr.Dataset], sensors: SensorSet, numbers: Parameters
) -> tuple[LostMotion, ...]:
    """Significant play from the lengths of all records; numbers are those of `models/procedures/discovery.toml`."""
    closing = dict(first_shape(find_family("swivel_play")))["closing_force"]
    parts: dict[str, list[tuple[SensorComparison, Array]]] = {}
    for record in records:
        for name, comparison, side in loose_lengths(plant, record, sensors, closing):
            parts.setdefault(name, []).append((comparison, side))
    found = [LostMotion(name, *_play(some)) for name, some in parts.items()]
    least, size = numbers.number("accept.confusable"), numbers.number("lengths.play")
    return tuple(one for one in found if one.half_play >= size and one.gain >= least)


def _play(parts: Sequence[tuple[SensorComparison, Array]]) -> tuple[float, float]:
    """Half the play and its standard deviation [m]: least squares, with errors of sensors and geometry in them."""
    due = np.array([term.due for term in parts[0][0].terms])
    rows, rest = [], []
    for c, side in parts:
        terms = np.stack([term.column for term in c.terms], axis=1)
        rows.append(np.hstack([side[:, None], terms, c.errors]))
        rest.append(c.y - terms @ due)
    x, y = np.vstack(rows), np.concatenate(rest)
    prior = np.zeros(x.shape[1])
    prior[1 + len(due) :] = 1.0
    thinned = len(y) / sum(c.independent for c, _ in parts)
    stated = float(np.mean([c.variance for c, _ in parts]))
    variance = stated
    for _ in range(_REWEIGHED):
        matrix = x.T @ x / (variance * thinned) + np.diag(prior)
        inverse = scaled_inverse(matrix, np.diag(matrix))
        theta = inverse @ (x.T @ y) / (variance * thinned)
        variance = max(stated, float(np.mean((y - x @ theta) ** 2)))
    return float(theta[0]), float(np.sqrt(inverse[0, 0]))


def with_lost_motion(found: Search, lost: Sequence[LostMotion], progress: Progress) -> Search:
    """The search with the play identified from lengths; one common value where all actuators have similar play."""
    groups = _groups(lost, found)
    for group, part in zip(groups, split(progress, len(groups)), strict=True):
        found = _with_play(found, group, part)
    progress(1.0)
    return found


def _groups(lost: Sequence[LostMotion], found: Search) -> list[tuple[LostMotion, ...]]:
    """All together if all double-acting actuators have play, none twice as much as another."""
    if {one.component for one in lost} == set(found.problem.machine.double_acting):
        sizes = np.array([one.half_play for one in lost])
        if len(sizes) > 1 and sizes.max() < 2.0 * sizes.min():
            return [tuple(lost)]
    return [(one,) for one in lost]


def _with_play(found: Search, group: Sequence[LostMotion], progress: Progress) -> Search:
    family = in_size_of(find_family("swivel_play"), found.problem.machine)
    candidate = Candidate(family, tuple(one.component for one in group), first_shape(family))
    weight = np.array([one.deviation**-2.0 for one in group])
    size = float(weight @ [one.half_play for one in group] / weight.sum())
    # hardly wider than its form may be off: impacts bias the estimate of play from the oil
    sd = float(np.hypot(weight.sum() ** -0.5, found.numbers.number("lengths.form") * size))
    own = tuple(
        replace(parameter, sd=sd) if parameter.name.endswith(".half_play") else parameter
        for parameter in candidate.fit_parameters((size,), found.numbers)
    )
    more = found.solved(*with_candidate(found.problem, candidate, (size,), own, found.solution.x), progress)
    gain = sum(one.gain for one in group)
    contest = (FittedCandidate(candidate, 0.0, fitted_machine(more.solution)),)
    fall = squares_by_column(found.residual) - squares_by_column(more.residual)
    tried, whole = len(found.problem.machine.double_acting), gain + found.objective - more.objective
    return more.with_effect(AddedEffect(candidate, whole, 0, tried, contest, fall, 0.0, gain))
