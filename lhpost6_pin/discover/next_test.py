"""The next test: which of a menu would tell two names apart that a campaign cannot, simulated to show that it does.

The machine with the one effect runs every test of `models/procedures/next_test.toml` in closed loop. What the machine
with the other effect cannot explain of it, everything known and the effect itself refitted, is the log-likelihood by
which that test would tell the two apart: its expected margin, to first order.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..calibration.knobs import Knob, machine_knobs
from ..calibration.normal import Normal
from ..calibration.prepare import prepare_problem
from ..campaign import simulate_campaign
from ..control import ControllerSettings
from ..errors import SimulationError
from ..files import models_folder
from ..machine import Machine
from ..parameters import Parameters, load_parameters
from ..residuals import RESIDUALS
from ..sensors import Sensors
from .candidates import Candidate
from .search import Contest, Search

__all__ = ["NextTest", "next_tests"]

MENU = "next_test"
"""Procedure that the tests are from."""


@dataclass(frozen=True)
class NextTest:
    """A test of the menu and how well it tells two families apart."""

    test: str
    families: tuple[str, str]
    margin: float  # expected log-likelihood by which the wrong one stands behind; nan where the test cannot be run


def next_tests(
    found: Search, settings: ControllerSettings, sensors: Sensors, calibration: Parameters, numbers: Parameters
) -> tuple[NextTest, ...]:
    """For every added effect and each of its rivals, the menu's tests by falling margin."""
    tests = dict.fromkeys(path.split(".")[0] for path in load_parameters(menu_file()).words if path.endswith(".motion"))
    told: list[NextTest] = []
    for added in found.added:
        first, *others = added.contest
        for rival in others:
            if rival.behind < added.apart and rival.candidate.family.named != first.candidate.family.named:
                trials = [_trial(test, first, rival, settings, sensors, calibration, numbers) for test in tests]
                told += sorted(trials, key=lambda one: -np.nan_to_num(one.margin))
    return tuple(told)


def menu_file() -> Path:
    """Procedure that the tests are from."""
    return models_folder() / "procedures" / f"{MENU}.toml"


def _trial(
    test: str,
    one: Contest,
    rival: Contest,
    settings: ControllerSettings,
    sensors: Sensors,
    calibration: Parameters,
    numbers: Parameters,
) -> NextTest:
    """Run a test on the machine with the one effect, and explain it by that with the other."""
    names = one.candidate.family.named, rival.candidate.family.named
    quiet = replace(sensors, noise={})
    try:
        run = simulate_campaign(one.machine, settings, quiet, seed=0, errors=False, tests=(test,), procedure=MENU)
    except SimulationError:
        return NextTest(test, names, float("nan"))
    ready = prepare_problem(rival.machine, run.records, sensors, calibration, kinds=RESIDUALS)
    knobs = (*machine_knobs(ready.problem.machine), *_own_knobs(rival, numbers))
    problem = ready.problem.with_machine(ready.problem.machine, knobs)
    return NextTest(test, names, _margin(Normal(problem, np.zeros(len(problem.prior)), lambda share: None)))


def _own_knobs(rival: Contest, numbers: Parameters) -> tuple[Knob, ...]:
    """Knobs of the rival's effect where it was fitted; none of a parameter that was set free."""
    candidate = rival.candidate
    if candidate.release:
        return ()
    amplitudes = tuple(_value(rival.machine, candidate, s.name) for s in candidate.amplitudes)
    shape = tuple((name, _value(rival.machine, candidate, name)) for name, _ in candidate.shape)
    fitted = replace(candidate, shape=shape)
    return fitted.knobs(amplitudes, numbers.number("fit.spread"), numbers.number("fit.factor"))


def _value(machine: Machine, candidate: Candidate, number: str) -> float:
    value = machine.parameters.effects[candidate.name].values[number].value
    assert isinstance(value, float)
    return value


def _margin(normal: Normal) -> float:
    """Least negative log-likelihood and log-prior, to first order; noise of unit power, none in the test."""
    prior = normal.problem.prior
    slope = np.concatenate([j.reshape(-1, len(prior)) for j in normal.slope]) * prior
    rest = np.concatenate([r.ravel() for r in normal.rest])
    matrix = 2.0 * (slope.conj().T @ slope).real + np.eye(len(prior))
    side = 2.0 * (slope.conj().T @ rest).real
    return float(np.sum(np.abs(rest) ** 2) - 0.5 * side @ np.linalg.solve(matrix, side))
