"""Play identified from actuator lengths, before the library is searched.

Play is clearest in a length sensor on the rod, compared with the platen's pose: the rod changes sides with the sign of
its force. Lengths are regressed on that sign jointly with the errors of sensors and geometry, each with its prior. The
estimate is the prior of the play in the search. The oil's balance then takes the side of the pin from the lengths, not
from the oil's force: friction and inertia of the rod, which that lacks, shift the moments at which it changes sides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.progress import Progress, split
from ..data.consistency import scaled_inverse
from ..data.sensor_pairs import LooseLength, loose_lengths
from ..data.sensors import SensorSet
from ..identification.prepare import CONTACT_SIDE
from ..machine.library import find_family, in_size_of
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.plant import Plant
from .acceptance import squares_by_column
from .candidates import Candidate, first_shape
from .joint_fit import with_candidate
from .search_state import AddedEffect, FittedCandidate, Search, fitted_machine

__all__ = ["LostMotion", "lost_motion", "with_contact_sides", "with_lost_motion"]


_REWEIGHED = 3
"""Times that the residual is reweighted by its own power."""


class LostMotion(NamedTuple):
    """Play of one actuator: its rod leads the platen by the sign of its force."""

    component: str
    half_play: float  # [m]
    deviation: float  # standard
    travel: tuple[Array | None, ...] = ()  # of each record (samples,): rod ahead of the platen, from its length [m]

    @property
    def gain(self) -> float:
        """Log-likelihood of the lengths."""
        return 0.5 * (self.half_play / self.deviation) ** 2


def lost_motion(
    plant: Plant, records: Sequence[xr.Dataset], sensors: SensorSet, numbers: Parameters
) -> tuple[LostMotion, ...]:
    """Significant play from the lengths of all records; numbers are those of `models/procedures/discovery.toml`."""
    closing = dict(first_shape(find_family("swivel_play")))["closing_force"]
    parts: dict[str, dict[int, LooseLength]] = {}
    for i, record in enumerate(records):
        for one in loose_lengths(plant, record, sensors, closing):
            parts.setdefault(one.name, {})[i] = one
    found = [_of_lengths(name, some, len(records)) for name, some in parts.items()]
    least, size = numbers.number("accept.confusable"), numbers.number("lengths.play")
    return tuple(one for one in found if one.half_play >= size and one.gain >= least)


def _of_lengths(name: str, parts: Mapping[int, LooseLength], count: int) -> LostMotion:
    """Half the play by least squares of the lengths of some of `count` records, with errors of sensors and geometry."""
    comparisons = [one.comparison for one in parts.values()]
    due = np.array([term.due for term in comparisons[0].terms])
    rows, explained = [], []
    for one in parts.values():
        terms = np.stack([term.column for term in one.comparison.terms], axis=1)
        rows.append(np.hstack([one.side[:, None], terms, one.comparison.errors]))
        explained.append(terms @ due)
    x, y = np.vstack(rows), np.concatenate([c.y - known for c, known in zip(comparisons, explained, strict=True)])
    prior = np.zeros(x.shape[1])
    prior[1 + len(due) :] = 1.0
    thinned = len(y) / sum(c.independent for c in comparisons)
    stated = float(np.mean([c.variance for c in comparisons]))
    variance = stated
    for _ in range(_REWEIGHED):
        matrix = x.T @ x / (variance * thinned) + np.diag(prior)
        inverse = scaled_inverse(matrix, np.diag(matrix))
        theta = inverse @ (x.T @ y) / (variance * thinned)
        variance = max(stated, float(np.mean((y - x @ theta) ** 2)))
    travel: list[Array | None] = [None] * count
    for (i, one), row, known in zip(parts.items(), rows, explained, strict=True):
        travel[i] = one.travel(known + row[:, 1:] @ theta[1:])
    return LostMotion(name, float(theta[0]), float(np.sqrt(inverse[0, 0])), tuple(travel))


def with_contact_sides(records: Sequence[xr.Dataset], lost: Sequence[LostMotion], machine: Machine) -> list[xr.Dataset]:
    """Records with the side of the play on which each loose pin stands, `contact_side` (time, actuator) [1].

    It is the rod's travel in units of half the play; NaN for a pin that is not loose or whose length is not measured.
    """
    out = []
    for i, record in enumerate(records):
        each = ((one, one.travel[i]) for one in lost)
        known = {one.component: travel / one.half_play for one, travel in each if travel is not None}
        none = np.full(record.sizes["time"], np.nan)
        columns = np.stack([known.get(name, none) for name in machine.actuator_names], axis=1)
        out.append(record.assign({CONTACT_SIDE: (("time", "actuator"), columns)}) if known else record)
    return out


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
