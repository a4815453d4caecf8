"""Discovery: from a campaign of records to a verdict on missing effects and its validation on held-out tests."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from ..control import load_controller
from ..core.errors import RecordError, UnknownNameError
from ..core.files import models_folder
from ..core.progress import Progress, between
from ..core.shown import Shown
from ..data.campaign import Campaign, SkippedTest
from ..data.sensors import SensorSet
from ..identification.calibration import calibration_numbers, usable_tests
from ..identification.calibration.curves import Curves, measured_curves
from ..identification.calibration.free_parameters import plan_parameters, scatter_parameters
from ..identification.calibration.normal_equations import NormalEquations
from ..identification.calibration.prepare import prepare_problem
from ..identification.calibration.problem import Problem
from ..identification.residuals import RESIDUALS
from ..machine.machine import Machine
from ..machine.parameters import Parameters, Quantity, load_parameters
from ..mechanics.plant import make_plant
from .balances import Balance, evaluate_balances, residual_at
from .candidates import with_background, with_other_form, with_warm_oil
from .checkpoint import SearchCheckpoint, make_checkpoint
from .effect_loops import EffectLoop, effect_loops
from .estimates import at_bounds, deviations, estimates_of
from .fading import fading_effects
from .friction_form import with_friction_form
from .held_out import Proof, prove
from .lost_motion import LostMotion, lost_motion, with_lost_motion, with_rod_lengths
from .next_test import NextTest, next_tests
from .residual_function import ResidualFunction, fit_residual_functions, with_residual_function
from .residual_records import residual_records
from .search import refit, search, without_effect
from .search_state import Linearisation, Search, fitted_machine, linearise
from .searched_range import Beyond, beyond_search
from .sensor_findings import correct_records, find_sensor_faults
from .time_blocks import in_blocks
from .unexplained import forces_explained
from .verdict import Verdict, judge
from .withdrawal import withdraw_effects

__all__ = ["Discovery", "discover", "discovery_numbers"]

FEWEST = 3  # tests that are searched; with more, one is held out


@dataclass(frozen=True, repr=False)
class Discovery(Shown):
    """Result of a search for missing effects."""

    campaign: str
    machine: Machine  # as delivered
    fitted: Machine  # with the effects found and all numbers fitted; a residual function is in it, switched off
    used: tuple[str, ...]  # tests that were searched
    held_out: tuple[str, ...]  # tests that were not
    skipped: tuple[SkippedTest, ...]  # tests that could not be used
    verdict: Verdict
    search: Search
    proof: Proof | None  # None where no test was held out
    balances: tuple[Balance, ...]  # of the held-out tests
    beyond: tuple[Beyond, ...]  # legs that these move farther than the tests searched
    next_tests: tuple[NextTest, ...]  # simulated: tests that would discriminate between rivals
    numbers: Parameters
    seed: int
    hashes: dict[str, str]  # of the records that were read, by test
    residual_forces: dict[str, xr.Dataset]  # of a held-out test as records, by model
    loops: tuple[EffectLoop, ...]  # of the effects found, on the held-out tests, else on those searched
    curves: Curves  # of the held-out tests, else of those searched: as delivered, and by the fitted machine


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
    """Identify the effects that a machine's model lacks to explain a campaign.

    hold_out are tests for validation, not searched; None: with more than three tests, the least informative one. phases
    are those of that validation. Deterministic for a seed (of the simulated noise), independent of the number of `jobs`
    (cores; -1: all). `propose` simulates tests that would discriminate between rivals where the verdict is ambiguous.
    The folder `unfinished` holds a checkpoint until the search ends; an interrupted search with the same inputs resumes
    from it and reaches the same verdict.

    Tests that cannot be compared are skipped (`usable_tests`). Raises UnknownNameError for a test that is not in the
    campaign; RecordError where no test is left to search; and what `calibrate` raises.
    """
    report, (numbers, calibration) = progress or (lambda share: None), discovery_numbers()
    campaign = usable_tests(campaign)
    names = [str(r.attrs.get("test", i)) for i, r in enumerate(campaign.records)]
    plant = make_plant(machine)
    lost = lost_motion(plant, campaign.records, sensors, numbers)
    faults = find_sensor_faults(plant, campaign.records, sensors, [one.component for one in lost])
    records = correct_records(campaign.records, faults)
    if lost and faults:  # lengths are compared with the pose that the search has
        lost = lost_motion(plant, records, sensors, numbers)
    records = with_rod_lengths(records, lost, machine)
    hashes = {name: _hash(record) for name, record in zip(names, campaign.records, strict=True)}
    held = _held_out(names, hold_out, campaign.skipped)
    records, held = in_blocks(records, held, numbers, calibration)
    checkpoint = make_checkpoint(unfinished, machine, sensors, hashes, hold_out, seed)
    begun = checkpoint.read()
    if begun is None:
        whole = hold_out is None and len(records) == len(names)
        problem = _prepared(machine, records, sensors, numbers, calibration, seed=seed, jobs=jobs)
        report(0.1)
        part = between(report, 0.1, 0.4)
        begun = _begin(problem, held, lost, numbers, calibration, hold_one_out=whole, progress=part)
        checkpoint.write(begun)
    machine, held, held_problem = begun.machine, begun.held, begun.held_problem
    found, linear = search(
        begun.search, lambda one: checkpoint.write(begun._replace(search=one)), between(report, 0.4, 0.75)
    )
    kept, withdrawn = withdraw_effects(found, held_problem)
    if kept is not found:
        found, linear = kept, linearise(kept.solution, calibration)
    beside, replacing = _residual_functions(found, linear)
    report(0.8)
    verdict = judge(found, beside, replacing, faults, withdrawn, fading_effects(found, linear))
    ambiguous = propose and verdict.word == "ambiguous"
    tests = next_tests(found, load_controller(machine.controller), sensors) if ambiguous else ()
    for one in found.added:  # what is validated is the model that is delivered
        if one.candidate.name in {gone.name for gone in withdrawn}:
            found = without_effect(found, one.candidate)
    out, part = [records[i] for i in held], between(report, 0.85, 1.0)
    proven = tuple(str(record.attrs.get("test", i)) for i, record in zip(held, out, strict=True))
    proof = prove(machine, found, out, sensors, phases=phases, jobs=jobs, progress=part) if held else None
    balances, forces = _balances_and_forces(found, held_problem)
    checkpoint.remove()
    report(1.0)
    tests_of_search = [one for one in (held_problem, begun.search.problem) if one is not None]
    bases = [residual_at(one, found.solution).base for one in tests_of_search] if found.added else []
    function = verdict.residual_function
    final = found.bare if any(function is one for one in replacing) else found
    fitted = fitted_machine(final.solution)
    fitted = fitted if function is None else with_residual_function(fitted, function)
    return Discovery(
        campaign=campaign.name,
        machine=machine,
        fitted=_sourced(fitted, final, machine, campaign),
        used=tuple(name for name in names if name not in proven),
        held_out=proven,
        skipped=campaign.skipped,
        verdict=verdict,
        search=found,
        proof=proof,
        balances=balances,
        beyond=beyond_search(found, held_problem) if held_problem else (),
        next_tests=tests,
        numbers=numbers,
        seed=seed,
        hashes=hashes,
        residual_forces=forces,
        loops=effect_loops(found, bases, estimates_of(found, deviations(found))),
        curves=_curves(tests_of_search[0], final),
    )


def _prepared(
    machine: Machine,
    records: Sequence[xr.Dataset],
    sensors: SensorSet,
    numbers: Parameters,
    calibration: Parameters,
    *,
    seed: int,
    jobs: int,
) -> Problem:
    """The least-squares problem of all tests, with the scatter of friction's form and of the oil as noise."""
    n = numbers.number
    return prepare_problem(
        *(machine, records, sensors, calibration),
        kinds=RESIDUALS,
        others=lambda m: (with_other_form(m, n("scatter.form")), with_warm_oil(m, n("scatter.drift"))),
        seed=seed,
        jobs=jobs,
    )


