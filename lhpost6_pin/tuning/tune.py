"""Tuning of the three-variable controller, off line and automatic.

In the order of the real table's tuning notes, per degree of freedom: displacement gain Kx, force feedback KF, velocity
feed-forward Kvf, jerk feed-forward Kjf, again, acceleration feed-forward Kaf. Feedback is raised on the linear model
(`margins`) as far as gain margin, phase margin and sensitivity allow. Feed-forward is fitted to the response measured
under white noise (`identify`): with the loop closed as it is,

    T = G (Kxf + Kvf s + Kaf s^2 + Kjf s^3 + Kx + Kv s + Ka s^2),

(the reset integrator is far below) so a measured T gives G, and the gains that bring T closest to a pure delay follow
by least squares over all frequencies, weighted by coherence. All axes share one delay, and so stay synchronous; it is
the delay with the least total error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..control import Controller, ControllerSettings, make_controller
from ..core.errors import SimulationError
from ..core.names import AXES, SAMPLE_RATE
from ..data.transfer import Transfer, band_within, delay_of, estimate_transfer
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.equilibrium import find_equilibrium
from ..mechanics.plant import Plant, make_plant
from ..motions import Target
from ..simulation.simulate import ClosedLoop, fastest_engine, simulate
from .bandwidth import bandwidth_limitation
from .feedforward_fit import FEEDFORWARD, FeedforwardFit, best_delay
from .identify import noise_target, run_noise, tuning_numbers
from .margins import LoopModel, Margin, expected_response, loop_gain, make_loop_model, margins

__all__ = ["AxisTuning", "Tuning", "TuningStep", "stays_stable", "tune"]

Array = NDArray[np.float64]
Progress = Callable[[float], None]


class TuningStep(NamedTuple):
    """One step of a tuning."""

    stage: str  # "Kx", "KF", "Kvf", "Kjf", "Kaf", "delay"
    axis: str  # or "all"
    before: float
    after: float
    reason: str


@dataclass(frozen=True)
class AxisTuning:
    """One axis, before and after tuning."""

    axis: str
    before: Transfer  # (m, 1, 1) reference to feedback under white noise the tuning has not seen; nan if unstable
    after: Transfer
    band_before: tuple[float, float]  # [Hz] within the tolerance and coherent; nan if not even around 1 Hz
    band_after: tuple[float, float]
    delay_before: float  # [s] from the phase slope
    delay_after: float
    margin_before: Margin
    margin_after: Margin
    limited_by: str  # what keeps the band from reaching further


@dataclass(frozen=True)
class Tuning:
    """What a tuning found: settings, the steps to them, and every axis before and after."""

    machine: Machine
    before: ControllerSettings
    after: ControllerSettings
    delay: float  # [s] that all axes were tuned to have
    axes: tuple[AxisTuning, ...]
    steps: tuple[TuningStep, ...]
    tolerance: float  # [dB]
    coherence: float
    doubled: bool  # stable with every master gain doubled at once, in simulation without dry friction
    model: LoopModel
    expected: NDArray[np.complex128]  # (m, n, n) response of the linear model with the settings found


def tune(machine: Machine, settings: ControllerSettings, *, progress: Progress | None = None) -> Tuning:
    """Tune a controller for a machine, specimen and all; settings are what it starts from.

    What is not tuned (generators, limits, notches, reset integrator, force balance) stays as it is. Raises
    SimulationError if the loop is unstable even with the lowest gains tried.
    """
    numbers = tuning_numbers()
    plant = make_plant(machine)
    job = _Tuning(plant, numbers, progress or (lambda share: None))
    start = job.controller(settings)
    model = make_loop_model(start)
    job.done(1)
    steps: list[TuningStep] = []
    tuned = _tune_feedback(job, model, settings, steps)
    job.done(2)
    tuned, delay = _tune_feedforward(job, tuned, _slowest_column(model), steps)
    segment = numbers.number("noise.slow_segment")
    noise = [noise_target((name,), seed=2, slow=True) for name in job.names]  # that no gain was fitted to
    after = job.measure(tuned, noise, segment)
    job.done(9)
    final = job.controller(tuned)
    new = margins(model, final)
    if stays_stable(machine, settings):
        before, old = job.measure(settings, noise, segment), margins(model, start)
    else:  # on this machine: there is nothing to show
        before = [replace(t, response=np.nan * t.response, coherence=0.0 * t.coherence) for t in after]
        old = (Margin(*(np.nan,) * 4),) * len(after)
    job.done(11)
    expected = expected_response(model, final)
    tolerance, coherence = (
        numbers.number("feedforward_targets.decibels"),
        numbers.number("feedforward_targets.coherence"),
    )
    low, high = numbers.number("feedforward_targets.low"), numbers.number("feedforward_targets.high")
    found = []
    for a, name in enumerate(job.names):
        was, now = (band_within(t, 0, tolerance, coherence) for t in (before[a], after[a]))
        found.append(
            AxisTuning(
                axis=name,
                before=before[a],
                after=after[a],
                band_before=was,
                band_after=now,
                delay_before=delay_of(before[a], 0, 0, low, high),
                delay_after=delay_of(after[a], 0, 0, low, high),
                margin_before=old[a],
                margin_after=new[a],
                limited_by=bandwidth_limitation(plant, after[a], now, tolerance, coherence, high),
            )
        )
    doubled = replace(tuned, master_gain=tuple(2.0 * g for g in tuned.master_gain))
    stable = stays_stable(machine, doubled)
    job.done(12)
    return Tuning(
        machine, settings, tuned, delay, tuple(found), tuple(steps), tolerance, coherence, stable, model, expected
    )


class _Tuning:
    """What all stages need: the plant, the numbers, and white noise of its axes."""

    STAGES = 12

    def __init__(self, plant: Plant, numbers: Parameters, progress: Progress) -> None:
        self.plant, self.numbers, self.progress = plant, numbers, progress
        self.rest = find_equilibrium(plant)
        self.names = tuple(AXES[k] for k in plant.axes)

    def done(self, stages: int) -> None:
        self.progress(stages / self.STAGES)

    def controller(self, settings: ControllerSettings) -> Controller:
        return make_controller(self.plant, self.rest, settings)

    def measure(self, settings: ControllerSettings, targets: Sequence[Target], segment: float) -> list[Transfer]:
        """Response of each axis to its own noise."""
        controller = self.controller(settings)
        achieved = run_noise(self.plant, self.rest, [controller] * len(targets), targets)
        rate = float(SAMPLE_RATE)
        return [
            estimate_transfer(t.acceleration[:, [k]], x[:, [k]], rate, segment=segment, axes=(AXES[k],))
            for t, x, k in zip(targets, achieved, self.plant.axes, strict=True)
        ]


def stays_stable(machine: Machine, settings: ControllerSettings, seconds: float = 6.0) -> bool:
    """True if a short burst of noise on all axes dies away in a simulation without dry friction.

    Over the last thirds of the `seconds` after it every axis must fade, or be still; a limit cycle does neither.
    """
    friction = [n for n in machine.parameters if n.endswith((".seal_friction", ".pad_friction"))]
    plant = make_plant(machine.with_params(dict.fromkeys(friction, 0.0)))
    rest = find_equilibrium(plant)
    target = noise_target([AXES[k] for k in plant.axes], duration=5.0)
    burst = np.column_stack([target.displacement, target.velocity, target.acceleration])
    burst = np.vstack([burst, np.zeros((round(seconds * SAMPLE_RATE), burst.shape[1]))])
    controller = make_controller(plant, rest, settings)
    drive = ClosedLoop(controller, controller.drive_for(burst[:, :6], burst[:, 6:12], burst[:, 12:]), rest)
    run = simulate(plant, drive, samples=len(burst), engine=fastest_engine(plant))
    if run.trouble:
        return False
    speed = run.v[:, : plant.axes.size]
    n = round(seconds * SAMPLE_RATE / 3)
    moved, early, late = (np.sqrt(np.mean(part**2, axis=0)) for part in (speed, speed[-2 * n : -n], speed[-n:]))
    fading, still = late < 0.9 * early, (late < 0.01 * moved) & (late < early)  # a reset integrator fades slowly
    return bool(np.all(fading | still | (late < 1e-6 * moved)))


# ------------------------------------------------------------------------------------------------- feedback
def _with(settings: ControllerSettings, name: str, k: int, value: float) -> ControllerSettings:
    """Settings with one number of degree of freedom k replaced."""
    values = list(getattr(settings, name))
    values[k] = float(value)
    changes: dict[str, Any] = {name: tuple(values)}
    return replace(settings, **changes)


def _with_displacement_gain(job: _Tuning, settings: ControllerSettings, k: int, value: float) -> ControllerSettings:
    """Settings with the displacement gain of degree of freedom k replaced, and the reset gain that goes with it."""
    reset = job.numbers.number("feedback_targets.reset_ratio") * value**2
    return _with(_with(settings, "displacement_gain", k, value), "reset_gain", k, reset)


def _tune_feedback(
    job: _Tuning, model: LoopModel, settings: ControllerSettings, steps: list[TuningStep]
) -> ControllerSettings:
    """Kx, KF, and again, of all axes: from low gains up, each in turn no further than the margins allow."""
    numbers = job.numbers
    slowest = _slowest_column(model)
    most = numbers.number("feedback_targets.displacement_bandwidth") * 2.0 * np.pi * slowest
    first, damping = (
        most * numbers.number("feedback_targets.first_gain"),
        numbers.number("feedback_targets.first_damping"),
    )
    axes = job.plant.axes
    tuned = settings
    for k in axes:
        tuned = _with(_with_displacement_gain(job, tuned, int(k), first), "force_damping", int(k), 0.0)
    if not stays_stable(job.plant.machine, tuned):
        raise SimulationError(
            "unstable even with the lowest gains tried: check master gains, delays, valves and notches"
        )
    reached = None
    while tuned != reached:  # damping the columns lets the displacement gains grow, and so on
        reached = tuned
        for name, begin, end in (("displacement_gain", first, most), ("force_damping", damping, 1.0)):
            for a in range(axes.size):
                tuned = _grown(job, model, tuned, name, a, begin, end)
    for m, k in zip(margins(model, job.controller(tuned)), axes, strict=True):
        why = f"gain margin {20 * np.log10(m.gain):.1f} dB at {m.gain_frequency:.3g} Hz"
        for stage, name in (("Kx", "displacement_gain"), ("KF", "force_damping")):
            steps.append(TuningStep(stage, AXES[k], getattr(settings, name)[k], getattr(tuned, name)[k], why))
    return tuned


def _grown(
    job: _Tuning, model: LoopModel, settings: ControllerSettings, name: str, a: int, first: float, most: float
) -> ControllerSettings:
    """Settings with one gain as high as allowed; force feedback only until the resonance is damped enough."""
    k = int(job.plant.axes[a])
    best, value = settings, max(first, getattr(settings, name)[k])
    enough = job.numbers.number("feedback_targets.resonance")
    peak = _resonance(job, model, settings, a) if name == "force_damping" else np.inf
    while value <= most and peak > enough:
        if name == "force_damping":
            trial = _with(settings, name, k, value)
        else:
            trial = _with_displacement_gain(job, settings, k, value)
        if not _allowed(job, model, trial, a):
            break
        if name == "force_damping":
            lowered = _resonance(job, model, trial, a)
            if lowered > peak:
                break
            peak = lowered
        best = trial
        value *= job.numbers.number("feedback_targets.growth")
    return best


def _allowed(job: _Tuning, model: LoopModel, settings: ControllerSettings, a: int) -> bool:
    """True if axis a keeps its gain margin, sensitivity and phase margin, and the other axes nearly.

    The phase margin counts below the oil columns; above them the sensitivity says how near the loop comes to -1.
    """
    numbers = job.numbers
    want = {n: numbers.number(f"feedback_targets.{n}") for n in ("gain_margin", "phase_margin", "sensitivity")}
    controller = job.controller(settings)
    inner = np.linalg.inv(np.eye(len(controller.axis)) + loop_gain(model, controller))
    sensitivity = np.abs(np.einsum("mkk->mk", inner)).max(axis=0)
    for k, m in enumerate(margins(model, controller, _slowest_column(model))):
        slack = 1.0 if k == a else numbers.number("feedback_targets.neighbours")
        late, near = m.phase * slack < want["phase_margin"], m.gain * slack < want["gain_margin"]
        if late or near or sensitivity[k] > slack * want["sensitivity"]:
            return False
    return True


def _slowest_column(model: LoopModel) -> float:
    """Frequency [Hz] of the slowest oil column: where the plant's own velocity response first peaks."""
    speed = np.abs(np.einsum("mkk->mk", model.displacement)) * model.frequency[:, None]
    inside = model.frequency > 2.0
    return float(min(model.frequency[inside][np.argmax(column[inside])] for column in speed.T))


