"""Validation on held-out tests: the normalised RMS error of the model before and after.

Three models: as delivered; refitted, with parameters and sensor errors but no effect; after, with the effects. The gap
of a phase of a test is the RMS, over all columns that move, of the model's error in standard deviations of the sensor
noise, so that noise alone gives one (the floor); closure = (refitted - after) / (refitted - floor).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.progress import Progress
from ..data.campaign import Campaign
from ..data.sensors import SensorSet
from ..identification.calibration.sensor_errors import corrected_record
from ..identification.validation import PHASES, Phase, validate
from ..machine.machine import Machine
from .search_state import Search, fitted_machine

__all__ = ["FLOOR", "Gap", "Proof", "prove"]

FLOOR = 1.0
"""Gap due to noise alone."""

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

    @property
    def closure(self) -> float:
        """Share of the gap beyond noise that the effects have closed; nan where that is not applicable."""
        open_ = self.refitted - FLOOR
        return (self.refitted - self.after) / open_ if open_ > 0.1 else float("nan")


class Proof(NamedTuple):
    """Validation on held-out tests."""

    gaps: tuple[Gap, ...]


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
    models = [(machine, list(records))]
    for solution in (found.refit, found.solution):
        problem = solution.normal.problem
        errors = solution.x[len(problem.parameters) :]
        models.append((fitted_machine(solution), [corrected_record(r, problem.unknowns, errors) for r in records]))
    done = []
    for i, (model, some) in enumerate(models):
        done.append(validate(model, Campaign("held out", tuple(some)), sensors=sensors, phases=phases, jobs=jobs))
        progress((i + 1) / len(models))
    gaps = []
    for test in done[0].tests:
        for number in phases:
            sizes = [_size(v.phase(test, number)) for v in done]
            if np.all(np.isfinite(sizes)):
                gaps.append(Gap(PHASES[number], test, *sizes))
    return Proof(tuple(gaps))


def _size(phase: Phase | None) -> float:
    """RMS of the errors of a phase in deviations of noise; nan where it could not be compared."""
    if phase is None or phase.reason:
        return float("nan")
    found = [a.error_to_noise for a in phase.agreement if a.quantity in _COMPARED[phase.number] and a.moves]
    found = [x for x in found if np.isfinite(x)]
    return float(np.sqrt(np.mean(np.square(found)))) if found else float("nan")