def _residual_functions(
    found: Search, linear: Linearisation
) -> tuple[tuple[ResidualFunction, ...], tuple[ResidualFunction, ...]]:
    """Residual functions in addition to the effects found, and in their place, where the misfit is beyond noise."""
    n = found.numbers.number
    misfit = 0.0 if forces_explained(found) else found.misfit("wrench")
    beside = fit_residual_functions(found, linear) if misfit > n("left.noise") else ()
    forces = any("wrench" in one.candidate.family.shows_in and not one.candidate.release for one in found.added)
    if not (forces and misfit > n("accept.settled")):  # no function could fit far better
        return beside, ()
    return beside, fit_residual_functions(found, linearise(found.refit, found.calibration))


def _balances_and_forces(found: Search, held: Problem | None) -> tuple[tuple[Balance, ...], dict[str, xr.Dataset]]:
    """Balances of the held-out tests, and residual forces of one as records; empty without any."""
    if held is None:
        return (), {}
    three = [residual_at(held, one) for one in (None, found.refit, found.solution)]
    models = dict(zip(("refitted", "with the effects"), three[1:], strict=True))
    return evaluate_balances(held, three), residual_records(held, models)


def _sourced(fitted: Machine, found: Search, delivered: Machine, campaign: Campaign) -> Machine:
    """The fitted machine with the campaign as the source of every number that differs from the one delivered.

    Numbers at the bound of their range are no estimates, and say so.
    """
    source = f"fitted to campaign {campaign.name} by lhpost6 discover"
    bounded = set(at_bounds(found))
    stopped = {path for p in found.problem.parameters if p.name in bounded for path, _ in p.paths}

    def known(quantity: Quantity, at_bound: bool, was: str = "") -> Quantity:
        if at_bound:
            return replace(
                quantity, evidence="at_bound", source=f"at the bound of its range, no estimate; {source}{was}"
            )
        return replace(quantity, evidence="calibrated", source=source + was)

    parameters = fitted.parameters
    quantities = dict(parameters.quantities)
    for path, quantity in quantities.items():
        stated = delivered.parameters.quantities.get(path)
        if stated is None or stated.value != quantity.value:
            was = f"; was {stated.value} ({stated.source})" if stated else ""
            quantities[path] = known(quantity, path in stopped, was)
    effects = {}
    for name, entry in parameters.effects.items():
        if entry != delivered.parameters.effects.get(name):
            own = {key: known(q, f"{name}.{key}" in bounded) for key, q in entry.values.items()}
            entry = replace(entry, values=own)
        effects[name] = entry
    return replace(fitted, parameters=replace(parameters, quantities=quantities, effects=effects))


