"""Adaptive inverse control (AIC) and online iteration (OLI): the drive with which the table follows its target.

    AIC:  d(1) = T^-1 D r
    OLI:  d(k+1) = d(k) + T^-1 g (D r - y(k))

T is the table's transfer function under white noise (`identify`), T^-1 its stable, band-limited inverse (`inverse`),
D the mean delay of the table, r the target and y(k) the motion achieved in iteration k, in the quantity of the drive.
g is a gain per axis and half octave: where the error of an iteration exceeds that of an earlier one, the drive of the
earlier one is restored and the gain halved (dry friction makes the response depend on the level). The drive of
iteration 0 is r. The result is the best iteration; iteration stops when the error no longer falls.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..control import ControllerSettings, controlled
from ..control.inverse import InverseFilter, apply_inverse, make_inverse
from ..core.arrays import Array
from ..core.errors import SimulationError
from ..core.names import AXES, SAMPLE_RATE
from ..core.progress import Progress
from ..core.shown import Shown
from ..data.signals import align, delay, lowpass_zero_phase, rrmse
from ..data.transfer import Transfer, delay_of
from ..machine.machine import Machine
from ..mechanics.pose import PlatenMotion, platen_motion
from ..motions import Target
from ..simulation.simulate import ClosedLoop, Run, fastest_engine, simulate
from ..simulation.trouble import with_pressure_trouble
from .identify import identify, noise_target, section, tuning_numbers

__all__ = ["Iterated", "Iteration", "TableInverse", "identify_inverse", "iterate"]

_STEEP = 32
"""Order of the low-pass that ends the band of the errors: 10 % above its corner 5 % remain."""


class TableInverse(NamedTuple):
    """Response of the table under white noise, and its inverse filters."""

    transfer: Transfer
    inverse: InverseFilter  # of a reference (AIC)
    correction: InverseFilter  # of an error (OLI), zero where the response is unknown
    delay: float  # [s] mean of the axes, that of D


class Iteration(NamedTuple):
    """Errors of one drive; arrays (6,) per axis, NaN for axes without target motion."""

    number: int
    acceleration: Array  # RRMSE up to 33 Hz, delay removed [1]
    displacement: Array
    delay: Array  # of the acceleration [s]
    peak_spool: float  # largest command [1]
    clipped: int  # number of spool commands beyond their limit


@dataclass(frozen=True, repr=False)
class Iterated(Shown):
    """History of an iteration, and its best drive."""

    settings: ControllerSettings
    table: TableInverse
    target: Target
    history: tuple[Iteration, ...]
    drives: Array  # (n_iterations, n, 6)
    best: int
    reason: str  # of the end
    first_run: Run
    best_run: Run

    @property
    def drive(self) -> Array:
        """The best drive (n, 6)."""
        return np.asarray(self.drives[self.best])


def identify_inverse(machine: Machine, settings: ControllerSettings) -> TableInverse:
    """Transfer function of a controlled table, all its axes moving at once, and its inverse."""
    parameters = tuning_numbers()
    numbers = section(parameters, "iteration")
    band = numbers.low, numbers.high
    plant, rest, controller = controlled(machine, settings)
    names = tuple(AXES[k] for k in plant.axes)
    target = noise_target(names, machine.limits, duration=numbers.noise_duration)
    transfer = identify(controller, rest, target, names, parameters.number("noise.segment"))
    inverse, correction = (make_inverse(transfer, float(SAMPLE_RATE), *band, corrects=c) for c in (False, True))
    late = float(np.mean([delay_of(transfer, k, k, *band) for k in range(len(names))]))
    return TableInverse(transfer, inverse, correction, late)


def iterate(
    machine: Machine,
    target: Target,
    settings: ControllerSettings,
    *,
    table: TableInverse | None = None,
    most: int | None = None,
    gain: float | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Iterated:
    """Iterate on a target from rest; options go to `simulate`.

    table is identified first unless given. Raises SimulationError, naming the iteration, if a run stops early, and for
    a gain outside 0 < gain <= 1.
    """
    numbers = section(tuning_numbers(), "iteration")
    most = int(numbers.most) if most is None else most
    gain = float(numbers.gain) if gain is None else gain
    if not 0.0 < gain <= 1.0:
        raise SimulationError(f"the gain of the drive's update must be above 0 and at most 1 (got {gain:g})")
    report = progress or (lambda fraction: None)
    plant, rest, controller = controlled(machine, settings)
    table = table or identify_inverse(machine, settings)
    options = {"engine": fastest_engine(plant), **options}
    wanted = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    goal = align(wanted, -table.delay, 1.0 / SAMPLE_RATE)  # D r
    search = _Search(table, gain, goal)
    drive, drives, history = wanted, [], []
    best = 0
    reason = f"limit of {most} iterations reached"
    for k in range(most + 1):
        report((k + 1) / (most + 2))
        run = with_pressure_trouble(
            simulate(plant, ClosedLoop(controller, drive, rest), samples=len(wanted), **options)
        )
        if run.trouble:
            raise SimulationError(f"iteration {k} {run.trouble}")
        motion = platen_motion(plant, run.q, run.v, run.a)
        history.append(_evaluate(k, target, motion, run, numbers.high))
        drives.append(drive)
        if k == 0:
            first_run = best_run = run
        elif _error(history[k]) < _error(history[best]):
            best, best_run = k, run
        if _stalled(history, numbers.fall):
            reason = "the error stopped falling"
            break
        achieved = controller.drive_for(*motion)
        drive = search.after(drive, achieved) if k else apply_inverse(table.inverse, goal)
    report(1.0)
    return Iterated(settings, table, target, tuple(history), np.array(drives), best, reason, first_run, best_run)


class _Search:
    """Best drive so far with its achieved motion, and the next gain, by axis and half octave."""

    def __init__(self, table: TableInverse, gain: float, goal: Array) -> None:
        low, high = table.correction.band
        self.table, self.goal = table, np.fft.rfft(goal, axis=0)
        self.samples = len(goal)
        frequency = np.maximum(np.fft.rfftfreq(len(goal), 1.0 / SAMPLE_RATE), 1e-9)
        count = round(2.0 * np.log2(high / low)) + 1
        at = np.clip(2.0 * np.log2(frequency / low), 0.0, count - 1.0)
        self.bands = np.maximum(1.0 - np.abs(at - np.arange(count)[:, None]), 0.0)  # (bands, m), sum is one
        self.corrected = np.where(frequency <= high, self.bands, 0.0)
        self.gain = np.full((count, 6), gain)
        self.error = np.full((count, 6), np.inf)
        self.drive, self.achieved = self.goal.copy(), self.goal.copy()

    def after(self, drive: Array, achieved: Array) -> Array:
        """Next drive (n, 6), after one with this achieved motion."""
        new, motion = np.fft.rfft(drive, axis=0), np.fft.rfft(achieved, axis=0)
        error = self.corrected @ np.abs(self.goal - motion) ** 2
        worse = error > self.error
        self.gain = np.where(worse, 0.5 * self.gain, self.gain)
        self.error = np.minimum(error, self.error)
        back = self.bands.T @ worse  # (m, 6) share of the earlier drive
        self.drive = back * self.drive + (1.0 - back) * new
        self.achieved = back * self.achieved + (1.0 - back) * motion
        remaining = (self.bands.T @ self.gain) * (self.goal - self.achieved)
        best, correction = (np.fft.irfft(x, self.samples, axis=0) for x in (self.drive, remaining))
        return np.asarray(best + apply_inverse(self.table.correction, correction))


def _evaluate(k: int, target: Target, achieved: PlatenMotion, run: Run, high: float) -> Iteration:
    """Errors of a run from 0 to `high` [Hz], of each axis with target motion."""
    dt = 1.0 / SAMPLE_RATE
    moved = np.flatnonzero(np.abs(target.acceleration).max(axis=0))
    errors, delays = np.full((2, 2, 6), np.nan)
    for i, name in enumerate(("acceleration", "displacement")):
        wanted, found = (
            lowpass_zero_phase(getattr(m, name)[:, moved], dt, high, order=_STEEP) for m in (target, achieved)
        )
        delays[i, moved] = late = delay(wanted, found, dt)
        errors[i, moved] = rrmse(wanted, align(found, late, dt))
    return Iteration(k, errors[0], errors[1], delays[0], run.peak_command, run.clipped)


def _error(iteration: Iteration) -> float:
    """Root mean square of the acceleration errors of all axes."""
    return float(np.sqrt(np.nanmean(iteration.acceleration**2)))


def _stalled(history: list[Iteration], fall: float) -> bool:
    """Whether the last two iterations reduced the best error by less than the fraction `fall` of it."""
    errors = [_error(i) for i in history]
    return len(errors) > 3 and min(errors[-2:]) > (1.0 - fall) * min(errors[:-2])
