"""The whole search for missing effects: from a campaign of records to a verdict and its proof."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from ..control import load_controller
from ..core.errors import RecordError, UnknownNameError
from ..core.files import models_folder
from ..core.progress import Progress, between
from ..data.campaign import Campaign
from ..data.sensors import SensorSet
from ..identification.calibration import calibration_numbers
from ..identification.calibration.free_parameters import plan_parameters, scatter_parameters
from ..identification.calibration.normal_equations import NormalEquations
from ..identification.calibration.prepare import PreparedProblem, prepare_problem
from ..identification.residuals import RESIDUALS
from ..machine.machine import Machine
from ..machine.parameters import Parameters, load_parameters
from ..mechanics.plant import make_plant
from .candidates import with_background, with_other_form, with_warm_oil
from .checkpoint import SearchCheckpoint, make_checkpoint
from .held_out import Proof, prove
from .lost_motion import lost_motion, with_lost_motion
from .next_test import NextTest, next_tests
from .residual_function import ResidualFunction, fit_residual_functions, with_residual_function
from .screening import linearise, weighing
from .search import refit, search
from .search_state import Search, fitted_machine
from .sensor_findings import correct_records, find_sensor_faults
from .verdict import Verdict, judge

__all__ = ["Discovery", "discover", "discovery_numbers"]

FEWEST = 3  # tests that are searched; with more, one is held out


@dataclass(frozen=True)
class Discovery:
    """What a search for missing effects has found."""

    campaign: str
    machine: Machine  # as delivered
    fitted: Machine  # with the effects found and all numbers fitted; what has no name is in it, switched off
    used: tuple[str, ...]  # tests that were searched
    held_out: tuple[str, ...]  # tests that were not
    verdict: Verdict
    search: Search
    residual_functions: tuple[ResidualFunction, ...]
    proof: Proof | None  # None where no test was held out
    next_tests: tuple[NextTest, ...]  # where names cannot be told apart: tests that may, simulated
    numbers: Parameters
    seed: int
    hashes: dict[str, str]  # of the records that were read, by test


def discover(
    machine: Machine,
    campaign: Campaign,
    sensors: SensorSet,
    *,
    hold_out: Sequence[str] | None = None,
    phases: Sequence[int] = (1, 2, 3),
    seed: int = 0,
    jobs: int = -1,
    propose: bool = True,
    unfinished: Path | None = None,
    progress: Progress | None = None,
) -> Discovery:
    """Find what a machine's model lacks to explain a campaign.

    hold_out are tests that are not searched but prove what was found; None: with more than three tests, the one that
    tells least of the machine. phases are those of a validation that the proof goes through. Deterministic for a seed
    (of the simulated noise), whatever the number of `jobs` (threads; -1: one a core). `propose` simulates tests that
    would tell rivals apart where the verdict is ambiguous. In the folder `unfinished` the search keeps what it has
    until it has ended; a search with the same inputs goes on from there, to the same verdict.

    Raises UnknownNameError for a test that the campaign has not; RecordError where fewer than one test is left to
    search; and what `calibrate` raises.
    """
    report = progress or (lambda share: None)
    numbers, calibration = discovery_numbers()
    names = [str(r.attrs.get("test", i)) for i, r in enumerate(campaign.records)]
    plant = make_plant(machine)
    lost = lost_motion(plant, campaign.records, sensors, numbers)
    faults = find_sensor_faults(plant, campaign.records, sensors, [one.component for one in lost])
    records = correct_records(campaign.records, faults)
    hashes = {name: _hash(record) for name, record in zip(names, campaign.records, strict=True)}
    held = _asked_for(names, hold_out)
    checkpoint = make_checkpoint(unfinished, machine, sensors, hashes, hold_out, seed)
    place = checkpoint.read()
    if place is None:
        ready = _prepared(machine, records, sensors, numbers, calibration, seed, jobs)
        report(0.1)
        place = _begin(ready, held, numbers, calibration, more=hold_out is None, progress=between(report, 0.1, 0.38))
        begun = with_lost_motion(place.search, lost, calibration, numbers, between(report, 0.38, 0.4))
        place = place._replace(search=begun)
        checkpoint.write(place)
    machine, held = place.machine, place.held
    used = [i for i in range(len(names)) if i not in held]

    def keep(found: Search) -> None:
        checkpoint.write(place._replace(search=found))

    found, linear = search(place.search, calibration, numbers, keep, between(report, 0.4, 0.75))
    left: tuple[ResidualFunction, ...] = ()
    if found.misfit("wrench") > numbers.number("left.noise"):
        left = fit_residual_functions(linear.base, weighing(found, linear, numbers), numbers)
    instead: tuple[ResidualFunction, ...] = ()
    forces = any("wrench" in one.candidate.family.shows_in and not one.candidate.release for one in found.added)
    if forces and found.misfit("wrench") > numbers.number("accept.settled"):  # else no function could do better by far
        before = linearise(found.refit, calibration)
        instead = fit_residual_functions(before.base, weighing(found, before, numbers), numbers)
    report(0.8)
    proof = None
    if held:
        part = between(report, 0.8, 0.95)
        proof = prove(machine, found, [records[i] for i in held], sensors, phases=phases, jobs=jobs, progress=part)
    verdict = judge(found, left, instead, faults, calibration, numbers)
    tests: tuple[NextTest, ...] = ()
    if propose and verdict.word == "ambiguous":
        tests = next_tests(found, load_controller("lhpost6"), sensors, calibration, numbers)
    checkpoint.remove()
    report(1.0)
    alone = any(verdict.residual_function is one for one in instead)  # in place of the effects, not beside them
    fitted = fitted_machine(found.refit if alone else found.solution)
    return Discovery(
        campaign=campaign.name,
        machine=machine,
        fitted=fitted
        if verdict.residual_function is None
        else with_residual_function(fitted, verdict.residual_function),
        used=tuple(names[i] for i in used),
        held_out=tuple(names[i] for i in held),
        verdict=verdict,
        search=found,
        residual_functions=left,
        proof=proof,
        next_tests=tests,
        numbers=numbers,
        seed=seed,
        hashes=hashes,
    )


def _prepared(
    machine: Machine,
    records: Sequence[xr.Dataset],
    sensors: SensorSet,
    numbers: Parameters,
    calibration: Parameters,
    seed: int,
    jobs: int,
) -> PreparedProblem:
    """All tests made ready, friction of another form and warmer oil counted as noise."""
    others, preload = partial(_others, numbers=numbers), numbers.number("scatter.preload")
    return prepare_problem(
        machine, records, sensors, calibration, kinds=RESIDUALS, others=others, preload=preload, seed=seed, jobs=jobs
    )


def _begin(
    ready: PreparedProblem,
    held: tuple[int, ...],
    numbers: Parameters,
    calibration: Parameters,
    *,
    more: bool,
    progress: Progress,
) -> SearchCheckpoint:
    """Refit what is known to the tests that are not held out; `more`: hold out the one that tells least, too."""
    machine = ready.problem.machine
    parameters = (*ready.problem.parameters, *plan_parameters(machine))
    twins = scatter_parameters(machine, numbers.number("scatter.share"), numbers.number("scatter.reach"))
    whole, forms = with_background(machine, numbers.number("scatter.spread"))
    ready = ready.with_machine(whole, (*parameters, *twins, *forms))
    used = [i for i in range(len(ready.problem.tests)) if i not in held]
    ready = ready.only(used)
    first = NormalEquations(ready.problem, np.zeros(len(ready.problem.prior)), between(progress, 0.0, 0.3))
    if more and len(used) > FEWEST:
        least = _tells_least(first)
        held = (used.pop(least),)
        ready, first = ready.only(used), first.only(used)
    return SearchCheckpoint(machine, held, refit(ready, first, calibration, between(progress, 0.3, 1.0)))


def discovery_numbers() -> tuple[Parameters, Parameters]:
    """Those of a search, and those of a calibration with what a search has otherwise: `models/procedures`."""
    numbers, common = load_parameters(models_folder() / "procedures" / "discovery.toml"), calibration_numbers()
    own = {path: quantity for path, quantity in numbers.items() if path.startswith("fit.")}
    return numbers, replace(common, quantities={**common.quantities, **own})


def _others(machine: Machine, numbers: Parameters) -> tuple[Machine, ...]:
    """What the machine may as well be: with friction of another form, or with warmer oil in one test than in others."""
    form, drift = numbers.number("scatter.form"), numbers.number("scatter.drift")
    return with_other_form(machine, form), with_warm_oil(machine, drift)


def _asked_for(names: Sequence[str], wanted: Sequence[str] | None) -> tuple[int, ...]:
    """Places of the tests that are to be held out."""
    for name in wanted or ():
        if name not in names:
            raise UnknownNameError("test of the campaign", name, list(names))
    held = tuple(i for i, name in enumerate(names) if name in (wanted or ()))
    if len(held) == len(names):
        raise RecordError("all tests are held out: leave at least one to search")
    return held


def _tells_least(first: NormalEquations) -> int:
    """The test without which the others tell most of the machine's parameters; what was measured in it has no say."""
    count = len(first.problem.parameters)
    prior = first.problem.prior[:count]
    own = [first.of([t])[0][:count, :count] * np.outer(prior, prior) for t in range(len(first.residual))]
    without = [sum(own) - one + np.eye(count) for one in own]
    return int(np.argmax([np.linalg.slogdet(m)[1] for m in without]))


def _hash(record: xr.Dataset) -> str:
    """SHA-256 of a record's numbers."""
    digest = hashlib.sha256()
    for name in sorted(map(str, record.variables)):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(record[name].values).tobytes())
    return digest.hexdigest()
