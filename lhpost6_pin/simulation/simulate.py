"""Simulation: a plant, driven by recorded spools or by a controller, by a scheme at a rate, in one of two engines.

    plant = make_plant(load_machine())
    rest = find_equilibrium(plant)
    controller = make_controller(plant, rest, load_controller("lhpost6"))
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    run = simulate(plant, ClosedLoop(controller, drive, rest), samples=len(drive))

The controller's samples are the clock: each is divided into equal model steps. A run that leaves a stroke or diverges
stops; what was computed is kept, and `Run.trouble` says when, which component, and what to try.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTUATOR, AXIS, CANCELLER, control_packed, pack_control, sense_packed
from ..control.plug import Feedback, start_plugged, step_plugged, wanted_from
from ..core.names import ENGINES, SAMPLE_RATE, SCHEMES
from ..mechanics.derivatives import evaluate_derivatives
from ..mechanics.plant import Plant, State
from ..mechanics.schemes import A, V
from ..mechanics.valve_delay import delayed_spools
from ..mechanics.workspace import Workspace, make_workspace
from .drives import ClosedLoop, Drive, OpenLoop, PluggedLoop, check_drive, check_options, check_run
from .engine_fused import Log, Signals, Span, run_fused
from .engine_pinocchio import make_stepper
from .snapshot import EVERY, Watch, take_snapshot

__all__ = ["ClosedLoop", "Drive", "OpenLoop", "PluggedLoop", "Run", "check_drive", "check_options", "diagnosis"]
__all__ += ["fastest_engine", "simulate"]

log = logging.getLogger(__name__)

Array = NDArray[np.float64]
Progress = Callable[[float], None]
"""Called now and then with the share of the run that is done, 0..1."""

_CHUNK = 1024
"""Controller samples between two progress reports."""


@dataclass(frozen=True)
class Run:
    """What a simulation leaves, sampled at `rate` [Hz]: rows of time (n,)."""

    plant: Plant
    time: Array
    q: Array  # (n, nq)
    v: Array  # (n, nv)
    a: Array  # (n, nv)
    z: Array  # (n, n_states)
    spool: Array  # (n, n_actuators) position that the ports see, mean over the sample
    command: Array | None  # (n, n_actuators), closed loop only
    rate: float
    scheme: str
    steps_per_second: int
    engine: str
    clipped: int
    trouble: str | None

    @property
    def state(self) -> State:
        """State at the last sample."""
        return State(self.q[-1], self.v[-1], self.z[-1])


def simulate(
    plant: Plant,
    drive: Drive,
    *,
    samples: int,
    scheme: str = SCHEMES[0],
    steps_per_second: int = 4 * SAMPLE_RATE,
    engine: str = ENGINES[0],
    record_every: int = 1,
    progress: Progress | None = None,
    watch: Watch | None = None,
) -> Run:
    """Run `samples` controller samples and return the motion, every `record_every`-th sample.

    `watch` is shown the plant 32 times a second of the run, beginning with its start.

    Raises UnknownNameError or SimulationError for a scheme, engine, rate or drive that cannot be. A run that goes wrong
    on the way does not raise: see `Run.trouble`.
    """
    steps = check_run(
        plant,
        drive,
        samples=samples,
        scheme=scheme,
        rate=steps_per_second,
        engine=engine,
        record_every=record_every,
    )
    dt = 1.0 / steps_per_second
    closed = not isinstance(drive, OpenLoop)
    if isinstance(drive, OpenLoop):
        start, (spool, clipped) = drive.start, _clip(drive.spool)
        first = spool[0]
    else:
        start, clipped = drive.rest.state, 0
        first = drive.rest.spool
        spool = np.tile(first, (steps, 1))
    ws = make_workspace(plant, start)
    log_ = _make_log(plant, -(-samples // record_every))
    command = np.tile(first, (samples, 1)) if closed else np.zeros((samples, plant.spools))
    status = evaluate_derivatives(plant, ws, np.ascontiguousarray(first))
    done = 0
    if status == 0:
        job = _Job(plant, drive, ws, log_, scheme, samples, steps, dt, spool, command, record_every, progress, watch)
        status, done, more = (_run_fused if engine == "fused" else _run_pinocchio)(job)
        clipped += more
    kept = -(-done // record_every)
    trouble = None if status == 0 else diagnosis(plant, status, done / SAMPLE_RATE, scheme, steps_per_second)
    if trouble:
        log.warning(trouble)
    if clipped:
        log.warning("%d spool values beyond full stroke were clipped to it: the motion asks for more flow", clipped)
    q, v, a, z = (x[:kept] for x in (log_.q, log_.v, log_.a, log_.z))
    if scheme != "semi_implicit":  # their A belongs to the start of the last step
        a = _accelerations(plant, q, v, z)
    return Run(
        plant=plant,
        time=np.arange(kept) * record_every / SAMPLE_RATE,
        q=q,
        v=v,
        a=a,
        z=z,
        spool=log_.spool[:kept],
        command=command[:done:record_every][:kept] if closed else None,
        rate=SAMPLE_RATE / record_every,
        scheme=scheme,
        steps_per_second=steps_per_second,
        engine=engine,
        clipped=clipped,
        trouble=trouble,
    )


def fastest_engine(plant: Plant) -> str:
    """Name of the engine that runs the 469D fastest on a plant: the fused one, unless a specimen's joints are free."""
    return "pinocchio" if plant.articulated else "fused"


