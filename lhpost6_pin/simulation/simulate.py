"""Simulation: a plant in open or closed loop, by a scheme at a rate, in one of two engines.

    plant, rest, controller = controlled(load_machine(), load_controller("lhpost6"))
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    run = simulate(plant, ClosedLoop(controller, drive, rest), samples=len(drive))

Each sample of the controller is divided into equal model steps. A run stops if an actuator or strut leaves its stroke
or if it diverges; its results so far are kept, and `Run.trouble` states time, component and remedy.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..control.loop import CONTROL_TYPES, control_packed, sense_packed
from ..control.plug import Feedback, start_plugged
from ..control.tables import make_scratch
from ..core.arrays import Array
from ..core.compiled import entry_point
from ..core.names import ENGINES, SAMPLE_RATE, SCHEMES
from ..core.progress import Progress
from ..mechanics.derivatives import evaluate_derivatives
from ..mechanics.plant import Plant, State
from ..mechanics.schemes import A, V
from ..mechanics.valve_delay import delayed_spools
from ..mechanics.workspace import Workspace, make_workspace
from .coupling import Coupling, CouplingOptions, CouplingResult, make_coupling
from .divergence import scheme_divergence
from .engine_fused import LOG_TYPES, RUN_TYPES, Log, Signals, Span, explicit_run, log_packed, staggered_run
from .engine_pinocchio import make_stepper
from .loops import ClosedLoop, Loop, OpenLoop, PluggedLoop, check_closed_loop, check_options, check_run
from .snapshot import EVERY, Watch, take_snapshot

__all__ = ["ClosedLoop", "Loop", "OpenLoop", "PluggedLoop", "Run", "check_closed_loop", "check_options", "diagnosis"]
__all__ += ["fastest_engine", "simulate", "simulate_many"]

log = logging.getLogger(__name__)

_CHUNK = SAMPLE_RATE
"""Controller samples between two progress reports: a second of motion."""
_STOPPED = -3
"""Status of a run that its `stop` has ended."""


@dataclass(frozen=True)
class Run:
    """Results of a simulation, sampled at `rate` [Hz]: rows of time (n,)."""

    plant: Plant
    time: Array
    q: Array  # (n, nq)
    v: Array  # (n, nv)
    a: Array  # (n, nv)
    z: Array  # (n, n_states)
    spool: Array  # (n, n_actuators) after the valve delay, mean over the sample
    command: Array | None  # (n, n_actuators), closed loop only
    rate: float
    scheme: str
    steps_per_second: int
    engine: str
    clipped: int
    trouble: str | None
    coupling: CouplingResult | None = None  # of a coupled specimen
    diverged: bool = False  # by its scheme (`divergence`): its numbers mean nothing

    @property
    def state(self) -> State:
        """State at the last sample."""
        return State(self.q[-1], self.v[-1], self.z[-1])

    @property
    def peak_command(self) -> float:
        """Largest spool command [1]; 0 in open loop."""
        return 0.0 if self.command is None else float(np.abs(self.command).max())


def simulate(
    plant: Plant,
    loop: Loop,
    *,
    samples: int,
    scheme: str = SCHEMES[0],
    steps_per_second: int = 4 * SAMPLE_RATE,
    engine: str = ENGINES[0],
    record_every: int = 1,
    progress: Progress | None = None,
    watch: Watch | None = None,
    coupling: CouplingOptions | None = None,
    stop: Callable[[], bool] | None = None,
    label: str = "",
) -> Run:
    """Run `samples` controller samples and return the motion, every `record_every`-th sample.

    `watch` is called 32 times per second of the run, first at its start, and `stop` as often: True ends the run there.
    `coupling`: how a coupled specimen is. `label`: name of the run, with which its warnings begin.

    Raises UnknownNameError or SimulationError for an invalid scheme, engine, rate, loop or exchange. A run that stops
    early does not raise: see `Run.trouble`.
    """
    options: dict[str, Any] = {"scheme": scheme, "steps_per_second": steps_per_second, "engine": engine}
    steps = check_run(plant, loop, samples=samples, record_every=record_every, **options)
    if isinstance(loop, OpenLoop):
        start, (spool, clipped) = loop.start, _clip(loop.spool)
    else:
        start, spool, clipped = loop.rest.state, np.array(loop.rest.spool, float)[None], 0
    ws = make_workspace(plant, start)
    widths = plant.model.nq, plant.model.nv, plant.model.nv, len(plant.states), plant.spools
    log_ = Log(*(np.zeros((-(-samples // record_every), width)) for width in widths))
    closed = not isinstance(loop, OpenLoop)
    window = np.tile(spool[0], (steps, 1))
    command = np.tile(spool[0], (samples, 1)) if closed else np.zeros((samples, plant.spools))
    coupled = make_coupling(plant, scheme, steps_per_second, coupling)
    evaluated = coupled.evaluate if coupled else partial(evaluate_derivatives, plant)
    status, done = evaluated(ws, window[0]), 0
    if status == 0:
        compiled = isinstance(loop, ClosedLoop)
        span = Span(SCHEMES.index(scheme), 0, samples, 1.0 / steps_per_second, compiled, record_every)
        job = _Job(plant, loop, ws, log_, span, spool, window, command, progress, watch, stop, coupled)
        status, done, more = (_run_fused if engine == "fused" else _run_pinocchio)(job)
        clipped += more
    exchanged = coupled.result() if coupled else None
    kept = -(-(done if exchanged is None else min(done, len(exchanged.wrench))) // record_every)
    trouble = coupled.trouble if coupled else None
    diverged = ""
    if status and status != _STOPPED and trouble is None:
        diverged = scheme_divergence(plant, scheme, steps_per_second, done / SAMPLE_RATE)
    if status and trouble is None:
        trouble = diverged or diagnosis(
            plant, status, done / SAMPLE_RATE, scheme, steps_per_second, replayed=not closed
        )
    named = f"{label}: " if label else ""
    if trouble:
        log.warning("%s%s", named, trouble)
    if clipped:
        why = ": the motion needs more flow" if closed else ""
        log.warning("%s%d spool values beyond full stroke were clipped to it%s", named, clipped, why)
    motion = {name: values[:kept] for name, values in log_._asdict().items()}
    if exchanged is not None:
        exchanged = exchanged.every(record_every, kept)
        motion["a"] = exchanged.acceleration
    elif scheme != SCHEMES[0]:  # the accelerations logged belong to the start of the last step
        motion["a"] = _accelerations(plant, motion["q"], motion["v"], motion["z"])
    return Run(
        plant=plant,
        time=np.arange(kept) * record_every / SAMPLE_RATE,
        **motion,
        command=command[:done:record_every][:kept] if closed else None,
        rate=SAMPLE_RATE / record_every,
        **options,
        clipped=clipped,
        trouble=trouble,
        coupling=exchanged,
        diverged=bool(diverged),
    )


def simulate_many(jobs: Sequence[tuple[Plant, Loop]], *, samples: int, threads: int = -1, **options: Any) -> list[Run]:
    """Runs of (plant, loop), in the order of jobs, with the fused engine over threads; options go to `simulate`.

    threads = -1 uses all cores. Compiled code releases the interpreter, and each run has its own arrays: results do not
    depend on the number of threads. Raises SimulationError as `simulate` does.
    """
    from joblib import Parallel, delayed

    options = {"samples": samples, "engine": "fused", **options}
    return list(Parallel(n_jobs=threads, prefer="threads")(delayed(simulate)(*job, **options) for job in jobs))


def fastest_engine(plant: Plant) -> str:
    """Fastest engine for a compiled controller: the fused one, but with free joints or a coupled specimen."""
    return "pinocchio" if plant.articulated or plant.coupled else "fused"


def _clip(spool: Array) -> tuple[Array, int]:
    beyond = int(np.count_nonzero(np.abs(spool) > 1.0))
    return np.ascontiguousarray(np.clip(spool, -1.0, 1.0), float), beyond


class _Job(NamedTuple):
    """A prepared run: what both engines need."""

    plant: Plant
    loop: Loop
    ws: Workspace
    log: Log
    span: Span  # all samples
    spool: Array  # (samples * k, n_actuators) recorded, open loop
    window: Array  # (steps, n_actuators) of the last sample
    command: Array  # (samples, n_actuators), closed loop
    progress: Progress | None
    watch: Watch | None
    stop: Callable[[], bool] | None
    coupled: Coupling | None

    @property
    def observed(self) -> bool:
        """Whether it is watched or may be stopped."""
        return self.watch is not None or self.stop is not None

    def look(self, sample: int) -> bool:
        """Call the watch, if a snapshot is due; returns whether the run is to end here."""
        if sample % EVERY:
            return False
        if self.watch is not None:
            self.watch(take_snapshot(self.plant, self.ws, sample / SAMPLE_RATE))
        return self.stop is not None and self.stop()

    def report(self, samples: int) -> None:
        """Report progress after a number of samples."""
        if self.progress is not None:
            self.progress(samples / self.span.last)


def _run_pinocchio(job: _Job) -> tuple[int, int, int]:
    """Run all samples step by step; returns (status, samples done, commands clipped)."""
    plant, ws, span, buffer = job.plant, job.ws, job.span, job.ws.buffer
    coupled = job.coupled
    advance = coupled.advance if coupled else make_stepper(plant, SCHEMES[span.scheme], span.dt)
    evaluated = coupled.evaluate if coupled else partial(evaluate_derivatives, plant)
    closed = not isinstance(job.loop, OpenLoop)
    window = job.window
    spools, log = _spools_from(job), entry_point(log_packed, LOG_TYPES)
    clipped = 0
    for sample in range(span.last):
        if span.scheme != 0 and closed:
            evaluated(ws, window[0])  # the other schemes leave the ports of their last stage
        clipped += spools(sample, window)
        if sample % span.every == 0:
            log(sample // span.every, buffer, window, *job.log)
        if job.look(sample):
            return _STOPPED, sample + 1, clipped
        status = advance(ws, window)
        if status:
            return status, sample + 1, clipped
        if sample % _CHUNK == 0:
            job.report(sample)
    job.report(span.last)
    return 0, span.last, clipped


def _spools_from(job: _Job) -> Callable[[int, Array], int]:
    """Function that fills a sample's window (steps, n_actuators) of spools and returns the number clipped."""
    plant, loop, command = job.plant, job.loop, job.command
    packed, buffer = plant.tables.packed, job.ws.buffer
    if isinstance(loop, OpenLoop):
        rows = len(job.spool) // job.span.last

        def recorded(sample: int, window: Array) -> int:
            window[:] = job.spool[sample * rows : (sample + 1) * rows]
            return 0

        return recorded
    if isinstance(loop, ClosedLoop):
        drive, call = np.ascontiguousarray(loop.drive, float), entry_point(control_packed, CONTROL_TYPES)
        control, memory, scratch = loop.controller.tables.packed, loop.controller.init(), make_scratch(plant).packed

        def compiled_loop(sample: int, window: Array) -> int:
            return int(call(sample, drive, packed, buffer, control, memory, scratch, command, window))

        return compiled_loop
    own = start_plugged(loop.controller, plant, loop.rest, (loop.displacement, loop.velocity, loop.acceleration))
    sensors = Feedback(np.empty(plant.spools), np.empty(6), np.empty(plant.spools))
    path, rate = plant.command_path, float(SAMPLE_RATE)

    def plugged(sample: int, window: Array) -> int:
        sense_packed(packed, buffer, *sensors)
        command[sample], clipped = _clip(own(sample, sensors))
        delayed_spools(command, 0, sample, path, rate, window)
        return clipped

    return plugged


