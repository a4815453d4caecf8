"""The next test: which of a menu would tell two names apart that a campaign cannot, simulated to show that it does.

The machine with the one effect runs every test of `models/procedures/next_test.toml` in closed loop. What the machine
with the other effect cannot explain of it, everything known and the effect itself refitted, is the log-likelihood by
which that test would tell the two apart: its expected margin, to first order.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from joblib import Parallel, delayed

from ..control import ControllerSettings
from ..core.errors import SimulationError
from ..data.sensors import SensorSet
from ..identification.calibration.free_parameters import FreeParameter
from ..identification.calibration.normal_equations import NormalEquations
from ..identification.calibration.prepare import prepare_problem
from ..identification.residuals import RESIDUALS
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..simulation.simulated_campaign import load_procedure, simulate_campaign, tests_of
from .candidates import Candidate
from .search_state import FittedCandidate, Search

__all__ = ["NextTest", "next_tests"]

MENU = "next_test"
"""Procedure that the tests are from."""


@dataclass(frozen=True)
class NextTest:
    """A test of the menu and how well it tells two families apart."""

    test: str
    families: tuple[str, str]
    margin: float  # expected log-likelihood by which the wrong one stands behind; nan where the test cannot be run
    informative: bool  # whether that is enough


def next_tests(
    found: Search, settings: ControllerSettings, sensors: SensorSet, calibration: Parameters, numbers: Parameters
) -> tuple[NextTest, ...]:
    """For every added effect and each of its rivals, the menu's tests by falling margin."""
    tests = tests_of(load_procedure(MENU))
    told: list[NextTest] = []
    for added in found.added:
        for rival in added.rivals:
            trial = partial(_trial, added.contest[0], rival, settings, sensors, calibration, numbers)
            trials = Parallel(n_jobs=found.problem.jobs, prefer="threads")(delayed(trial)(test) for test in tests)
            told += sorted(trials, key=lambda one: -np.nan_to_num(one.margin))
    return tuple(told)


def _trial(
    one: FittedCandidate,
    rival: FittedCandidate,
    settings: ControllerSettings,
    sensors: SensorSet,
    calibration: Parameters,
    numbers: Parameters,
    test: str,
) -> NextTest:
    """Run a test on the machine with the one effect, and explain it by that with the other."""
    names = one.candidate.family.named, rival.candidate.family.named
    quiet = replace(sensors, noise={})
    try:
        run = simulate_campaign(one.machine, settings, quiet, seed=0, errors=False, tests=(test,), procedure=MENU)
    except SimulationError:
        return NextTest(test, names, float("nan"), informative=False)
    ready = prepare_problem(rival.machine, run.records, sensors, calibration, kinds=RESIDUALS, jobs=1)
    parameters = (*ready.problem.parameters, *_own_parameters(rival, numbers))
    problem = ready.problem.with_machine(ready.problem.machine, parameters)
    margin = _margin(NormalEquations(problem, np.zeros(len(problem.prior)), lambda share: None))
    return NextTest(test, names, margin, informative=margin >= numbers.number("accept.apart"))


def _own_parameters(rival: FittedCandidate, numbers: Parameters) -> tuple[FreeParameter, ...]:
    """Parameters of the rival's effect where it was fitted; none of a parameter that was set free."""
    candidate = rival.candidate
    if candidate.release:
        return ()
    amplitudes = tuple(_value(rival.machine, candidate, s.name) for s in candidate.amplitudes)
    shape = tuple((name, _value(rival.machine, candidate, name)) for name, _ in candidate.shape)
    fitted = replace(candidate, shape=shape)
    return fitted.parameters(amplitudes, numbers.number("fit.spread"), numbers.number("fit.factor"))


def _value(machine: Machine, candidate: Candidate, number: str) -> float:
    value = machine.parameters.effects[candidate.name].values[number].value
    assert isinstance(value, float)
    return value


def _margin(normal: NormalEquations) -> float:
    """Least negative log-likelihood and log-prior, to first order; noise of unit power, none in the test."""
    (matrix, side), rest = normal.whole, sum(float(np.sum(np.abs(r) ** 2)) for r in normal.residual)
    scale = normal.problem.prior
    scaled = matrix * np.outer(scale, scale) + np.eye(len(scale))
    return rest - 0.5 * float(side * scale @ np.linalg.solve(scaled, side * scale))
