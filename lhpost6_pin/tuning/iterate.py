"""Adaptive inverse control and online iteration: the drive that makes the table do what is wanted.

    AIC:  d(1) = T^-1 D r
    OLI:  d(k+1) = d(k) + T^-1 g (D r - y(k))

T is the table's transfer function under white noise (`identify`), T^-1 its stable, band-limited inverse (`inverse`), D
the delay that the table has anyway, r the wanted motion and y(k) what iteration k achieved, both in the quantity of the
drive. g is a gain per axis and half octave: where an iteration did worse than one before it, the search goes back to
that one's drive and halves the gain (dry friction makes the table at one level another than at the next). Iteration 0
drives with r itself. The best iteration counts, and iterating stops when the error no longer falls.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..control import ControllerSettings, make_controller
from ..control.inverse import InverseFilter, apply_inverse, make_inverse
from ..core.errors import SimulationError
from ..core.names import AXES, SAMPLE_RATE
from ..data.signals import align, delay, lowpass_zero_phase, rrmse
from ..data.transfer import Transfer, delay_of
from ..machine.machine import Machine
from ..mechanics.equilibrium import find_equilibrium
from ..mechanics.plant import make_plant
from ..mechanics.pose import PlatenMotion, platen_motion
from ..motions import Target
from ..simulation.simulate import ClosedLoop, Run, fastest_engine, simulate
from .identify import identify, noise_target, tuning_numbers

__all__ = ["Iterated", "Iteration", "TableInverse", "identify_inverse", "iterate"]

Array = NDArray[np.float64]
Progress = Callable[[float], None]

_STEEP = 32
"""Order of the low-pass that ends the band of judgement: a tenth above it 5 % is left."""


class TableInverse(NamedTuple):
    """The table as white noise showed it, and the filters that undo it."""

    transfer: Transfer
    inverse: InverseFilter  # of a reference: AIC's
    correction: InverseFilter  # of an error: OLI's, nothing where the table is not known
    delay: float  # [s] the table's, mean of its axes: what D keeps


class Iteration(NamedTuple):
    """What one drive achieved; arrays (6,) per axis, NaN where nothing was wanted."""

    number: int
    acceleration: Array  # RRMSE up to 33 Hz, delay removed [1]
    displacement: Array
    delay: Array  # of the acceleration [s]
    peak_spool: float  # largest command [1]
    clipped: int  # spool commands beyond their limit


@dataclass(frozen=True)
class Iterated:
    """The history of an iteration, and its best drive."""

    settings: ControllerSettings
    table: TableInverse
    target: Target
    history: tuple[Iteration, ...]
    drives: Array  # (n_iterations, n, 6)
    best: int
    reason: str  # why it stopped
    first_run: Run
    best_run: Run

    @property
    def drive(self) -> Array:
        """The best drive (n, 6)."""
        return np.asarray(self.drives[self.best])


def identify_inverse(machine: Machine, settings: ControllerSettings) -> TableInverse:
    """Transfer function of a controlled table, all its axes moving at once, and its inverse."""
    numbers = tuning_numbers()
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    names = tuple(AXES[k] for k in plant.axes)
    target = noise_target(names, duration=numbers.number("iteration.noise_duration"))
    controller = make_controller(plant, rest, settings)
    transfer = identify(plant, rest, controller, target, names, numbers.number("noise.segment"))
    low, high = numbers.number("iteration.low"), numbers.number("iteration.high")
    inverse, correction = (make_inverse(transfer, float(SAMPLE_RATE), low, high, corrects=c) for c in (False, True))
    late = float(np.mean([delay_of(transfer, k, k, low, high) for k in range(len(names))]))
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

    table is identified first unless it is given. Raises SimulationError, naming the iteration, if a run does not last,
    and for a gain that is not above 0 and 1 at most.
    """
    numbers = tuning_numbers()
    most = int(numbers.number("iteration.most")) if most is None else most
    gain = numbers.number("iteration.gain") if gain is None else gain
    if not 0.0 < gain <= 1.0:
        raise SimulationError(f"a gain of {gain:g} is no gain of a drive's update; give one above 0, 1 at most")
    report = progress or (lambda share: None)
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    controller = make_controller(plant, rest, settings)
    table = table or identify_inverse(machine, settings)
    options = {"engine": fastest_engine(plant), **options}
    wanted = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    goal = align(wanted, -table.delay, 1.0 / SAMPLE_RATE)  # D r
    search = _Search(table, gain, goal)
    drive, drives, history = wanted, [], []
    best = 0
    reason = f"{most} iterations were asked for"
    for k in range(most + 1):
        report((k + 1) / (most + 2))
        run = simulate(plant, ClosedLoop(controller, drive, rest), samples=len(wanted), **options)
        if run.trouble:
            raise SimulationError(f"iteration {k} {run.trouble}")
        motion = platen_motion(plant, run.q, run.v, run.a)
        history.append(_judged(k, target, motion, run, numbers.number("iteration.high")))
        drives.append(drive)
        if k == 0:
            first_run = best_run = run
        elif _error(history[k]) < _error(history[best]):
            best, best_run = k, run
        if _stalled(history, numbers.number("iteration.fall")):
            reason = "the error stopped falling"
            break
        achieved = controller.drive_for(*motion)
        drive = search.after(drive, achieved) if k else apply_inverse(table.inverse, goal)
    report(1.0)
    return Iterated(settings, table, target, tuple(history), np.array(drives), best, reason, first_run, best_run)