def _run_fused(job: _Job) -> tuple[int, int, int]:
    """Run all samples in compiled chunks; returns (status, samples done, commands clipped)."""
    loop = job.loop
    if isinstance(loop, ClosedLoop):
        control, memory = loop.controller.tables.packed, loop.controller.init()
        drive = np.ascontiguousarray(loop.drive, float)
    else:
        control, memory, drive = np.zeros(3), *np.zeros((2, 1, 1))
    signals = Signals(drive, memory, job.command, job.spool, job.window, make_scratch(job.plant).packed)
    call = entry_point(staggered_run if job.span.scheme == 0 else explicit_run, RUN_TYPES)
    tables, buffer = job.plant.tables.packed, job.ws.buffer
    clipped, chunk, samples = 0, EVERY if job.observed else _CHUNK, job.span.last
    for first in range(0, samples, chunk):
        last = min(first + chunk, samples)
        if job.look(first):
            return _STOPPED, first, clipped
        span = job.span._replace(first=first, last=last)
        status, done, more = call(span, tables, buffer, control, signals, job.log)
        clipped += more
        if status:
            return status, done, clipped
        job.report(last)
    return 0, samples, clipped


_REPLAYED = "in open loop a model drifts from its record; compare what is before that"


def diagnosis(plant: Plant, status: int, time: float, scheme: str, rate: int, *, replayed: bool = False) -> str:
    """Meaning of a stage's status other than 0, and the remedy; `replayed`: of a run by recorded spools."""
    if status > 0:
        actuator = plant.machine.actuators[status - 1]  # a strut has no stroke
        bumper = f" through its bumper to the hard stop at {actuator.hard_stop:g} m" if actuator.bumper_travel else ""
        return f"stopped at {time:.4f} s: {actuator.name} left its stroke of +-{actuator.stroke:g} m{bumper}; " + (
            _REPLAYED if replayed else "scale the motion down, or look at the controller"
        )
    if status == _STOPPED:
        return f"stopped at {time:.4f} s: interrupted by a signal; what was done until then is kept"
    hint = "take the scheme semi_implicit" if scheme != "semi_implicit" else "check the drive and the parameters"
    return (
        f"stopped at {time:.4f} s: the run diverged with {scheme} at {rate} steps a second; {hint}, or take more steps "
        "(--rate)"
    )


def _accelerations(plant: Plant, q: Array, v: Array, z: Array) -> Array:
    """Accelerations (n, nv) at states of a run, nan from the first at which they cannot be evaluated."""
    out = np.full_like(v, np.nan)
    spool = np.zeros(plant.spools)  # forces do not depend on the spools, only pressure rates do
    ws = make_workspace(plant, plant.zero_state())
    for k in range(len(q)):
        ws.q[:], ws.z[:], ws.motion[V] = q[k], z[k], v[k]
        if evaluate_derivatives(plant, ws, spool):
            break
        out[k] = ws.motion[A]
    return out
