"""Tuning of the three-variable controller, off line and automatic.

In the order of the real table's tuning notes, per degree of freedom: displacement gain Kx, force feedback KF, velocity
feed-forward Kvf, jerk feed-forward Kjf, both repeated, acceleration feed-forward Kaf. Feedback gains are raised on the
linear model (`margins`, `feedback_search`) up to the limits of gain margin, phase margin and sensitivity. Feed-forward
is fitted to the response measured under white noise (`identify`). With a given feedback

    T = G (Kxf + Kvf s + Kaf s^2 + Kjf s^3 + Kx + Kv s + Ka s^2),

(the reset integrator acts far below), so a measured T gives G, and the gains for which T is closest to a pure delay
follow by least squares over all frequencies, weighted by coherence. All axes share one delay, that of the least total
error, so that they stay synchronous.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

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
from .feedback_search import FeedbackSearch, with_gains
from .feedforward_fit import FEEDFORWARD, FeedforwardFit, best_delay
from .identify import identify_axes, noise_target, section, tuning_numbers
from .margins import (
    LoopModel,
    Margin,
    expected_response,
    linear_table,
    loop_frequencies,
    make_loop_model,
    without_dry_friction,
)
from .stability import check_loop

__all__ = ["AxisTuning", "Tuning", "TuningStep", "stays_stable", "tune"]

# Judgement, not physics: from which loss on an axis is worse than before. A band counts as changed by a tenth, which
# is beyond the scatter of its measured end; a margin that pays for a wider band is no loss.
_BAND_LOST = 0.1  # of an end of the band
_GAIN_LOST, _PHASE_LOST = 1.0, 5.0  # of margins [dB], [deg]


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
    limited_by_specimen: bool = False  # whether the band ends near a mode of the specimen

    @property
    def worse(self) -> tuple[str, ...]:
        """What is worse after the tuning than before, a phrase each: band, gain margin, phase margin."""
        (low, high), (low_now, high_now) = self.band_before, self.band_after
        found = []
        if np.isfinite(high) and not (high_now > (1.0 - _BAND_LOST) * high and low_now < (1.0 + _BAND_LOST) * low):
            now = f"{low_now:.2g} to {high_now:.3g} Hz" if np.isfinite(high_now) else "no band"
            found.append(f"band {low:.2g} to {high:.3g} Hz before, {now} after")
        return tuple(found) if self._is_wider else (*found, *self._smaller_margins)

    @property
    def traded(self) -> tuple[str, ...]:
        """Margins that pay for a wider band, a phrase each as in `worse`; none where there was no band before."""
        return self._smaller_margins if self._is_wider and np.isfinite(self.band_before[1]) else ()

    @property
    def _is_wider(self) -> bool:
        """Whether the band ends beyond what it did before, or there was none."""
        before, now = self.band_before[1], self.band_after[1]
        return bool(np.isfinite(now) and not now < (1.0 + _BAND_LOST) * before)

    @property
    def _smaller_margins(self) -> tuple[str, ...]:
        """Margins that are smaller after the tuning than before."""
        found = []
        before, after = self.margin_before, self.margin_after
        with np.errstate(invalid="ignore"):  # infinite margins both before and after are no loss
            gains, phases = 20.0 * np.log10([before.gain, after.gain]), np.degrees([before.phase, after.phase])
            lost = gains[0] - gains[1] > _GAIN_LOST, phases[0] - phases[1] > _PHASE_LOST
        if lost[0]:
            found.append(f"gain margin {_finite(gains[0], '.1f', 'dB')} before, {gains[1]:.1f} dB after")
        if lost[1]:
            found.append(f"phase margin {_finite(phases[0], '.0f', 'deg')} before, {phases[1]:.0f} deg after")
        return tuple(found)


def _finite(value: float, form: str, unit: str) -> str:
    return f"{value:{form}} {unit}" if np.isfinite(value) else "unlimited"


@dataclass(frozen=True, repr=False)
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
    new, *old = (check_loop(controller).margins for controller in controllers)
    job.done(11)
    limits = targets.decibels, targets.coherence
    found = []
    for a, ((after, doubt), *rest) in enumerate(responses):  # settings unstable on this machine have no response
        lost = replace(after, response=np.nan * after.response, coherence=0.0 * after.coherence)
        before = rest[0][0] if rest else lost
        margin = old[0][a] if old else Margin(*(np.nan,) * 4)
        was, now = (band_within(t, 0, *limits) for t in (before, after))
        delay_was, delay_now = (delay_of(t, 0, 0, targets.low, targets.high) for t in (before, after))
        reason, mode = bandwidth_limitation(job.plant, after, now, *limits, targets.high)
        bands = before, after, was, now, delay_was, delay_now
        found.append(
            AxisTuning(AXES[job.plant.axes[a]], *bands, margin, new[a], reason, doubt, limited_by_specimen=mode)
        )
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
        self.rest = find_equilibrium(plant)
        controller = self.controller(settings)
        table = linear_table(controller)
        dense = loop_frequencies(np.linalg.eigvals(table.a).astype(complex), count=1500, near=161)
        self.model = make_loop_model(controller, dense, table)
        targets = section(self.numbers, "feedback_targets")
        self.search = FeedbackSearch(self.model, self.controller, plant.axes.tolist(), targets)
        self.steps: list[TuningStep] = []

    def done(self, stages: int) -> None:
        self.progress(stages / self.STAGES)

    def controller(self, settings: ControllerSettings) -> Controller:
        return make_controller(self.plant, self.rest, settings)


def stays_stable(machine: Machine, settings: ControllerSettings, seconds: float = 6.0) -> bool:
    """Whether the response to a short burst of noise on all axes decays in a simulation without dry friction.

    Over the last thirds of the `seconds` after it every axis must decay, or be at rest; a limit cycle does neither. Of
    what is nearly at rest the linear model decides.
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
    if np.all(fading | still | (late < 1e-6 * moved)):
        return True
    # a thousandth that is left may be a slow mode that swings past the ends of both thirds: the linear model decides
    return bool(np.all(fading | (late < 1e-3 * moved))) and check_loop(controller).stable


