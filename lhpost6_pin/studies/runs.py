"""The runs of a block of an ensemble, one after the other in one process."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg  # noqa: F401  loaded before its threads are limited
from threadpoolctl import threadpool_limits

from ..control import ControllerSettings
from ..core.arrays import Array
from ..core.errors import LhpostError
from ..core.names import AXES
from ..identification.calibration import with_parameters
from ..identification.calibration.free_parameters import FreeParameter
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..motions import Target
from ..simulation.rehearse import rehearse
from .plan import Block, EnsemblePlan, PlannedMotion
from .quantities import LIMITS, OF_LIMITS, Variable, evaluate, periods_of, psa, variables_of

__all__ = ["FACTS", "BlockInputs", "block_inputs", "labels_of", "run_block"]

FACTS: Mapping[str, tuple[Variable, float | str]] = {
    "seconds": (Variable((), "s", "simulated time"), np.nan),
    "trouble": (Variable((), "1", "trouble of a run, empty without any"), ""),
    "failure": (Variable((), "1", "why a run could not be made, empty if it could"), ""),
}
"""Facts of a run beside its quantities, with what they are without one."""


class BlockInputs(NamedTuple):
    """All that the runs of a block need, so that a worker reads no file."""

    motion: PlannedMotion
    scale: float
    machine: Machine  # as stated, with the specimen
    settings: ControllerSettings
    parameters: tuple[FreeParameter, ...]
    coordinates: Array  # (k, p)
    groups: tuple[str, ...]
    numbers: Parameters
    options: Mapping[str, Any]  # of `simulate`


def block_inputs(plan: EnsemblePlan, block: Block) -> BlockInputs:
    """Inputs of a block of a plan."""
    motion, scale, specimen, controller = block.place
    machine = list(plan.specimens.values())[specimen]
    return BlockInputs(
        list(plan.motions.values())[motion],
        plan.scales[scale],
        machine,
        list(plan.controllers.values())[controller],
        plan.draws.parameters,
        plan.draws.coordinates[block.first : block.last],
        plan.groups,
        plan.numbers,
        plan.options[list(plan.specimens)[specimen]],
    )


def labels_of(machine: Machine, numbers: Parameters) -> dict[str, Sequence[str] | Array]:
    """Labels of the dimensions of quantities."""
    own: dict[str, Sequence[str] | Array] = {"axis": AXES, "direction": AXES[:3], "actuator": machine.actuator_names}
    return own | {"limit": LIMITS, "period": periods_of(numbers)}


def run_block(inputs: BlockInputs) -> dict[str, Array]:
    """Quantities (k, ...) of the k runs of a block by name.

    Beside them `seconds` simulated, and in words `trouble` of a run and `failure` of one that could not be made; what
    these lack is not-a-number. Of a run that stopped on the way only limits that it had reached are kept. Of the
    target, its `duration` [s] and, with spectra, `target_psa` (directions, periods).
    """
    sizes = {name: len(labels) for name, labels in labels_of(inputs.machine, inputs.numbers).items()}
    wanted = {n: tuple(sizes[d] for d in v.dims) for n, v in variables_of(inputs.groups).items()}
    rows: list[dict[str, Any]] = []
    target, failure = None, ""
    try:
        target = inputs.motion.target(inputs.machine, inputs.scale)
    except LhpostError as error:
        failure = str(error)
    with _quiet(), threadpool_limits(1):  # with another number of threads sums of linear algebra round otherwise
        blank: dict[str, Any] = {name: np.full(shape, np.nan) for name, shape in wanted.items()}
        blank |= {name: nothing for name, (_, nothing) in FACTS.items()}
        for coordinates in inputs.coordinates:
            found = {"failure": failure} if target is None else _run(inputs, target, coordinates)
            rows.append(blank | found)
    block = {name: np.array([row[name] for row in rows]) for name in blank}
    if target is not None:
        block["duration"] = np.array(len(target.time) * target.time_step)
        if "psa" in wanted:
            block["target_psa"] = psa(target.acceleration[:, :3], target.time_step, inputs.numbers)
    return block


def _run(inputs: BlockInputs, target: Target, coordinates: Array) -> dict[str, Any]:
    """One run: what of it could be evaluated."""
    try:
        machine = with_parameters(inputs.machine, inputs.parameters, coordinates)
        test = rehearse(machine, target, inputs.settings, attrs={}, beyond_limits=True, **inputs.options)
        stopped = len(test.run.time) < len(target.time)
        groups = [group for group in inputs.groups if not stopped or group in OF_LIMITS]
        found: dict[str, Any] = dict(evaluate(groups, test.run, test.record, inputs.numbers))
    except Exception as error:  # whatever one of many runs ends with is its row, and ends no other
        return {"failure": f"{type(error).__name__}: {error}"}
    if stopped and "limit_use" in found:  # what was within its limit so far might not have stayed so
        found["limit_use"] = np.where(found["limit_use"] >= 1.0, found["limit_use"], np.nan)
    return {**found, "seconds": len(test.run.time) / test.run.rate, "trouble": test.run.trouble or ""}


@contextmanager
def _quiet() -> Iterator[None]:
    """Without warnings of single runs: an ensemble's are in its results."""
    log = logging.getLogger("lhpost6_pin")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)
