"""Floor of the gaps on held-out tests: what is expected of a model that lacks nothing.

Every held-out test is simulated by a machine as plausible as the one with the effects, driven by the recorded spools
from what friction held at the start by estimate, and recorded through the sensors; its gap to the machine with the
effects is the floor. The plausible machine has all that the search counts as noise: numbers drawn from their posterior
distribution, those of the form of friction among them, and warmer oil. The noise simulated has the power that the
search found in most columns of the residuals: noise stated too small is in all of them, an effect that is missing in
few. Where a test cannot be simulated from its spools, as in the closed loop, the floor is that noise and the difference
between the models of both machines.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import ParameterError, RecordError, SimulationError
from ..core.names import SAMPLE_RATE
from ..data.campaign import Campaign
from ..data.quiet_spools import quiet_spools
from ..data.sensors import SensorSet
from ..identification.calibration.free_parameters import with_parameters
from ..identification.calibration.normal_equations import bounds_of
from ..identification.calibration.prepare import as_simulated
from ..identification.calibration.problem import Problem
from ..identification.calibration.sensor_errors import corrected_record
from ..identification.validation import Phase, Validation, validate
from ..machine.machine import Machine
from ..mechanics.plant import make_plant
from ..simulation.rehearse import replay
from ..simulation.simulate import fastest_engine
from ..simulation.simulated_campaign import SensorErrors, as_sensed
from .candidates import with_warm_oil
from .search_state import Search

__all__ = ["COMPARED", "NOISE", "expected_gaps", "model_at", "normalised_error"]

COMPARED = {
    1: ("wrench", "struts"),
    2: ("velocity", "acceleration", "wrench", "chamber_pressure_a"),
    3: ("acceleration",),
}
"""Quantities of each phase that make its gap."""

NOISE = 1.0
"""Gap due to sensor noise alone."""

REPLAYED = (1, 2)
"""Phases of a test that is simulated from its spools."""


def expected_gaps(
    found: Search,
    records: Sequence[xr.Dataset],
    after: Validation,
    sensors: SensorSet,
    phases: Sequence[int],
    jobs: int,
) -> dict[tuple[str, int], float]:
    """Floors by test and phase; `after` is the validation of the machine with the effects on these records."""
    problem, x = found.solution.normal.problem, found.solution.x
    drawn = _drawn(found)
    machine, corrected = model_at(problem, drawn, records)
    machine = with_warm_oil(machine, found.numbers.number("scatter.drift"))
    columns = found.problem.compared
    powers = np.mean([np.mean(np.abs(r[:, columns]) ** 2, axis=0) for r in found.residual], axis=0)
    noise = max(NOISE, float(np.median(powers)))
    noisier = replace(sensors, noise={name: np.sqrt(noise) * sd for name, sd in sensors.noise.items()})
    every = [(test, n, after.phase(test, n)) for test in after.tests for n in phases]
    compared = {(test, n): p for test, n, p in every if p is not None and np.isfinite(normalised_error(p, p))}
    rng, floors = np.random.default_rng(0), dict[tuple[str, int], float]()
    for record, clean in zip(records, corrected, strict=True):
        test = str(record.attrs.get("test", "test"))
        own = [n for n in REPLAYED if (test, n) in compared]
        if not own:
            continue
        try:
            began = [start for n in own if (start := compared[test, n].start) is not None]
            simulated = _simulated(machine, clean, noisier, rng, began[0] if began else None)
            seen = corrected_record(simulated, problem.unknowns, (x - drawn)[len(problem.parameters) :])
            again = validate(after.machine, Campaign(test, (seen,)), sensors=sensors, phases=own, jobs=jobs)
        except (RecordError, SimulationError):  # spools were not measured, or the run stops early
            continue
        floors |= {(test, n): normalised_error(again.phase(test, n), compared[test, n]) for n in own}
    left = sorted({n for test, n in compared if not np.isfinite(floors.get((test, n), np.nan))})
    others: dict[tuple[str, int], Phase | None] = {}
    if left:
        try:
            other = validate(machine, Campaign("plausible", tuple(corrected)), sensors=sensors, phases=left, jobs=jobs)
            others = {(test, n): other.phase(test, n) for test, n in compared}
        except RecordError:  # it runs in no phase: what is left is noise
            pass
    for key, phase in compared.items():
        if not np.isfinite(floors.get(key, np.nan)):
            floors[key] = float(np.sqrt(noise + _difference(phase, others.get(key))))
    return floors


def model_at(problem: Problem, x: Array, records: Sequence[xr.Dataset]) -> tuple[Machine, list[xr.Dataset]]:
    """The machine with the unknowns at x (p,), and the records corrected by them."""
    machine = with_parameters(problem.machine, problem.parameters, x[: len(problem.parameters)])
    errors = x[len(problem.parameters) :]
    return as_simulated(problem, machine), [corrected_record(r, problem.unknowns, errors) for r in records]


def normalised_error(phase: Phase | None, noisy: Phase | None) -> float:
    """RMS of the errors of a phase over the noise of the same phase by one model; nan where not compared."""
    if phase is None or noisy is None or phase.reason or noisy.reason:
        return float("nan")
    noise = {(a.quantity, a.column): a.noise for a in noisy.agreement if a.moves and a.noise > 0.0}
    compared = [a for a in phase.agreement if a.quantity in COMPARED[phase.number] and (a.quantity, a.column) in noise]
    found = [a.error_aligned / noise[a.quantity, a.column] for a in compared if np.isfinite(a.error_aligned)]
    return float(np.sqrt(np.mean(np.square(found)))) if found else float("nan")


def _drawn(found: Search) -> Array:
    """The unknowns (p,), drawn from their posterior distribution; those found where what is drawn makes no machine."""
    solution, problem = found.solution, found.solution.normal.problem
    root = np.linalg.cholesky(solution.normal.posterior(problem.prior))
    normal = np.random.default_rng(0).standard_normal(len(solution.x))
    drawn = np.clip(solution.x + np.linalg.solve(root.T, normal), *bounds_of(problem, found.calibration))
    try:
        problem.plant_at(drawn)
    except ParameterError:
        return solution.x
    return np.asarray(drawn)


def _simulated(
    machine: Machine, record: xr.Dataset, sensors: SensorSet, rng: np.random.Generator, start: Array | None
) -> xr.Dataset:
    """A test as a machine would have it with the same spools, with the channels that were measured.

    start (n_states,) is what friction holds at its start; None: nothing.
    """
    own = {"test": record.attrs.get("test", "test")}
    quiet, engine = quiet_spools(record, sensors), fastest_engine(make_plant(machine))
    run = replay(machine, quiet, attrs=own, friction=start, engine=engine).record
    rate = (record.sizes["time"] - 1) / float(record["time"][-1] - record["time"][0])
    every = max(1, round(SAMPLE_RATE / rate))
    sensed = as_sensed(run, sensors, SensorErrors({}, {}, {}), SAMPLE_RATE / every, rng)
    return sensed[[name for name in sensed.data_vars if name in record]]


def _difference(phase: Phase, other: Phase | None) -> float:
    """Mean square over noise of what the errors of a phase by two models differ by."""
    squares = []
    for a in phase.agreement:
        one, two = phase.pair(a.quantity), other and other.pair(a.quantity)
        if a.quantity in COMPARED[phase.number] and a.moves and a.noise > 0.0 and one and two:
            k = one.columns.index(a.column)
            squares.append(np.var((two.model - two.measured - one.model + one.measured)[:, k]) / a.noise**2)
    return float(np.mean(squares)) if squares else 0.0
