"""Two things to do with a machine: rehearse a motion in closed loop, and replay a record's spools in open loop."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..control import ControllerSettings, make_controller
from ..control.inverse import InverseFilter, apply_inverse
from ..control.plug import UserController
from ..core.errors import OutOfRangeError, SimulationError
from ..core.names import AXES, SAMPLE_RATE
from ..data.records import require
from ..data.signals import resample_band_limited
from ..machine.machine import Machine
from ..mechanics.capacity import make_actuator_check
from ..mechanics.equilibrium import find_equilibrium
from ..mechanics.plant import Plant, State, make_plant
from ..mechanics.pose import PlatenMotion
from ..motions import LimitsSummary, MotionLimits, Target, check_limits
from .outputs import record_of_run
from .simulate import ClosedLoop, Drive, OpenLoop, PluggedLoop, Progress, Run, simulate

__all__ = ["SimulatedTest", "rehearse", "replay", "target_within_limits"]

Array = NDArray[np.float64]


class SimulatedTest(NamedTuple):
    """A simulated test: the run and its record."""

    run: Run
    record: xr.Dataset


def target_within_limits(plant: Plant, target: Target) -> LimitsSummary:
    """Utilisation of the machine by a target: Table 2.2's limits, strokes, valve flow.

    Raises OutOfRangeError that names each limit exceeded and the scale that fits; for a guided machine also where the
    target moves an axis that the machine has not.
    """
    limits, axes = plant.machine.limits, plant.axes
    blocked = [AXES[k] for k in range(6) if k not in axes and np.any(target.displacement[:, k] != 0.0)]
    if blocked:
        name, free = plant.machine.name, ",".join(AXES[k] for k in axes)
        raise OutOfRangeError(
            f"{target.reference.motion}: {name} cannot move in {', '.join(blocked)}; choose with --axes {free}"
        )

    def six(values: tuple[float, ...]) -> Array:
        return np.array([values[k] if k in axes else math.inf for k in range(6)])

    bounds = MotionLimits(six(limits.displacement), six(limits.velocity), six(limits.acceleration))
    return check_limits(target, bounds, make_actuator_check(plant))


def rehearse(
    machine: Machine,
    target: Target,
    settings: ControllerSettings | UserController,
    *,
    attrs: Mapping[str, Any],
    drive: Array | None = None,
    inverse: InverseFilter | None = None,
    beyond_limits: bool = False,
    record_every: int = 1,
    progress: Progress | None = None,
    **options: Any,
) -> SimulatedTest:
    """Reproduce a target in closed loop from rest; options go to `simulate` (scheme, steps_per_second, engine).

    settings are the 469D's, or a user's own controller. The 469D takes the drive that its reference generators turn
    into the target, or what adaptive inverse control makes of that with `inverse`, or a `drive` (n, 6) given as such.

    Raises OutOfRangeError if the target is more than the machine can give, unless `beyond_limits` asks to try all the
    same; SimulationError for options that cannot be.
    """
    plant = make_plant(machine)
    if not beyond_limits:
        target_within_limits(plant, target)
    rest = find_equilibrium(plant)
    motion = (target.displacement, target.velocity, target.acceleration)
    loop: Drive
    if isinstance(settings, ControllerSettings):
        controller = make_controller(plant, rest, settings)
        drive = controller.drive_for(*motion) if drive is None else drive
        loop = ClosedLoop(controller, drive if inverse is None else apply_inverse(inverse, drive), rest)
    elif drive is not None or inverse is not None:
        raise SimulationError(
            "a drive or an inverse goes into the 469D's reference generators, which a controller of your own has not"
        )
    else:
        loop = PluggedLoop(settings, *motion, rest)
    run = simulate(plant, loop, samples=len(target.time), record_every=record_every, progress=progress, **options)
    run = _usable(run)
    asked = PlatenMotion(*(x[::record_every][: len(run.time)] for x in motion))
    name = settings.name if isinstance(settings, ControllerSettings) else type(settings).__name__
    facts = {
        "controller": name,
        "scale": target.reference.scale,
        "motion": target.reference.motion,
        "source": target.reference.source,
    }
    return SimulatedTest(run, record_of_run(run, {**facts, **attrs}, asked))


def replay(
    machine: Machine,
    record: xr.Dataset,
    *,
    attrs: Mapping[str, Any],
    progress: Progress | None = None,
    **options: Any,
) -> SimulatedTest:
    """Drive the plant with a record's spool positions, from rest with its first sample's pressures.

    A simulated record at the controller's rate is held over each sample (as it was made); any other is band-limited
    and interpolated smoothly to the model's steps. Raises RecordError naming missing channels, or a specimen
    that the record was made with and the machine has not.
    """
    require(record, "spool_position", "chamber_pressure_a")
    machine = machine.as_tested(record.attrs, "the record")
    if machine.double_acting:
        require(record, "chamber_pressure_b")
    plant = make_plant(machine)
    names = list(machine.actuator_names)
    recorded = record["spool_position"].sel(actuator=names).transpose("time", "actuator").values
    rate = (len(recorded) - 1) / float(record["time"][-1] - record["time"][0])
    steps = options.get("steps_per_second", 4 * SAMPLE_RATE)
    held = record.attrs.get("kind") == "simulated" and abs(rate - SAMPLE_RATE) < 1e-6 * SAMPLE_RATE
    if held:
        spool, samples = recorded, len(recorded)
    else:
        t_old = np.arange(len(recorded)) / rate
        samples = math.floor(t_old[-1] * SAMPLE_RATE + 1e-6)  # a rounding error must not cost a sample
        middle = (np.arange(samples * (steps // SAMPLE_RATE)) + 0.5) / steps
        spool = resample_band_limited(recorded, t_old, np.minimum(middle, t_old[-1]))
    run = simulate(plant, OpenLoop(spool, _start(plant, record)), samples=samples, progress=progress, **options)
    run = _usable(run)
    return SimulatedTest(run, record_of_run(run, {"spool_interpolation": "held" if held else "band-limited", **attrs}))


def _usable(run: Run) -> Run:
    """The run up to its last sample that is finite throughout: one that diverged may end in numbers that are not.

    Raises SimulationError with the run's trouble if not even two samples are left to make a record of.
    """
    arrays = (run.q, run.v, run.a, run.z, run.spool)
    finite = np.logical_and.reduce([np.isfinite(x).all(axis=1) for x in arrays])
    n = len(finite) if finite.all() else int(np.argmin(finite))
    if n < 2:
        raise SimulationError(run.trouble or f"a record needs two samples; this run has {n}")
    if n == len(finite):
        return run
    command = None if run.command is None else run.command[:n]
    rows = {name: getattr(run, name)[:n] for name in ("time", "q", "v", "a", "z", "spool")}
    return replace(run, **rows, command=command)


def _start(plant: Plant, record: xr.Dataset) -> State:
    """Zero pose at rest with the chamber pressures of the record's first sample."""
    zero = plant.zero_state()
    z = zero.z.copy()
    for name, row in zip(plant.machine.actuator_names, plant.rows[plant.tables.actuators], strict=True):
        z[row["state"]] = float(record["chamber_pressure_a"].sel(actuator=name)[0])
        if name in plant.machine.double_acting:
            z[row["state"] + 1] = float(record["chamber_pressure_b"].sel(horizontal=name)[0])
    return State(zero.q, zero.v, z)