def _tune_feedback(job: _Job, settings: ControllerSettings) -> ControllerSettings:
    """Kx and KF of all axes, from low gains up (`feedback_search`)."""
    search = job.search
    lowest = search.lowest(settings)
    if not stays_stable(job.plant.machine, lowest):
        raise SimulationError(
            "unstable even with the lowest gains tried: check master gains, delays, valves and notches"
        )
    tuned = search.raised(lowest)
    for a, k in enumerate(search.axes):
        stages = (("Kx", "displacement_gain"), ("KF", "force_damping"))
        for (stage, name), why in zip(stages, search.limits(tuned, a), strict=True):
            job.steps.append(TuningStep(stage, AXES[k], getattr(settings, name)[k], getattr(tuned, name)[k], why))
    return tuned


# --------------------------------------------------------------------------------------------- feed-forward
def _tune_feedforward(job: _Job, settings: ControllerSettings) -> tuple[ControllerSettings, float]:
    """Kvf, Kjf, both again, Kaf of all axes, by rounds of measuring and fitting; the settings and the common delay."""
    goals = section(job.numbers, "feedforward_targets")
    targets = {AXES[k]: noise_target((AXES[k],), job.plant.machine.limits) for k in job.plant.axes}
    segment = job.numbers.number("noise.segment")
    tuned = settings
    for k in job.plant.axes:  # a well-conditioned start, independent of the settings given
        tuned = with_gains(tuned, int(k), **dict(zip(FEEDFORWARD, (1.0, 0.0, 0.0), strict=True)))
    bands = (goals.low, job.search.slowest * goals.integrator_band), (goals.low, goals.high)
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
                tuned = with_gains(tuned, k, **{name: gains[term]})
        job.done(3 + n)
    job.steps.append(TuningStep("delay", "all", 0.0, delay, "common to all axes, least total error"))
    return tuned, delay
