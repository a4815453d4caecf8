"""Simulated tests of a machine: a motion rehearsed in closed loop, or a record's spools replayed in open loop."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..control import ControllerSettings, make_controller
from ..control.inverse import InverseFilter, apply_inverse
from ..control.plug import UserController
from ..core.arrays import Array
from ..core.errors import RecordError, SimulationError
from ..core.names import SAMPLE_RATE
from ..core.progress import Progress
from ..core.shown import hint_of, plot_of, summary_of, text_of
from ..data.channels import LAYOUT, unit_doubt
from ..data.records import require
from ..data.signals import resample_band_limited
from ..data.valve_pairs import with_joint_spools
from ..machine.machine import Machine
from ..mechanics.equilibrium import Equilibrium, find_equilibrium, specimen_at_rest
from ..mechanics.plant import Plant, State, make_plant
from ..mechanics.pose import PlatenMotion
from ..motions import Target
from .motion_limits import check_motion_limits
from .outputs import record_of_run, required_channel
from .simulate import ClosedLoop, OpenLoop, PluggedLoop, Run, simulate
from .trouble import with_pressure_trouble

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SimulatedTest", "loop_for", "rehearse", "replay", "test_facts"]


class SimulatedTest(NamedTuple):
    """A simulated test: the run and its record."""

    run: Run
    record: "xr.Dataset"

    def plot(self) -> Any:
        """Return the report, as `plot_of`."""
        return plot_of(self)

    def _repr_html_(self) -> str:
        return summary_of(self)

    def __str__(self) -> str:
        """Return the head of the report as text, as `text_of`."""
        return text_of(self)

    def __repr__(self) -> str:
        """Return one line, as `hint_of`."""
        return hint_of(self)


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
    adapt: Callable[[ClosedLoop | PluggedLoop], ClosedLoop] | None = None,
    **options: Any,
) -> SimulatedTest:
    """Reproduce a target in closed loop from rest; options go to `simulate` (scheme, steps_per_second, engine).

    settings are those of the 469D, or a user's own controller. The drive of the 469D is a given `drive` (n, 6), or that
    of the target, conditioned by adaptive inverse control with `inverse`. `adapt` changes the loop before it runs, such
    as by sine cancellers (`tuning.cancel`).

    Raises OutOfRangeError if the target exceeds the capacity of the machine, unless `beyond_limits`; SimulationError
    for invalid options.
    """
    plant = make_plant(machine)
    if not beyond_limits:
        check_motion_limits(plant, target)
    loop = loop_for(plant, find_equilibrium(plant), settings, target, drive, inverse)
    loop = loop if adapt is None else adapt(loop)
    run = simulate(plant, loop, samples=len(target.time), record_every=record_every, progress=progress, **options)
    run = with_pressure_trouble(_usable(run))
    motion = (target.displacement, target.velocity, target.acceleration)
    reference = PlatenMotion(*(x[::record_every][: len(run.time)] for x in motion))
    facts = {**test_facts(settings, target), **({"thinned_from_hz": float(SAMPLE_RATE)} if record_every > 1 else {})}
    record = record_of_run(run, {**facts, **attrs}, reference)
    if target.spectrum is not None:
        record["required_spectrum"] = required_channel(target.spectrum)
    if isinstance(settings, ControllerSettings) and isinstance(loop, ClosedLoop) and (drive is not None or inverse):
        name, driven = f"drive_{settings.mode}", loop.drive[::record_every, :6][: len(run.time)]
        about = {"units": LAYOUT[name].units, "long_name": LAYOUT[name].long_name}
        record[name] = (LAYOUT[name].dims, np.array(driven), about)
    return SimulatedTest(run, record)


def test_facts(settings: ControllerSettings | UserController, target: Target) -> dict[str, Any]:
    """Attributes of the record of a test: controller, motion, its scales and source."""
    name = settings.name if isinstance(settings, ControllerSettings) else type(settings).__name__
    return {"controller": name, **target.reference.facts}


def loop_for(
    plant: Plant,
    rest: Equilibrium,
    settings: ControllerSettings | UserController,
    target: Target,
    drive: Array | None = None,
    inverse: InverseFilter | None = None,
) -> ClosedLoop | PluggedLoop:
    """Closed loop from rest on a target, of the 469D or of a user's own controller; see `rehearse`."""
    motion = (target.displacement, target.velocity, target.acceleration)
    if isinstance(settings, ControllerSettings):
        controller = make_controller(plant, rest, settings)
        drive = controller.drive_for(*motion) if drive is None else drive
        return ClosedLoop(controller, drive if inverse is None else apply_inverse(inverse, drive), rest)
    if not all(callable(getattr(settings, method, None)) for method in ("init", "step")):
        raise SimulationError(
            f"settings are {settings!r}; give those of load_controller(...), or a controller with init and step"
        )
    if drive is not None or inverse is not None:
        raise SimulationError(
            "a drive or an inverse is an input of the 469D's reference generators; a controller of your own has none"
        )
    return PluggedLoop(settings, *motion, rest)