def _resonance(job: _Tuning, model: LoopModel, settings: ControllerSettings, a: int) -> float:
    """Largest velocity response of an axis to the velocity asked for, its loops closed [1]."""
    controller = job.controller(settings)
    inner = np.linalg.inv(np.eye(len(controller.axis)) + loop_gain(model, controller))
    speed = 2.0 * np.pi * model.frequency * np.abs((model.displacement @ inner)[:, a, a])
    return float(speed[model.frequency > 2.0].max())


# --------------------------------------------------------------------------------------------- feed-forward
def _tune_feedforward(
    job: _Tuning, settings: ControllerSettings, slowest: float, steps: list[TuningStep]
) -> tuple[ControllerSettings, float]:
    """Kvf, Kjf, again, Kaf of all axes, by rounds of measuring and fitting; the settings and the delay chosen."""
    numbers = job.numbers
    targets = [noise_target((name,)) for name in job.names]
    segment = numbers.number("noise.segment")
    tuned = settings
    for k in job.plant.axes:  # a well-conditioned start, independent of the settings given
        for name, value in zip(FEEDFORWARD, (1.0, 0.0, 0.0), strict=True):
            tuned = _with(tuned, name, int(k), value)
    low, high = numbers.number("feedforward_targets.low"), numbers.number("feedforward_targets.high")
    bands = (low, slowest * numbers.number("feedforward_targets.integrator_band")), (low, high)
    rounds = int(numbers.number("feedforward_targets.rounds"))
    stages: list[tuple[str, tuple[int, ...]]] = [("Kvf", ()), ("Kjf", (2,)), *[("Kaf", (1, 2))] * rounds]
    delay = 0.0
    for n, (stage, terms) in enumerate(stages):
        found = job.measure(tuned, targets, segment)
        fits = [FeedforwardFit(t, tuned, int(k), bands, terms) for t, k in zip(found, job.plant.axes, strict=True)]
        if stage == "Kaf":
            delay = best_delay(fits, numbers.number("feedforward_targets.largest_delay"))
        for fit, name in zip(fits, job.names, strict=True):
            gains, error = fit.gains(delay)
            k = AXES.index(name)
            for term in (0, *terms):
                symbol, old = ("Kvf", "Kaf", "Kjf")[term], getattr(tuned, FEEDFORWARD[term])[k]
                tuned = _with(tuned, FEEDFORWARD[term], k, gains[term])
                if n == len(stages) - 1 or symbol == stage != "Kaf":
                    steps.append(TuningStep(symbol, name, old, gains[term], f"expected error {error:.3f}"))
        job.done(3 + n)
    steps.append(TuningStep("delay", "all", 0.0, delay, "common to all axes, least total error"))
    return tuned, delay
