"""Tuning of the three-variable controller, off line and automatic.

In the order of the real table's tuning notes, per degree of freedom: displacement gain Kx, force feedback KF, velocity
feed-forward Kvf, jerk feed-forward Kjf, both repeated, acceleration feed-forward Kaf. Feedback gains are raised on the
linear model (`margins`) up to the limits of gain margin, phase margin and sensitivity. Feed-forward is fitted to the
response measured under white noise (`identify`). With a given feedback

    T = G (Kxf + Kvf s + Kaf s^2 + Kjf s^3 + Kx + Kv s + Ka s^2),

(the reset integrator acts far below), so a measured T gives G, and the gains for which T is closest to a pure delay
follow by least squares over all frequencies, weighted by coherence. All axes share one delay, that of the least total
error, so that they stay synchronous.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..control import Controller, ControllerSettings, controlled, make_controller
from ..core.arrays import Complex
from ..core.errors import SimulationError
from ..core.names import AXES, SAMPLE_RATE
from ..core.progress import Progress
from ..core.shown import Shown
from ..data.transfer import Transfer, band_within, delay_of
from ..machine.machine import Machine
from ..mechanics.equilibrium import find_equilibrium
from ..mechanics.plant import Plant, make_plant
from ..motions import Target
from ..simulation.simulate import ClosedLoop, fastest_engine, simulate
from .bandwidth import bandwidth_limitation
from .feedforward_fit import FEEDFORWARD, FeedforwardFit, best_delay
from .identify import identify_axes, noise_target, section, tuning_numbers
from .margins import LoopModel, Margin, expected_response, loop_gain, make_loop_model, margins, without_dry_friction

__all__ = ["AxisTuning", "Tuning", "TuningStep", "stays_stable", "tune"]


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
    before: Transfer  # (m, 1, 1) reference to feedback under white noise not used for tuning; nan if unstable
    after: Transfer
    band_before: tuple[float, float]  # [Hz] within the tolerance and coherent; nan if not even around 1 Hz
    band_after: tuple[float, float]
    delay_before: float  # [s] from the phase slope
    delay_after: float
    margin_before: Margin
    margin_after: Margin
    limited_by: str  # bandwidth limitation
    doubt: str = ""  # what in the run behind `after` was not linear: clipped commands, empty chambers


@dataclass(frozen=True)
class Tuning(Shown):
    """Result of a tuning: settings, the steps to them, and every axis before and after."""

    machine: Machine
    before: ControllerSettings
    after: ControllerSettings
    delay: float  # [s] common target delay of all axes
    axes: tuple[AxisTuning, ...]
    steps: tuple[TuningStep, ...]
    tolerance: float  # [dB]
    coherence: float
    doubled: bool  # stable with all master gains doubled, in a simulation without dry friction
    model: LoopModel
    expected: Complex  # (m, n, n) response of the linear model with the settings found
    was_stable: bool = True  # whether the settings before were stable: else they have no response


def tune(machine: Machine, settings: ControllerSettings, *, progress: Progress | None = None) -> Tuning:
    """Tune a controller for a machine with its specimen, beginning from given settings.

    Generators, limits, notches and force balance are not changed. Raises SimulationError if the loop is unstable even
    with the lowest gains tried.
    """
    job = _Job(make_plant(machine), settings, progress or (lambda share: None))
    targets = section(job.numbers, "feedforward_targets")
    job.done(1)
    tuned = _tune_feedback(job, settings)
    job.done(2)
    tuned, delay = _tune_feedforward(job, tuned)
    compared = [tuned, settings] if stays_stable(machine, settings) else [tuned]
    controllers = [job.controller(s) for s in compared]

    def unseen(axis: str) -> Target:
        """Noise that is not used for tuning."""
        return noise_target((axis,), machine.limits, seed=2, slow=True)

    responses = identify_axes(controllers, job.rest, unseen, job.numbers.number("noise.slow_segment"))
    new, *old = (margins(job.model, controller) for controller in controllers)
    job.done(11)
    limits = targets.decibels, targets.coherence
    found = []
    for a, ((after, doubt), *rest) in enumerate(responses):  # settings unstable on this machine have no response
        lost = replace(after, response=np.nan * after.response, coherence=0.0 * after.coherence)
        before = rest[0][0] if rest else lost
        margin = old[0][a] if old else Margin(*(np.nan,) * 4)
        was, now = (band_within(t, 0, *limits) for t in (before, after))
        delay_was, delay_now = (delay_of(t, 0, 0, targets.low, targets.high) for t in (before, after))
        reason = bandwidth_limitation(job.plant, after, now, *limits, targets.high)
        axis = AXES[job.plant.axes[a]]
        found.append(AxisTuning(axis, before, after, was, now, delay_was, delay_now, margin, new[a], reason, doubt))
    stable = stays_stable(machine, replace(tuned, master_gain=tuple(2.0 * g for g in tuned.master_gain)))
    job.done(12)
    return Tuning(
        machine=machine,
        before=settings,
        after=tuned,
        delay=delay,
        axes=tuple(found),
        steps=tuple(job.steps),
        tolerance=targets.decibels,
        coherence=targets.coherence,
        doubled=stable,
        was_stable=len(compared) > 1,
        model=job.model,
        expected=expected_response(job.model, job.controller(tuned)),
    )


class _Job:
    """What all stages share: the plant, its linear model, the numbers, and the steps so far."""

    STAGES = 12

    def __init__(self, plant: Plant, settings: ControllerSettings, progress: Progress) -> None:
        self.plant, self.progress = plant, progress
        self.numbers = tuning_numbers()
        self.targets = section(self.numbers, "feedback_targets")
        self.rest = find_equilibrium(plant)
        self.model = make_loop_model(self.controller(settings))
        self.slowest = _slowest_column(self.model)
        self.steps: list[TuningStep] = []

    def done(self, stages: int) -> None:
        self.progress(stages / self.STAGES)

    def controller(self, settings: ControllerSettings) -> Controller:
        return make_controller(self.plant, self.rest, settings)


def stays_stable(machine: Machine, settings: ControllerSettings, seconds: float = 6.0) -> bool:
    """Whether the response to a short burst of noise on all axes decays in a simulation without dry friction.

    Over the last thirds of the `seconds` after it every axis must decay, or be at rest; a limit cycle does neither.
    """
    plant, rest, controller = controlled(without_dry_friction(machine), settings)
    target = noise_target([AXES[k] for k in plant.axes], machine.limits, duration=5.0)
    n = round(seconds * SAMPLE_RATE / 3)
    quiet = np.zeros((round(seconds * SAMPLE_RATE), 6))
    motion = (np.vstack([x, quiet]) for x in (target.displacement, target.velocity, target.acceleration))
    drive = ClosedLoop(controller, controller.drive_for(*motion), rest)
    run = simulate(plant, drive, samples=len(drive.drive), engine=fastest_engine(plant))
    if run.trouble:
        return False
    speed = run.v[:, : plant.axes.size]
    moved, early, late = (np.sqrt(np.mean(part**2, axis=0)) for part in (speed, speed[-2 * n : -n], speed[-n:]))
    fading, still = late < 0.9 * early, (late < 0.01 * moved) & (late < early)  # a reset integrator fades slowly
    return bool(np.all(fading | still | (late < 1e-6 * moved)))


# ------------------------------------------------------------------------------------------------- feedback
def _with(settings: ControllerSettings, k: int, **numbers: float) -> ControllerSettings:
    """Settings with numbers of degree of freedom k replaced."""
    changes: dict[str, Any] = {}
    for name, value in numbers.items():
        values = list(getattr(settings, name))
        values[k] = float(value)
        changes[name] = tuple(values)
    return replace(settings, **changes)


def _with_displacement_gain(job: _Job, settings: ControllerSettings, k: int, value: float) -> ControllerSettings:
    """Settings with the displacement gain of degree of freedom k and the corresponding reset gain."""
    reset = job.targets.reset_ratio * value**2
    return _with(settings, k, displacement_gain=value, reset_gain=reset)


def _tune_feedback(job: _Job, settings: ControllerSettings) -> ControllerSettings:
    """Kx, KF, and both again, of all axes: from low gains up, each in turn as far as the margins allow."""
    targets = job.targets
    most = targets.displacement_bandwidth * 2.0 * np.pi * job.slowest
    first = most * targets.first_gain
    axes = job.plant.axes
    tuned = settings
    for k in map(int, axes):
        tuned = _with(_with_displacement_gain(job, tuned, k, first), k, force_damping=0.0)
    if not stays_stable(job.plant.machine, tuned):
        raise SimulationError(
            "unstable even with the lowest gains tried: check master gains, delays, valves and notches"
        )
    reached = None
    while tuned != reached:  # damping of the oil columns admits higher displacement gains, and so on
        reached = tuned
        for a in range(axes.size):
            tuned = _raise_displacement_gain(job, tuned, a, first, most)
        for a in range(axes.size):
            tuned = _raise_damping(job, tuned, a)
    for m, k in zip(margins(job.model, job.controller(tuned)), axes, strict=True):
        why = f"gain margin {20 * np.log10(m.gain):.1f} dB at {m.gain_frequency:.3g} Hz"
        for stage, name in (("Kx", "displacement_gain"), ("KF", "force_damping")):
            job.steps.append(TuningStep(stage, AXES[k], getattr(settings, name)[k], getattr(tuned, name)[k], why))
    return tuned


def _raise_displacement_gain(
    job: _Job, settings: ControllerSettings, a: int, first: float, most: float
) -> ControllerSettings:
    """Settings with the highest displacement gain of free axis a that is allowed, up to `most`."""
    k = int(job.plant.axes[a])
    best, value = settings, max(first, settings.displacement_gain[k])
    while value <= most:
        trial = _with_displacement_gain(job, settings, k, value)
        if not _allowed(job, trial, a):
            break
        best, value = trial, value * job.targets.growth
    return best


def _raise_damping(job: _Job, settings: ControllerSettings, a: int) -> ControllerSettings:
    """Settings with more force feedback on free axis a, as allowed, until its resonance is damped enough."""
    targets, k = job.targets, int(job.plant.axes[a])
    best, value = settings, max(targets.first_damping, settings.force_damping[k])
    peak = _resonance(job, settings, a)
    while value <= 1.0 and peak > targets.resonance:
        trial = _with(settings, k, force_damping=value)
        if not _allowed(job, trial, a) or (lowered := _resonance(job, trial, a)) > peak:
            break
        best, peak, value = trial, lowered, value * targets.growth
    return best


def _allowed(job: _Job, settings: ControllerSettings, a: int) -> bool:
    """Whether axis a keeps its gain margin, sensitivity and phase margin, and the other axes nearly.

    The phase margin counts below the oil columns; above them the sensitivity measures the distance of the loop from -1.
    """
    targets, controller = job.targets, job.controller(settings)
    inner = np.linalg.inv(np.eye(len(controller.axis)) + loop_gain(job.model, controller))
    sensitivity = np.abs(np.einsum("mkk->mk", inner)).max(axis=0)
    for k, m in enumerate(margins(job.model, controller, job.slowest)):
        slack = 1.0 if k == a else targets.neighbours
        if m.phase * slack < targets.phase_margin or m.gain * slack < targets.gain_margin:
            return False
        if sensitivity[k] > slack * targets.sensitivity:
            return False
    return True


def _slowest_column(model: LoopModel) -> float:
    """Frequency [Hz] of the slowest oil column: the first peak of the plant's own velocity response."""
    speed = np.abs(np.einsum("mkk->mk", model.displacement)) * model.frequency[:, None]
    inside = model.frequency > 2.0
    return float(min(model.frequency[inside][np.argmax(column[inside])] for column in speed.T))


