"""Three-phase validation of a campaign: every test in inverse dynamics, open loop and closed loop; and its metrics.

found = validate(machine, campaign)
found.phase("TX", 1).of("wrench")       # agreement of required and measured actuator wrench, per axis
"""

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from joblib import Parallel, delayed

from ...control import ControllerSettings
from ...core.errors import LhpostError, RecordError
from ...core.files import write_whole
from ...core.jsonable import as_json
from ...core.progress import Progress
from ...core.shown import Shown
from ...data.alignment import Delay, align_record
from ...data.campaign import Campaign
from ...data.measured_sensors import find_sensors
from ...data.sensors import SensorSet
from ...data.served_samples import cut_notes, part_compared
from ...machine.machine import Machine
from ...mechanics.linearize import oil_column_modes
from ...mechanics.plant import make_plant
from ..prepare import SIGNIFICANT, find_delays, warn_of_skews
from .phases import PHASES, Phase, run_phase
from .prepare_tests import ComparisonBasis, Numbers, prepare, too_short, validation_numbers
from .spectra import Resonance, Spectrum, Valves, find_valves

__all__ = ["Validation", "metrics", "save_metrics", "validate"]


_UNITS = {
    "seconds, delay, standard_error, behind_reference": "s",
    "frequency, linear_model, low_pass": "Hz",
    "variation, error, error_aligned, noise, offset, offset_expected": "the row's unit",
    "drift": "the row's unit per second",
    "all others": "1",
}


@dataclass(frozen=True, repr=False)
class Validation(Shown):
    """Result of a validation: each phase of each test."""

    campaign: str
    machine: Machine
    sensors: SensorSet
    numbers: Numbers
    skews: Mapping[str, Delay]  # between channel groups, removed from all records
    valves: Valves | None  # delays of spools behind their commands; None where either was not recorded
    phases: tuple[Phase, ...]  # test by test

    @property
    def tests(self) -> tuple[str, ...]:
        """Names of the tests, in the campaign's order."""
        return tuple(dict.fromkeys(p.test for p in self.phases))

    @property
    def residual_over_noise(self) -> tuple[float, float] | None:
        """Least and greatest residual of inverse dynamics over the noise predicted for it; None if there is none."""
        every = [a.error_to_noise for p in self.phases if p.number == 1 for a in p.of("wrench")]
        known = [ratio for ratio in every if math.isfinite(ratio)]
        return (min(known), max(known)) if known else None

    def phase(self, test: str, number: int) -> Phase | None:
        """A phase of a test; None if it was not requested."""
        return next((p for p in self.phases if (p.test, p.number) == (test, number)), None)


def validate(
    machine: Machine,
    campaign: Campaign,
    *,
    sensors: SensorSet | None = None,
    settings: ControllerSettings | None = None,
    phases: Sequence[int] = tuple(PHASES),
    jobs: int = -1,
    progress: Progress | None = None,
) -> Validation:
    """Compare a campaign with its machine in the given phases, tests over `jobs` threads.

    settings replace those that records name. Significant skews between channel groups are removed first. A missing
    channel disables only the phases that need it, with a reason; RecordError if no phase of any test is possible, or if
    two tests have one name. A recording that tripped is compared up to its trip, with a note.
    """
    _check_names(campaign)
    campaign = campaign._replace(records=tuple(map(part_compared, campaign.records)))
    sensors, numbers = sensors or find_sensors(machine, campaign.records), validation_numbers()
    plant = make_plant(machine)
    enough = [record for record in campaign.records if _seconds(record) >= numbers.shortest]
    skews = find_delays(plant, enough, SIGNIFICANT._replace(significance=numbers.number("comparison.significant_skew")))
    warn_of_skews(skews, sensors)
    basis = ComparisonBasis(sensors, numbers, oil_column_modes(machine), settings)
    done, lock = [0], threading.Lock()

    def count() -> None:
        with lock:
            done[0] += 1
            if progress is not None:
                progress(done[0] / (len(campaign.records) * len(phases)))

    def one(record: xr.Dataset) -> list[Phase]:
        return _phases_of(machine, align_record(record, skews), basis, phases, count)

    found = Parallel(n_jobs=jobs, prefer="threads")(delayed(one)(record) for record in campaign.records)
    every = tuple(phase for test in found for phase in test)
    if all(phase.reason for phase in every):
        first = "; ".join(f"{PHASES[p.number]}: {p.reason}" for p in found[0])
        raise RecordError(f"{campaign.name}: no phase of any test is possible; {found[0][0].test}: {first}")
    valves = find_valves(machine, enough, numbers)
    return Validation(campaign.name, machine, sensors, numbers, skews, valves, every)