class _Search:
    """The best drive so far and what it achieved, and the gain to go on with, by axis and half octave."""

    def __init__(self, table: TableInverse, gain: float, goal: Array) -> None:
        low, high = table.correction.band
        self.table, self.goal = table, np.fft.rfft(goal, axis=0)
        self.samples = len(goal)
        frequency = np.maximum(np.fft.rfftfreq(len(goal), 1.0 / SAMPLE_RATE), 1e-9)
        count = round(2.0 * np.log2(high / low)) + 1
        place = np.clip(2.0 * np.log2(frequency / low), 0.0, count - 1.0)
        self.bands = np.maximum(1.0 - np.abs(place - np.arange(count)[:, None]), 0.0)  # (bands, m), sum is one
        self.judged = np.where(frequency <= high, self.bands, 0.0)  # what lies above is not corrected either
        self.gain = np.full((count, 6), gain)
        self.error = np.full((count, 6), np.inf)
        self.drive, self.achieved = self.goal.copy(), self.goal.copy()

    def after(self, drive: Array, achieved: Array) -> Array:
        """Next drive (n, 6), after one that achieved this."""
        new, met = np.fft.rfft(drive, axis=0), np.fft.rfft(achieved, axis=0)
        error = self.judged @ np.abs(self.goal - met) ** 2
        worse = error > self.error
        self.gain = np.where(worse, 0.5 * self.gain, self.gain)
        self.error = np.minimum(error, self.error)
        back = self.bands.T @ worse  # (m, 6) share of the earlier drive
        self.drive = back * self.drive + (1.0 - back) * new
        self.achieved = back * self.achieved + (1.0 - back) * met
        error_left = (self.bands.T @ self.gain) * (self.goal - self.achieved)
        best, correction = (np.fft.irfft(x, self.samples, axis=0) for x in (self.drive, error_left))
        return np.asarray(best + apply_inverse(self.table.correction, correction))


def _judged(k: int, target: Target, achieved: PlatenMotion, run: Run, high: float) -> Iteration:
    """Errors of a run, per axis that was wanted, from 0 to `high` [Hz] and not beyond."""
    dt = 1.0 / SAMPLE_RATE
    moved = np.flatnonzero(np.abs(target.acceleration).max(axis=0))
    found = {}
    for name in ("acceleration", "displacement"):
        asked, met = (
            lowpass_zero_phase(getattr(m, name)[:, moved], dt, high, order=_STEEP) for m in (target, achieved)
        )
        late = delay(asked, met, dt)
        found[name] = (rrmse(asked, align(met, late, dt)), late)

    def six(values: Array) -> Array:
        out = np.full(6, np.nan)
        out[moved] = values
        return out

    errors, late = found["acceleration"]
    peak = float(np.abs(run.command).max()) if run.command is not None else 0.0
    return Iteration(k, six(errors), six(found["displacement"][0]), six(late), peak, run.clipped)


def _error(iteration: Iteration) -> float:
    """What iterating lowers: the mean square of all axes' acceleration errors."""
    return float(np.sqrt(np.nanmean(iteration.acceleration**2)))


def _stalled(history: list[Iteration], fall: float) -> bool:
    """True if the last two iterations lowered the best error by less than a share `fall` of it."""
    errors = [_error(i) for i in history]
    return len(errors) > 3 and min(errors[-2:]) > (1.0 - fall) * min(errors[:-2])