def _resonance(job: _Job, settings: ControllerSettings, a: int) -> float:
    """Largest velocity response of an axis to its velocity command, its loops closed [1]."""
    model, controller = job.model, job.controller(settings)
    inner = np.linalg.inv(np.eye(len(controller.axis)) + loop_gain(model, controller))
    speed = 2.0 * np.pi * model.frequency * np.abs((model.displacement @ inner)[:, a, a])
    return float(speed[model.frequency > 2.0].max())


# --------------------------------------------------------------------------------------------- feed-forward
def _tune_feedforward(job: _Job, settings: ControllerSettings) -> tuple[ControllerSettings, float]:
    """Kvf, Kjf, both again, Kaf of all axes, by rounds of measuring and fitting; the settings and the common delay."""
    goals = section(job.numbers, "feedforward_targets")
    targets = {AXES[k]: noise_target((AXES[k],), job.plant.machine.limits) for k in job.plant.axes}
    segment = job.numbers.number("noise.segment")
    tuned = settings
    for k in job.plant.axes:  # a well-conditioned start, independent of the settings given
        tuned = _with(tuned, int(k), **dict(zip(FEEDFORWARD, (1.0, 0.0, 0.0), strict=True)))
    bands = (goals.low, job.slowest * goals.integrator_band), (goals.low, goals.high)
    stages: list[tuple[str, tuple[int, ...]]] = [("Kvf", ()), ("Kjf", (2,)), *[("Kaf", (1, 2))] * int(goals.rounds)]
    delay = 0.0
    for n, (stage, terms) in enumerate(stages):
        found = identify_axes([job.controller(tuned)], job.rest, targets.__getitem__, segment)
        seen = zip((transfer for ((transfer, _),) in found), job.plant.axes, strict=True)
        fits = [FeedforwardFit(transfer, tuned, int(k), bands, terms) for transfer, k in seen]
        if stage == "Kaf":
            delay = best_delay(fits, goals.largest_delay)
        for fit, k in zip(fits, map(int, job.plant.axes), strict=True):
            gains, error = fit.gains(delay)
            for term in (0, *terms):
                symbol, name = ("Kvf", "Kaf", "Kjf")[term], FEEDFORWARD[term]
                if n == len(stages) - 1 or symbol == stage != "Kaf":
                    old, why = getattr(tuned, name)[k], f"expected error {error:.3f}"
                    job.steps.append(TuningStep(symbol, AXES[k], old, gains[term], why))
                tuned = _with(tuned, k, **{name: gains[term]})
        job.done(3 + n)
    job.steps.append(TuningStep("delay", "all", 0.0, delay, "common to all axes, least total error"))
    return tuned, delay
