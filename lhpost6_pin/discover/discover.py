"""The whole search for missing effects: from a campaign of records to a verdict and its proof."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from ..calibration import Knob, calibration_numbers
from ..calibration.prepare import Prepared, prepare_problem
from ..campaign import Campaign
from ..errors import RecordError, UnknownNameError
from ..files import models_folder
from ..machine import Machine
from ..parameters import Parameters, load_parameters, override_parameters
from ..progress import Progress, between
from ..residuals import RESIDUALS
from ..sensors import Sensors
from .left import Left, what_is_left
from .proof import Proof, prove
from .search import Search, fitted_machine, search
from .verdict import Verdict, judge

__all__ = ["Discovery", "discover"]


FEWEST = 3  # tests that are searched; with more, one is held out


@dataclass(frozen=True)
class Discovery:
    """What a search for missing effects has found."""

    campaign: str
    machine: Machine  # as delivered
    fitted: Machine  # with the effects found and all numbers fitted
    used: tuple[str, ...]  # tests that were searched
    held_out: tuple[str, ...]  # tests that were not
    verdict: Verdict
    search: Search
    left: tuple[Left, ...]
    proof: Proof | None  # None where no test was held out
    numbers: Parameters
    seed: int
    hashes: dict[str, str]  # of the records that were read, by test


def discover(
    machine: Machine,
    campaign: Campaign,
    sensors: Sensors,
    *,
    hold_out: Sequence[str] | None = None,
    phases: Sequence[int] = (1, 2, 3),
    seed: int = 0,
    jobs: int = -1,
    progress: Progress | None = None,
) -> Discovery:
    """Find what a machine's model lacks to explain a campaign.

    hold_out are tests that are not searched but prove what was found; None: with more than three tests, the one that
    tells least of the machine. phases are those of a validation that the proof goes through. Deterministic for a seed
    (of the simulated noise), whatever the number of `jobs` (threads; -1: one a core).

    Raises UnknownNameError for a test that the campaign has not; RecordError where fewer than one test is left to
    search; and what `calibrate` raises.
    """
    report = progress or (lambda share: None)
    numbers = load_parameters(models_folder() / "procedures" / "discovery.toml")
    calibration = override_parameters(
        calibration_numbers(),
        {f"fit.{key}": numbers.number(f"fit.{key}") for key in ("reach", "rounds", "sensor_reach", "trust")},
    )
    names = [str(r.attrs.get("test", i)) for i, r in enumerate(campaign.records)]
    ready = prepare_problem(machine, campaign.records, sensors, calibration, kinds=RESIDUALS, seed=seed, jobs=jobs)
    knobs = tuple(_narrowed(k, numbers.number("fit.wrench_reach")) for k in ready.problem.knobs)
    ready = ready.with_machine(ready.problem.machine, knobs)
    report(0.1)
    held = _held_out(ready, names, hold_out)
    used = [i for i in range(len(names)) if i not in held]
    found, standing = search(ready.only(used), calibration, numbers, between(report, 0.1, 0.75))
    left: tuple[Left, ...] = ()
    if found.misfit("wrench") > numbers.number("left.noise"):
        left = what_is_left(found.problem, standing.base, standing.background, numbers)
    report(0.8)
    proof = None
    if held:
        records = [campaign.records[i] for i in held]
        delivered = ready.problem.machine
        part = between(report, 0.8, 1.0)
        proof = prove(delivered, found, records, sensors, phases=phases, jobs=jobs, progress=part)
    report(1.0)
    return Discovery(
        campaign=campaign.name,
        machine=ready.problem.machine,
        fitted=fitted_machine(found),
        used=tuple(names[i] for i in used),
        held_out=tuple(names[i] for i in held),
        verdict=judge(found, left, calibration, numbers),
        search=found,
        left=left,
        proof=proof,
        numbers=numbers,
        seed=seed,
        hashes={name: _hash(record) for name, record in zip(names, campaign.records, strict=True)},
    )


def _narrowed(knob: Knob, reach: float) -> Knob:
    """A knob that acts on the platen, within so many of its standard deviations; others as they are."""
    if "wrench" not in knob.shows_in:
        return knob
    return replace(knob, lowest=max(knob.lowest, -reach * knob.sd), highest=min(knob.highest, reach * knob.sd))


def _held_out(ready: Prepared, names: Sequence[str], wanted: Sequence[str] | None) -> list[int]:
    """Places of the tests to hold out."""
    if wanted is not None:
        for name in wanted:
            if name not in names:
                raise UnknownNameError("test of the campaign", name, list(names))
        held = [i for i, name in enumerate(names) if name in wanted]
        if len(held) == len(names):
            raise RecordError("all tests are held out: leave at least one to search")
        return held
    if len(names) <= FEWEST:
        return []
    return [_tells_least(ready)]


def _tells_least(ready: Prepared) -> int:
    """The test without which the others tell most of the machine's parameters; what was measured in it has no say."""
    problem = ready.problem
    x = np.zeros(len(problem.prior))
    free = np.arange(len(x)) < len(problem.knobs)
    slopes = problem.slopes(x, free, lambda share: None)
    prior = problem.prior[free]
    own = []
    for slope in slopes:
        j = slope[..., free].reshape(-1, len(prior)) * prior
        own.append(2.0 * (j.conj().T @ j).real)
    without = [sum(own) - one + np.eye(len(prior)) for one in own]
    return int(np.argmax([np.linalg.slogdet(m)[1] for m in without]))


def _hash(record: xr.Dataset) -> str:
    """SHA-256 of a record's numbers."""
    digest = hashlib.sha256()
    for name in sorted(map(str, record.variables)):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(record[name].values).tobytes())
    return digest.hexdigest()
