"""Validation on held-out tests: the normalised RMS error of the model before and after.

Three models: as delivered; refitted, with parameters and sensor errors but no effect; after, with the effects. The gap
of a phase of a test is the RMS, over all columns that move, of the model's error in standard deviations of the sensor
noise, so that noise alone gives one. The noise that reaches a balance depends on the model's numbers; all three errors
are over that of the model with the effects.

closure = (refitted - after) / (refitted - floor); the floor is expected of a model that lacks nothing (`floor`).
share of an effect = 1 - after^2 / without^2: of the squared error of the model without that effect, everything else
refitted, the part that the effect removes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.processes import by_processes
from ..core.progress import Progress
from ..data.campaign import Campaign
from ..data.sensors import SensorSet
from ..identification.calibration.prepare import as_simulated
from ..identification.validation import PHASES, Phase, Validation, validate
from ..identification.validation.prepare_tests import Numbers
from ..machine.machine import Machine
from .floor import COMPARED, NOISE, expected_gaps, model_at, normalised_error
from .search import without_effect
from .search_state import Search

__all__ = ["Gap", "Proof", "prove"]

SHOWN = 0.1
"""Gap beyond the floor from which an effect shows in a phase."""


@dataclass(frozen=True)
class Gap:
    """The gap of one phase of one test."""

    phase: str
    test: str
    delivered: float
    refitted: float
    after: float
    floor: float
    shares: Mapping[str, float] = field(default_factory=dict)  # of the effects by name, negative where one adds error

    @property
    def closure(self) -> float:
        """Share of the gap beyond its floor that the effects have closed; nan where that is not applicable."""
        open_ = self.refitted - self.floor
        return (self.refitted - self.after) / open_ if open_ > SHOWN else float("nan")


@dataclass(frozen=True)
class GapTraces:
    """The column of a phase of a test in which the refitted model errs most: n samples, in SI."""

    phase: str
    test: str
    quantity: str
    column: str
    time: Array  # (n,) [s]
    measured: Array  # (n,)
    models: Array  # (n, 3) as delivered, refitted, with the effects
    noise: float  # standard deviation of the last one's error by sensor noise


class Proof(NamedTuple):
    """Validation on held-out tests."""

    gaps: tuple[Gap, ...]
    traces: tuple[GapTraces, ...] = ()  # of the phases, by falling error of the refitted model over noise


def prove(
    machine: Machine,
    found: Search,
    records: Sequence[xr.Dataset],
    sensors: SensorSet,
    *,
    phases: Sequence[int],
    jobs: int,
    progress: Progress,
) -> Proof:
    """Validate the three models on held-out records; `machine` is the one delivered."""
    models = [(as_simulated(found.problem, machine), list(records))]
    names = [one.candidate.name for one in found.added]
    less = [without_effect(found, one.candidate).solution for one in found.added] if len(names) > 1 else []
    for problem, x in ((s.normal.problem, s.x) for s in (found.refit, found.solution, *less)):
        models.append(model_at(problem, x, records))

    def validated(one: tuple[Machine, Sequence[xr.Dataset]]) -> Validation:
        return validate(one[0], Campaign("held out", tuple(one[1])), sensors=sensors, phases=phases, jobs=jobs)

    done = []
    for i, one in enumerate(by_processes(validated, models, jobs)):
        done.append(one)
        progress((i + 1) / (len(models) + 1))
    without, done = done[3:] or done[1:2], done[:3]
    floors = expected_gaps(found, records, done[-1], sensors, phases, jobs)
    progress(1.0)
    gaps, traces = [], []
    for test in done[0].tests:
        for number in phases:
            each = [v.phase(test, number) for v in done]
            delivered, refitted, after = sizes = [normalised_error(phase, each[-1]) for phase in each]
            if np.all(np.isfinite(sizes)):
                errors = (normalised_error(v.phase(test, number), each[-1]) for v in without)
                shares = {n: 1.0 - (after / error) ** 2 for n, error in zip(names, errors, strict=False) if error > 0.0}
                floor = floors.get((test, number), NOISE)
                gaps.append(Gap(PHASES[number], test, delivered, refitted, after, floor, shares))
                drawn = _traces(PHASES[number], test, [p for p in each if p is not None], done[-1].numbers)
                traces.append((refitted, drawn))
    traces.sort(key=lambda pair: -pair[0])
    return Proof(tuple(gaps), tuple(one for _, one in traces if one is not None))


def _traces(name: str, test: str, three: Sequence[Phase], numbers: Numbers) -> GapTraces | None:
    """The three models in the column where the refitted one errs most, in noise of the last; None without any.

    Of the samples that are compared: the ends of the filters are not exact.
    """
    noise = {(a.quantity, a.column): a.noise for a in three[-1].agreement if a.moves and a.noise > 0.0}
    compared = [a for a in three[1].agreement if a.quantity in COMPARED[three[1].number] and np.isfinite(a.error)]
    compared = [a for a in compared if (a.quantity, a.column) in noise]
    if not compared:
        return None
    worst = max(compared, key=lambda a: a.error / noise[a.quantity, a.column])
    pairs = [phase.pair(worst.quantity) for phase in three]
    found = [pair for pair in pairs if pair is not None and worst.column in pair.columns]
    if len(found) < len(three):
        return None
    each = [(p.measured, p.model, p.columns.index(worst.column)) for p in found]
    models = np.stack([model[:, k] for _, model, k in each], axis=1)
    measured, _, k = each[-1]
    named, time = (worst.quantity, worst.column), three[-1].time
    part = numbers.inside(len(time), float(time[1] - time[0]))
    return GapTraces(name, test, *named, time[part], measured[part, k], models[part], noise[named])