def _make_log(plant: Plant, n: int) -> Log:
    """Arrays that a run of n recorded samples fills."""
    widths = plant.model.nq, plant.model.nv, plant.model.nv, len(plant.states), plant.spools
    return Log(*(np.zeros((n, width)) for width in widths))


def _take(log_: Log, at: int, ws: Workspace, spool: Array) -> None:
    """Fill row `at` of the log."""
    log_.q[at], log_.v[at], log_.a[at], log_.z[at] = ws.q, ws.motion[V], ws.motion[A], ws.z
    log_.spool[at] = spool


def _clip(spool: Array) -> tuple[Array, int]:
    beyond = int(np.count_nonzero(np.abs(spool) > 1.0))
    return np.ascontiguousarray(np.clip(spool, -1.0, 1.0), float), beyond


class _Job(NamedTuple):
    """A run made ready: what both engines need."""

    plant: Plant
    drive: Drive
    ws: Workspace
    log: Log
    scheme: str
    samples: int
    steps: int  # model steps a sample
    dt: float  # of one [s]
    spool: Array  # (samples * k, n_actuators), open loop; (steps, n_actuators) of the last sample, closed
    command: Array  # (samples, n_actuators), closed loop
    every: int
    progress: Progress | None
    watch: Watch | None

    def look(self, sample: int) -> None:
        """Show the plant to whoever watches, if it is time."""
        if self.watch is not None and sample % EVERY == 0:
            self.watch(take_snapshot(self.plant, self.ws, sample / SAMPLE_RATE))