def replay(
    machine: Machine,
    record: "xr.Dataset",
    *,
    attrs: Mapping[str, Any],
    friction: Array | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> SimulatedTest:
    """Drive the plant with a record's spool positions, from rest with the pressures of its first sample.

    friction (n_states,) are the states of friction at the start, by default zero.
    Where two servovalves of an actuator were recorded apart, it follows their joint spool (`data.valve_pairs`). The
    spools of a simulated record at the controller's rate are held over each sample (as they were); those of any
    other are interpolated, band-limited, to the model steps. Raises RecordError naming missing channels, a spool that
    is no share of its stroke, or the specimen of the record if the machine has none.
    """
    require(record, "spool_position", "chamber_pressure_a")
    machine = machine.as_tested(record.attrs, "the record")
    if machine.double_acting:
        require(record, "chamber_pressure_b")
    plant = make_plant(machine)
    names = list(machine.actuator_names)
    recorded = (
        with_joint_spools(machine, record)["spool_position"].sel(actuator=names).transpose("time", "actuator").values
    )
    _refuse_wrong_unit(names, recorded, record)
    rate = (len(recorded) - 1) / float(record["time"][-1] - record["time"][0])
    steps = options.get("steps_per_second", 4 * SAMPLE_RATE)
    held = record.attrs.get("kind") == "simulated" and abs(rate - SAMPLE_RATE) < 1e-6 * SAMPLE_RATE
    if held:
        spool, samples = recorded, len(recorded)
    else:
        t_old = np.arange(len(recorded)) / rate
        samples = math.floor(t_old[-1] * SAMPLE_RATE + 1e-6)  # no sample is lost to rounding
        middle = (np.arange(samples * (steps // SAMPLE_RATE)) + 0.5) / steps
        spool = resample_band_limited(recorded, t_old, np.minimum(middle, t_old[-1]))
    run = simulate(
        plant, OpenLoop(spool, _start(plant, record, friction)), samples=samples, progress=progress, **options
    )
    run = with_pressure_trouble(_usable(run))
    return SimulatedTest(run, record_of_run(run, {"spool_interpolation": "held" if held else "band-limited", **attrs}))


def _refuse_wrong_unit(names: Sequence[str], spools: Array, record: "xr.Dataset") -> None:
    """Raise RecordError for recorded spools (n, n_actuators) that are no shares of full stroke."""
    peaks = np.abs(spools).max(axis=0)
    worst = int(np.argmax(np.where(np.isfinite(peaks), peaks, 0.0)))
    channel, peak = f"spool_position[{names[worst]}]", float(peaks[worst])
    if doubt := unit_doubt(channel, peak):
        sample = int(np.abs(spools[:, worst]).argmax())
        file = f"{source}: " if (source := record.encoding.get("source")) else ""
        raise RecordError(f"{file}{channel} {doubt} (sample {sample}); convert to the share of full stroke, -1 to 1")


def _usable(run: Run) -> Run:
    """The run up to its first sample with a number that is not finite, as in a diverged run.

    Raises SimulationError with the run's trouble if fewer than two samples, the least of a record, remain.
    """
    arrays = (run.q, run.v, run.a, run.z, run.spool)
    whole = all(np.isfinite(x).all() for x in arrays)
    n = len(run.q) if whole else int(np.argmin(np.logical_and.reduce([np.isfinite(x).all(axis=1) for x in arrays])))
    if n < 2:
        raise SimulationError(run.trouble or f"a record needs two samples; this run has {n}")
    if whole:
        return run
    command = None if run.command is None else run.command[:n]
    rows = {name: getattr(run, name)[:n] for name in ("time", "q", "v", "a", "z", "spool")}
    return replace(run, **rows, command=command)


def _start(plant: Plant, record: "xr.Dataset", friction: Array | None) -> State:
    """Zero pose at rest with the chamber pressures of the record's first sample, and states of `friction`."""
    zero = specimen_at_rest(plant)
    z = zero.z.copy() if friction is None else zero.z + friction
    for name, row in zip(plant.machine.actuator_names, plant.rows[plant.tables.actuators], strict=True):
        z[row["state"]] = float(record["chamber_pressure_a"].sel(actuator=name)[0])
        if name in plant.machine.double_acting:
            z[row["state"] + 1] = float(record["chamber_pressure_b"].sel(horizontal=name)[0])
    return State(zero.q, zero.v, z)
