"""Validation on held-out tests: the normalised RMS error of the model before and after.

Three models: as delivered; refitted, with parameters and sensor errors but no effect; after, with the effects. The gap
of a phase of a test is the RMS, over all columns that move, of the model's error in standard deviations of the sensor
noise, so that noise alone gives one. The noise that reaches a balance depends on the model's numbers; all three errors
are over that of the model with the effects.

The floor is the gap that is expected of a model that lacks nothing: of sensor noise, and of all else that the search
counts as noise. Noise has the power that the search found in most columns of the residuals; stated too small, it is in
all of them, an effect that is missing in few. All else is evaluated on two machines, whose parameters and sensor errors
are drawn from their posterior distribution: one with friction of another form, one with warmer oil.
closure = (refitted - after) / (refitted - floor).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import ParameterError
from ..core.progress import Progress
from ..data.campaign import Campaign
from ..data.sensors import SensorSet
from ..identification.calibration.free_parameters import with_parameters
from ..identification.calibration.normal_equations import bounds_of
from ..identification.calibration.prepare import as_simulated
from ..identification.calibration.problem import Problem
from ..identification.calibration.sensor_errors import corrected_record
from ..identification.validation import PHASES, Phase, validate
from ..machine.machine import Machine
from .candidates import with_other_form, with_warm_oil
from .search_state import Search

__all__ = ["NOISE", "Gap", "Proof", "normalised_error", "prove"]

NOISE = 1.0
"""Gap due to sensor noise alone."""

SHOWN = 0.1
"""Gap beyond the floor from which an effect shows in a phase."""

_COMPARED = {
    1: ("wrench", "struts"),
    2: ("velocity", "acceleration", "wrench", "chamber_pressure_a"),
    3: ("acceleration",),
}


@dataclass(frozen=True)
class Gap:
    """The gap of one phase of one test."""

    phase: str
    test: str
    delivered: float
    refitted: float
    after: float
    floor: float

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
    for problem, x in ((s.normal.problem, s.x) for s in (found.refit, found.solution)):
        models.append(_model(problem, x, records))
    models += _equally_plausible(found, records)
    done = []
    for i, (model, some) in enumerate(models):
        done.append(validate(model, Campaign("held out", tuple(some)), sensors=sensors, phases=phases, jobs=jobs))
        progress((i + 1) / len(models))
    columns = found.problem.compared
    powers = np.mean([np.mean(np.abs(r[:, columns]) ** 2, axis=0) for r in found.residual], axis=0)
    noise, gaps, traces = max(NOISE, float(np.median(powers))), [], []
    for test in done[0].tests:
        for number in phases:
            three, others = [v.phase(test, number) for v in done[:3]], [v.phase(test, number) for v in done[3:]]
            delivered, refitted, after = sizes = [normalised_error(phase, three[-1]) for phase in three]
            if np.all(np.isfinite(sizes)):
                floor = _floor(three[-1], others, noise)
                gaps.append(Gap(PHASES[number], test, delivered, refitted, after, floor))
                traces.append((refitted, _traces(PHASES[number], test, [p for p in three if p is not None])))
    traces.sort(key=lambda pair: -pair[0])
    return Proof(tuple(gaps), tuple(one for _, one in traces if one is not None))


def _model(problem: Problem, x: Array, records: Sequence[xr.Dataset]) -> tuple[Machine, list[xr.Dataset]]:
    """The machine with the unknowns at x (p,), and the records corrected by them."""
    machine = with_parameters(problem.machine, problem.parameters, x[: len(problem.parameters)])
    errors = x[len(problem.parameters) :]
    return as_simulated(problem, machine), [corrected_record(r, problem.unknowns, errors) for r in records]


def _equally_plausible(found: Search, records: Sequence[xr.Dataset]) -> list[tuple[Machine, list[xr.Dataset]]]:
    """Two machines as plausible as the one with the effects, and the records corrected accordingly.

    Each is drawn with half the posterior variance, so that both together have all of it.
    """
    solution, number = found.solution, found.numbers.number
    problem = solution.normal.problem
    root = np.linalg.cholesky(solution.normal.posterior(problem.prior))
    bounds, rng = bounds_of(problem, found.calibration), np.random.default_rng(0)
    models = []
    for changed in (
        lambda machine: with_other_form(machine, number("scatter.form")),
        lambda machine: with_warm_oil(machine, number("scatter.drift")),
    ):
        drawn = np.linalg.solve(root.T, rng.standard_normal(len(solution.x)) / np.sqrt(2.0))
        try:
            machine, corrected = _model(problem, np.clip(solution.x + drawn, *bounds), records)
        except ParameterError:  # its numbers make no machine
            machine, corrected = _model(problem, solution.x, records)
        models.append((changed(machine), corrected))
    return models


def _floor(phase: Phase | None, others: Sequence[Phase | None], noise: float) -> float:
    """Gap expected of a phase: of noise of that power, and of the differences to equally plausible machines."""
    floor = noise
    assert phase is not None
    for other in others:
        squares = []
        for a in phase.agreement:
            one, two = phase.pair(a.quantity), other and other.pair(a.quantity)
            if a.quantity in _COMPARED[phase.number] and a.moves and a.noise > 0.0 and one and two:
                k = one.columns.index(a.column)
                change = (two.model - two.measured - one.model + one.measured)[:, k]
                squares.append(np.var(change) / a.noise**2)
        floor += float(np.mean(squares)) if squares else 0.0
    return float(np.sqrt(floor))


def _traces(name: str, test: str, three: Sequence[Phase]) -> GapTraces | None:
    """The three models in the column where the refitted one errs most, in noise of the last; None without any."""
    noise = {(a.quantity, a.column): a.noise for a in three[-1].agreement if a.moves and a.noise > 0.0}
    compared = [a for a in three[1].agreement if a.quantity in _COMPARED[three[1].number] and np.isfinite(a.error)]
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
    named = worst.quantity, worst.column
    return GapTraces(name, test, *named, three[-1].time, measured[:, k], models, noise[named])


def normalised_error(phase: Phase | None, noisy: Phase | None) -> float:
    """RMS of the errors of a phase over the noise of the same phase by one model; nan where not compared."""
    if phase is None or noisy is None or phase.reason or noisy.reason:
        return float("nan")
    noise = {(a.quantity, a.column): a.noise for a in noisy.agreement if a.moves and a.noise > 0.0}
    compared = [a for a in phase.agreement if a.quantity in _COMPARED[phase.number] and (a.quantity, a.column) in noise]
    found = [a.error_aligned / noise[a.quantity, a.column] for a in compared if np.isfinite(a.error_aligned)]
    return float(np.sqrt(np.mean(np.square(found)))) if found else float("nan")
