"""Play identified from actuator lengths, before the library is searched.

Play is clearest in a length sensor on the rod, compared with the platen's pose: the rod changes sides with the sign of
its force. Lengths are regressed on that sign jointly with the errors of sensors and geometry, each with its prior. The
estimate is the prior of the play in the search. The contact side in the oil's balance is taken from the lengths:
friction and inertia of the rod shift the reversals predicted from the force of the oil.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.progress import Progress, split
from ..data.alignment import align_record, group_delays
from ..data.consistency import scaled_inverse
from ..data.sensor_pairs import LooseLength, loose_lengths
from ..data.sensors import SENSOR, SensorSet
from ..identification.calibration.expected_scatter import noise_at
from ..identification.calibration.fit import solve
from ..identification.prepare import HALF_PLAY, ROD_LENGTH
from ..machine.library import find_family, in_size_of
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.plant import Plant
from .acceptance import squares_by_column
from .candidates import Candidate
from .joint_fit import with_candidate
from .search_state import AddedEffect, FittedCandidate, Search, fitted_machine

__all__ = ["LostMotion", "lost_motion", "with_lost_motion", "with_rod_lengths"]


_CLOSING = 4
"""Closing forces tried, between those from which a search starts."""
_REWEIGHED = 3
"""Times that the residual is reweighted by its own power."""


class LostMotion(NamedTuple):
    """Play of one actuator: its rod leads the platen by the sign of its force."""

    component: str
    half_play: float  # [m]
    deviation: float  # standard
    closing_force: float = 0.0  # [N] that with which the lengths agree best
    length: tuple[Array | None, ...] = ()  # of each record (samples,): of the rod, less the errors of its sensor [m]

    @property
    def gain(self) -> float:
        """Log-likelihood of the lengths."""
        return 0.5 * (self.half_play / self.deviation) ** 2


def lost_motion(
    plant: Plant, records: Sequence[xr.Dataset], sensors: SensorSet, numbers: Parameters
) -> tuple[LostMotion, ...]:
    """Significant play from the lengths of all records; numbers are those of `models/procedures/discovery.toml`."""
    starts = next(s.start for s in find_family("swivel_play").shapes if s.name == "closing_force")
    closing = np.geomspace(min(starts), max(starts), _CLOSING).tolist()
    late = group_delays(plant, records, only=("actuator_displacement",))
    parts: dict[str, dict[int, LooseLength]] = {}
    for i, record in enumerate(records):
        for one in loose_lengths(plant, align_record(record, late), sensors, closing):
            parts.setdefault(one.name, {})[i] = one
    found = [_of_lengths(name, some, len(records), closing) for name, some in parts.items()]
    least, size = numbers.number("accept.confusable"), numbers.number("lengths.play")
    return tuple(one for one in found if one.half_play >= size and one.gain >= least)


def _of_lengths(name: str, parts: Mapping[int, LooseLength], count: int, closing: Sequence[float]) -> LostMotion:
    """Half the play by least squares of the lengths of some of `count` records, with errors of sensors and geometry.

    Of the forces `closing` [N] by which sides are known, that with which the lengths agree best.
    """
    comparisons = [one.comparison for one in parts.values()]
    due = np.array([term.due for term in comparisons[0].terms])
    rows, explained = [], []
    for c in comparisons:
        terms = np.stack([term.column for term in c.terms], axis=1)
        rows.append(np.hstack([terms, c.errors]))
        explained.append(terms @ due)
    x, y = np.vstack(rows), np.concatenate([c.y - known for c, known in zip(comparisons, explained, strict=True)])
    prior = np.zeros(1 + x.shape[1])
    prior[1 + len(due) :] = 1.0
    stated = float(np.mean([c.variance for c in comparisons])), len(y) / sum(c.independent for c in comparisons)
    sides = np.hstack([one.sides for one in parts.values()])
    fits = [_fit(np.column_stack([side, x]), y, prior, *stated) for side in sides]
    force, best = min(zip(closing, fits, strict=True), key=lambda pair: pair[1].variance)
    length: list[Array | None] = [None] * count
    for (i, one), row, known in zip(parts.items(), rows, explained, strict=True):
        length[i] = one.without(known + row @ best.theta[1:] - one.comparison.terms[0].column)
    return LostMotion(name, float(best.theta[0]), best.deviation, force, tuple(length))


class _Fit(NamedTuple):
    """Coefficients (p,), the standard deviation of the first, and the variance of what they leave."""

    theta: Array
    deviation: float
    variance: float


def _fit(x: Array, y: Array, prior: Array, stated: float, thinned: float) -> _Fit:
    """Least squares of y (n,) on x (n, p), weighed by its own residual, of which 1 in `thinned` samples counts.

    prior (p,) are those of the coefficients, stated is the least variance of a sample.
    """
    squares, products, variance = x.T @ x, x.T @ y, stated
    for _ in range(_REWEIGHED):
        weight = variance * thinned
        matrix = squares / weight + np.diag(prior)
        inverse = scaled_inverse(matrix, np.diag(matrix))
        theta = inverse @ products / weight
        variance = max(stated, float(np.mean((y - x @ theta) ** 2)))
    return _Fit(theta, float(np.sqrt(inverse[0, 0])), variance)


def with_rod_lengths(records: Sequence[xr.Dataset], lost: Sequence[LostMotion], machine: Machine) -> list[xr.Dataset]:
    """Records with the lengths of loose rods [m], less the errors of their sensors, as `rod_displacement`.

    It is (time, actuator), and NaN for a rod that is not loose or whose length is not measured.
    """
    play = {one.component: _common(group)[0] for group in _groups(lost, machine) for one in group}
    attributes = {
        "units": "m",
        SENSOR: "actuator_displacement",
        HALF_PLAY: [play.get(name, np.nan) for name in machine.actuator_names],
    }
    out = []
    for i, record in enumerate(records):
        lengths = {one.component: one.length[i] for one in lost if i < len(one.length)}
        none = np.full(record.sizes["time"], np.nan)
        columns = [none if (rod := lengths.get(name)) is None else rod for name in machine.actuator_names]
        rods = xr.Variable(("time", "actuator"), np.stack(columns, axis=1), attributes)
        out.append(record if all(column is none for column in columns) else record.assign({ROD_LENGTH: rods}))
    return out


def with_lost_motion(found: Search, lost: Sequence[LostMotion], progress: Progress) -> Search:
    """The search with the play identified from lengths; one common value where all actuators have similar play."""
    groups = _groups(lost, found.problem.machine)
    before, (*parts, last) = found, split(progress, len(groups) + 1)
    for group, part in zip(groups, parts, strict=True):
        found = _with_play(found, group, part)
    if groups:
        found = _reweighed(before, found, last)
    progress(1.0)
    return found


def _reweighed(before: Search, found: Search, progress: Progress) -> Search:
    """The search weighed by its noise: with play, that of lengths and poses is in the flows."""
    noise = [noise_at(one.problem, one.solution.x) for one in (before, found)]
    normal = found.solution.normal.reweighed(*noise)
    rest = found.calibration, found.solution.x, progress, normal
    return replace(found, problem=normal.problem, solution=solve(normal.problem, *rest, frugal=True, settled=True))


def _groups(lost: Sequence[LostMotion], machine: Machine) -> list[tuple[LostMotion, ...]]:
    """All together if all double-acting actuators have play, none twice as much as another."""
    if {one.component for one in lost} == set(machine.double_acting):
        sizes = np.array([one.half_play for one in lost])
        if len(sizes) > 1 and sizes.max() < 2.0 * sizes.min():
            return [tuple(lost)]
    return [(one,) for one in lost]


def _common(group: Sequence[LostMotion]) -> tuple[float, float]:
    """Half the play that a group shares, and its standard deviation [m]."""
    weight = np.array([one.deviation**-2.0 for one in group])
    return float(weight @ [one.half_play for one in group] / weight.sum()), float(weight.sum() ** -0.5)


def _with_play(found: Search, group: Sequence[LostMotion], progress: Progress) -> Search:
    family = in_size_of(find_family("swivel_play"), found.problem.machine)
    closing = max(group, key=lambda one: one.gain).closing_force
    candidate = Candidate(family, tuple(one.component for one in group), (("closing_force", closing),))
    size, deviation = _common(group)
    # hardly wider than its form may be off: impacts bias the estimate of play from the oil
    sd = float(np.hypot(deviation, found.numbers.number("lengths.form") * size))
    # the oil's balance, with sides from lengths, does not depend on the closing force
    every = candidate.fit_parameters((size,), found.numbers)
    own = tuple(replace(parameter, sd=sd) for parameter in every if parameter.name.endswith(".half_play"))
    more = found.solved(*with_candidate(found.problem, candidate, (size,), own, found.solution.x), progress)
    gain = sum(one.gain for one in group)
    contest = (FittedCandidate(candidate, 0.0, fitted_machine(more.solution)),)
    fall = squares_by_column(found.residual) - squares_by_column(more.residual)
    tried, whole = len(found.problem.machine.double_acting), gain + found.objective - more.objective
    return more.with_effect(AddedEffect(candidate, whole, 0, tried, contest, fall, 0.0, gain))
