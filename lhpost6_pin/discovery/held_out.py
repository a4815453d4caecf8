"""Validation on held-out tests: the normalised RMS error of the model before and after.

Three models: as delivered; refitted, with parameters and sensor errors but no effect; after, with the effects. The gap
of a phase of a test is the RMS, over all columns that move, of the model's error in standard deviations of the sensor
noise, so that noise alone gives one (the floor); closure = (refitted - after) / (refitted - floor). The noise that
reaches a balance depends on the model's numbers; all three errors are over that of the model with the effects.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.progress import Progress
from ..data.campaign import Campaign
from ..data.sensors import SensorSet
from ..identification.calibration.prepare import as_simulated
from ..identification.calibration.sensor_errors import corrected_record
from ..identification.validation import PHASES, Phase, validate
from ..machine.machine import Machine
from .search_state import Search, fitted_machine

__all__ = ["FLOOR", "Gap", "Proof", "normalised_error", "prove"]

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
    models = [(as_simulated(found.problem, machine), list(records))]
    for solution in (found.refit, found.solution):
        problem = solution.normal.problem
        errors = solution.x[len(problem.parameters) :]
        fitted = as_simulated(problem, fitted_machine(solution))
        models.append((fitted, [corrected_record(r, problem.unknowns, errors) for r in records]))
    done = []
    for i, (model, some) in enumerate(models):
        done.append(validate(model, Campaign("held out", tuple(some)), sensors=sensors, phases=phases, jobs=jobs))
        progress((i + 1) / len(models))
    gaps = []
    for test in done[0].tests:
        for number in phases:
            three = [v.phase(test, number) for v in done]
            sizes = [normalised_error(phase, three[-1]) for phase in three]
            if np.all(np.isfinite(sizes)):
                gaps.append(Gap(PHASES[number], test, *sizes))
    return Proof(tuple(gaps))


def normalised_error(phase: Phase | None, noisy: Phase | None) -> float:
    """RMS of the errors of a phase over the noise of the same phase by one model; nan where not compared."""
    if phase is None or noisy is None or phase.reason or noisy.reason:
        return float("nan")
    noise = {(a.quantity, a.column): a.noise for a in noisy.agreement if a.moves and a.noise > 0.0}
    compared = [a for a in phase.agreement if a.quantity in _COMPARED[phase.number] and (a.quantity, a.column) in noise]
    found = [a.error_aligned / noise[a.quantity, a.column] for a in compared if np.isfinite(a.error_aligned)]
    return float(np.sqrt(np.mean(np.square(found)))) if found else float("nan")