def _run_pinocchio(job: _Job) -> tuple[int, int, int]:
    """Run all samples step by step; returns (status, samples done, commands clipped)."""
    plant, ws, steps = job.plant, job.ws, job.steps
    advance = make_stepper(plant, job.scheme, job.dt)
    window = np.zeros((steps, plant.spools)) if isinstance(job.drive, OpenLoop) else job.spool
    spools = _spools_from(job)
    clipped = 0
    for sample in range(job.samples):
        if job.scheme != SCHEMES[0] and not isinstance(job.drive, OpenLoop):
            evaluate_derivatives(plant, ws, window[0])  # the other schemes leave the ports of their last stage behind
        clipped += spools(sample, window)
        if sample % job.every == 0:
            _take(job.log, sample // job.every, ws, window.sum(axis=0) / steps)
        job.look(sample)
        status = advance(ws, window)
        if status:
            return status, sample + 1, clipped
        if job.progress is not None and sample % _CHUNK == 0:
            job.progress(sample / job.samples)
    if job.progress is not None:
        job.progress(1.0)
    return 0, job.samples, clipped


def _spools_from(job: _Job) -> Callable[[int, Array], int]:
    """Function that fills a sample's window (steps, n_actuators) of spools and returns how many were clipped."""
    plant, drive, ws, command = job.plant, job.drive, job.ws, job.command
    packed, buffer = plant.tables.packed, ws.buffer
    if isinstance(drive, OpenLoop):
        rows = len(job.spool) // job.samples

        def recorded(sample: int, window: Array) -> int:
            window[:] = job.spool[sample * rows : (sample + 1) * rows]
            return 0

        return recorded
    if isinstance(drive, ClosedLoop):
        loop, call = drive.controller, control_packed
        values = np.ascontiguousarray(drive.drive, float)  # any other kind would be compiled for anew
        control, memory = loop.tables.packed, loop.init()

        def compiled_loop(sample: int, window: Array) -> int:
            return int(call(sample, values, packed, buffer, control, memory, command, window))

        return compiled_loop
    users = drive.controller
    wanted = wanted_from(drive.displacement, drive.velocity, drive.acceleration)
    own = start_plugged(users, plant, drive.rest)
    sensors = Feedback(np.empty(plant.spools), np.empty(6), np.empty(plant.spools))
    path, rate = plant.command_path, float(SAMPLE_RATE)

    def plugged(sample: int, window: Array) -> int:
        sense_packed(packed, buffer, *sensors)
        asked = step_plugged(users, own, sample, wanted(sample), sensors)
        command[sample], clipped = _clip(asked)
        delayed_spools(command, 0, sample, path, rate, window)
        return clipped

    return plugged


def _run_fused(job: _Job) -> tuple[int, int, int]:
    """Run all samples in compiled chunks; returns (status, samples done, commands clipped)."""
    plant, drive = job.plant, job.drive
    none = np.zeros((1, 1))
    if isinstance(drive, ClosedLoop):
        loop = drive.controller
        control, memory, values = loop.tables, loop.init(), np.ascontiguousarray(drive.drive, float)
    else:
        control = pack_control(np.zeros(1, AXIS), np.zeros(1, ACTUATOR), none, np.zeros(0, CANCELLER))
        memory = values = none
    signals = Signals(values, memory, job.command, job.spool)
    scheme, closed = SCHEMES.index(job.scheme), isinstance(drive, ClosedLoop)
    clipped, chunk = 0, _CHUNK if job.watch is None else EVERY
    for first in range(0, job.samples, chunk):
        last = min(first + chunk, job.samples)
        job.look(first)
        span = Span(scheme, first, last, job.steps, job.dt, closed, job.every)
        status, done, more = run_fused(span, plant.tables, job.ws, control, signals, job.log)
        clipped += more
        if status:
            return status, done, clipped
        if job.progress is not None:
            job.progress(last / job.samples)
    return 0, job.samples, clipped


def diagnosis(plant: Plant, status: int, time: float, scheme: str, rate: int) -> str:
    """What a stage's status other than 0 means, and what to do."""
    if status > 0:
        leg = (*plant.machine.actuator_names, *plant.machine.strut_names)[status - 1]
        stroke = plant.legs["stroke"][status - 1]
        return (
            f"stopped at {time:.4f} s: {leg} left its stroke of +-{stroke:g} m; "
            "scale the motion down, look at the controller, or start from the record's own pose and pressures"
        )
    hint = "take the scheme semi_implicit" if scheme != "semi_implicit" else "check the drive and the parameters"
    return (
        f"stopped at {time:.4f} s: the run diverged with {scheme} at {rate} steps a second; {hint}, or take more steps "
        "(--rate)"
    )


def _accelerations(plant: Plant, q: Array, v: Array, z: Array) -> Array:
    """Accelerations (n, nv) at states of a run."""
    out = np.zeros_like(v)
    spool = np.zeros(plant.spools)  # forces do not depend on the spools, only pressure rates do
    ws = make_workspace(plant, plant.zero_state())
    for k in range(len(q)):
        ws.q[:], ws.z[:], ws.motion[V] = q[k], z[k], v[k]
        if evaluate_derivatives(plant, ws, spool):
            out[k:] = np.nan
            break
        out[k] = ws.motion[A]
    return out