def _seconds(record: xr.Dataset) -> float:
    """Length of a record [s]."""
    return float(np.ptp(record["time"].values)) if record.sizes["time"] else 0.0


def _check_names(campaign: Campaign) -> None:
    """Raise RecordError if two tests have one name."""
    files: dict[str, list[str]] = {}
    for k, record in enumerate(campaign.records, start=1):
        file = record.encoding.get("source", f"record {k}")
        files.setdefault(str(record.attrs.get("test", "test")), []).append(str(file))
    for name, twice in files.items():
        if len(twice) > 1:
            raise RecordError(
                f"{campaign.name}: two tests are named {name!r}: {', '.join(twice)}; rename one (attribute test)"
            )


def _phases_of(
    machine: Machine, record: xr.Dataset, basis: ComparisonBasis, phases: Sequence[int], count: Callable[[], None]
) -> list[Phase]:
    found = []
    try:
        if (length := _seconds(record)) < basis.numbers.shortest:
            raise RecordError(too_short(length, basis.numbers))
        test = prepare(machine, record, basis)
    except LhpostError as error:
        name, time = str(record.attrs.get("test", "test")), record["time"].values
        test, why = None, str(error)
    trip = cut_notes(record)
    for number in phases:
        phase = Phase(number, name, time, reason=why) if test is None else run_phase(number, test)
        found.append(replace(phase, notes=(*trip, *phase.notes)))
        count()
    return found


def metrics(found: Validation) -> dict[str, Any]:
    """All numbers of a validation, SI, by test and phase; None where not known."""
    machine = found.machine
    return {
        "campaign": found.campaign,
        "machine": machine.name,
        "specimen": machine.mounted,
        "units": _UNITS,
        "low_pass": found.numbers.band.high,
        "skews": {group: {"delay": d.delay, "standard_error": d.standard_error} for group, d in found.skews.items()},
        "valves": _valves(found.valves),
        "tests": {
            test: {PHASES[p.number]: _phase(p, found) for p in found.phases if p.test == test} for test in found.tests
        },
    }


def save_metrics(found: Validation, path: Path) -> None:
    """Write `metrics` as JSON, whole or not at all."""
    with write_whole(path) as beside:
        beside.write_text(as_json(metrics(found)) + "\n", encoding="utf-8")


def _phase(phase: Phase, found: Validation) -> dict[str, Any]:
    if phase.reason:
        return {"reason": phase.reason}
    out: dict[str, Any] = {
        "seconds": float(phase.time[-1]),
        "notes": [*phase.notes, *([phase.slip] if phase.slip else [])],
        "agreement": {},
    }
    for one in phase.agreement:
        row = {**one._asdict(), "error_to_noise": one.error_to_noise}
        out["agreement"].setdefault(row.pop("quantity"), {})[row.pop("column")] = row
    if phase.spectrum is not None:
        out["amplitude_ratio"] = _ratios(phase.spectrum, found.numbers.bands)
    out["resonance"] = {r.column: _resonance(r) for r in phase.resonances}
    if phase.lags:
        out["behind_reference"] = {lag.column: {"measured": lag.measured, "model": lag.model} for lag in phase.lags}
    return out


def _valves(valves: Valves | None) -> dict[str, Any] | None:
    if valves is None:
        return None
    columns = zip(valves.columns, valves.delay, valves.standard_error, valves.model, strict=True)
    return {c: {"delay": float(d), "standard_error": float(e), "model": float(m)} for c, d, e, m in columns}


def _ratios(spectrum: Spectrum, edges: tuple[float, ...]) -> dict[str, Any]:
    bands = [f"{low:g}-{high:g} Hz" for low, high in pairwise(edges)]
    columns = zip(spectrum.columns, spectrum.ratio.T.tolist(), strict=True)
    return {"quantity": spectrum.quantity} | {c: dict(zip(bands, values, strict=True)) for c, values in columns}


def _resonance(one: Resonance) -> dict[str, Any]:
    return {"linear_model": one.expected, "measured": one.measured._asdict(), "model": one.model._asdict()}