def _curves(problem: Problem, final: Search) -> Curves:
    """Curves of a problem's tests as delivered, and at the end of a search."""
    after = residual_at(problem, final.solution).base
    name = "with the effects" if final.added else "refitted"
    return measured_curves({"as delivered": residual_at(problem).base, name: after})


def _begin(
    problem: Problem,
    held: tuple[int, ...],
    lost: Sequence[LostMotion],
    numbers: Parameters,
    calibration: Parameters,
    *,
    hold_one_out: bool,
    progress: Progress,
) -> SearchCheckpoint:
    """Refit all parameters to the tests that are not held out, nor, if `hold_one_out`, the least informative one.

    Then adds the play that lengths show (`lost`) and, on guides, backlash before friction where tests prefer that.
    """
    machine = problem.machine
    identical = scatter_parameters(machine, numbers.number("scatter.share"), numbers.number("scatter.reach"))
    whole, forms = with_background(machine, numbers.number("scatter.spread"), problem.tests[0].channels)
    parameters = (*problem.parameters, *plan_parameters(machine), *identical, *forms)
    used = [i for i in range(len(problem.tests)) if i not in held]
    every, problem = problem, problem.with_machine(whole, parameters).only(used)
    first = NormalEquations(problem, np.zeros(len(problem.prior)), between(progress, 0.0, 0.26))
    if hold_one_out and len(used) > FEWEST:
        held = (used.pop(_least_informative(first)),)
        problem, first = problem.only(used), first.only(used)
    begun = refit(problem, first, numbers, calibration, between(progress, 0.26, 0.86))
    begun = with_lost_motion(begun, lost, between(progress, 0.86, 0.93))
    rubbed, held_problem = with_friction_form(begun, every.only(held) if held else None, between(progress, 0.93, 1.0))
    return SearchCheckpoint(machine, held, held_problem, rubbed)


def discovery_numbers() -> tuple[Parameters, Parameters]:
    """Numbers of `models/procedures/discovery.toml`, and of `calibration.toml` with the entries it replaces."""
    numbers, common = load_parameters(models_folder() / "procedures" / "discovery.toml"), calibration_numbers()
    own = {path: quantity for path, quantity in numbers.items() if path.startswith("fit.")}
    return numbers, replace(common, quantities={**common.quantities, **own})


def _held_out(names: Sequence[str], wanted: Sequence[str] | None, skipped: Sequence[SkippedTest]) -> tuple[int, ...]:
    """Places of the tests to hold out."""
    for one in skipped:
        if one.test in (wanted or ()):
            raise RecordError(f"{one.test}: cannot be held out: {one.why}")
    for name in wanted or ():
        if name not in names:
            raise UnknownNameError("test of the campaign", name, list(names))
    held = tuple(i for i, name in enumerate(names) if name in (wanted or ()))
    if len(held) == len(names):
        raise RecordError("all tests are held out: leave at least one to search")
    return held


def _least_informative(first: NormalEquations) -> int:
    """The test whose removal leaves the most information on the machine's parameters."""
    count = len(first.problem.parameters)
    prior = first.problem.prior[:count]
    own = [first.of([t])[0][:count, :count] * np.outer(prior, prior) for t in range(len(first.residual))]
    without = [sum(own) - one + np.eye(count) for one in own]
    return int(np.argmax([np.linalg.slogdet(m)[1] for m in without]))


def _hash(record: xr.Dataset) -> str:
    """SHA-256 of a record's numbers and names, the same in memory and read from a file."""
    digest = hashlib.sha256()
    for name in sorted(map(str, record.variables)):
        values = record[name].values
        digest.update(name.encode())
        # an array of objects holds addresses; names have another width in each record
        digest.update(values.tobytes() if values.dtype.kind in "biuf" else repr(values.tolist()).encode())
    return digest.hexdigest()
