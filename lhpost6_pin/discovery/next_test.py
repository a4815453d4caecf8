"""The next test: which of a menu would discriminate between two families that explain a campaign equally well.

Every test of `models/procedures/next_test.toml` is simulated in closed loop on the machine with the one effect. Its
expected margin is the log-likelihood by which the machine with the other effect fails to explain it, all parameters and
that effect refitted, to first order.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import xarray as xr

from ..control import ControllerSettings
from ..core.errors import SimulationError
from ..core.processes import by_processes
from ..data.sensors import SensorSet
from ..identification.calibration.free_parameters import FreeParameter
from ..identification.calibration.normal_equations import NormalEquations
from ..identification.calibration.prepare import as_simulated, prepare_problem
from ..identification.residuals import RESIDUALS
from ..machine.parameters import Parameters
from ..simulation.simulated_campaign import load_procedure, simulate_campaign, tests_of
from .search_state import FittedCandidate, Search

__all__ = ["NextTest", "next_tests"]

MENU = "next_test"
"""Procedure that the tests are from."""


@dataclass(frozen=True)
class NextTest:
    """A test of the menu and how well it discriminates between two families."""

    test: str
    families: tuple[str, str]
    margin: float  # expected log-likelihood ratio; nan where the test cannot be run
    informative: bool  # whether that is decisive


def next_tests(found: Search, settings: ControllerSettings, sensors: SensorSet) -> tuple[NextTest, ...]:
    """For every added effect and each of its rivals, the menu's tests by falling margin."""
    tests, ranked = tests_of(load_procedure(MENU)), list[NextTest]()
    measured = {*found.problem.tests[0].share, *found.problem.tests[0].channels}
    for added in found.added:
        for rival in added.rivals:
            one, other = (_simulated(found, each) for each in (added.contest[0], rival))
            given = settings, sensors, found.calibration, found.numbers, measured
            trial = partial(_trial, one, other, *given)
            trials = list(by_processes(trial, tests, found.problem.jobs))
            ranked += sorted(trials, key=lambda one: -np.nan_to_num(one.margin))
    return tuple(ranked)


def _simulated(found: Search, one: FittedCandidate) -> FittedCandidate:
    return replace(one, machine=as_simulated(found.problem, one.machine))


def _trial(
    one: FittedCandidate,
    rival: FittedCandidate,
    settings: ControllerSettings,
    sensors: SensorSet,
    calibration: Parameters,
    numbers: Parameters,
    measured: Collection[str],
    test: str,
) -> NextTest:
    """Simulate a test on the machine with the one effect, and fit it with the other, by the channels `measured`."""
    names = one.candidate.family.named, rival.candidate.family.named
    quiet = replace(sensors, noise={})
    try:
        run = simulate_campaign(one.machine, settings, quiet, seed=0, errors=False, tests=(test,), procedure=MENU)
    except SimulationError:
        return NextTest(test, names, float("nan"), informative=False)
    records = [_as_measured(record, measured) for record in run.records]
    problem = prepare_problem(rival.machine, records, sensors, calibration, kinds=RESIDUALS, jobs=1)
    problem = problem.with_machine(problem.machine, (*problem.parameters, *_own_parameters(rival, numbers)))
    margin = _margin(NormalEquations(problem, np.zeros(len(problem.prior)), lambda share: None))
    return NextTest(test, names, margin, informative=margin >= numbers.number("accept.apart"))


def _as_measured(record: xr.Dataset, measured: Collection[str]) -> xr.Dataset:
    """A simulated record with the channels of a measured one."""
    if "pressure_difference" in measured:
        a, b = record["chamber_pressure_a"], record["chamber_pressure_b"]
        difference = a.values[:, np.isin(a["actuator"], b["horizontal"])] - b.values
        record = record.assign(pressure_difference=b.copy(data=difference))
    if "valve_command" in measured:
        record = record.assign(valve_command=record["spool_command"])
    return record[[name for name in record.data_vars if name in measured]]


def _own_parameters(rival: FittedCandidate, numbers: Parameters) -> tuple[FreeParameter, ...]:
    """Parameters of the rival's effect where it was fitted; none of a released parameter."""
    candidate = rival.candidate
    if candidate.release:
        return ()
    parameters = rival.machine.parameters
    effect = replace(parameters, quantities=parameters.effects[candidate.name].values)
    amplitudes = tuple(effect.number(s.name) for s in candidate.amplitudes)
    shape = tuple((name, effect.number(name)) for name, _ in candidate.shape)
    return replace(candidate, shape=shape).fit_parameters(amplitudes, numbers)


def _margin(normal: NormalEquations) -> float:
    """Least negative log-likelihood and log-prior, to first order; noise of unit power, none in the test."""
    (matrix, side), rest = normal.whole, sum(float(np.sum(np.abs(r) ** 2)) for r in normal.residual)
    scale = normal.problem.prior
    scaled = matrix * np.outer(scale, scale) + np.eye(len(scale))
    return rest - 0.5 * float(side * scale @ np.linalg.solve(scaled, side * scale))
