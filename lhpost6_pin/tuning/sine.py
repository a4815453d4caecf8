"""Sine tests: amplitude-phase control of the fundamental, adaptive harmonic cancellation of the rest.

Both obey the same least-mean-squares law, with one canceller per multiple h of the fundamental. It adds to the drive

    c(t) = w_c cos(h w t) + w_s sin(h w t),   (w_c, w_s)' = (2 / (tau |T|)) e (cos, sin)(h w t + arg T),

scaled, as is e, by the envelope of the sine; e = wanted - achieved acceleration (af), T the response from drive to
acceleration at that frequency: that of the reference generator times that from reference to feedback, from the linear
model (`margins`). Weights are constant while spool commands are clipped. The canceller of the fundamental corrects
amplitude and phase (APC); the others cancel the harmonics due to friction, valve flow and geometry (AHC).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..control import Controller, ControllerSettings, controlled
from ..control.filters import sampled_response
from ..control.tables import CANCELLER
from ..core.arrays import Array, Complex
from ..core.errors import SimulationError
from ..core.names import AXES, SAMPLE_RATE
from ..core.progress import Progress
from ..core.rounding import rounded_down
from ..core.shown import Shown
from ..data.distortion import Harmonics, harmonics, phase_between, total_distortion, total_harmonic_distortion
from ..machine.machine import Machine
from ..mechanics.plant import Plant
from ..mechanics.pose import platen_motion
from ..motions import Target, find_motion, make_target, motion_options, smooth_step
from ..motions.process import processing
from ..simulation.motion_limits import fitting_scale
from ..simulation.simulate import ClosedLoop, Run, fastest_engine, simulate
from ..simulation.trouble import with_pressure_trouble
from .identify import section, tuning_numbers
from .margins import expected_response, make_loop_model

__all__ = [
    "SineResult",
    "SineTest",
    "axis_row",
    "default_amplitude",
    "sine_target",
    "sine_test",
    "with_cancellers",
]


_CLEAR = 8.0
"""Least low-pass of the target over the frequency of its sine, whose amplitude it leaves as it is."""


@dataclass(frozen=True)
class SineResult:
    """Reproduction of a sine on its axis, over the last full cycles."""

    run: Run
    displacement: Harmonics  # achieved, all multiples within the band of the table
    acceleration: Harmonics
    amplitude_error: float  # of the displacement's fundamental [1]
    phase_error: float  # of the same [rad], negative for a lag
    distortion: float  # total harmonic distortion of the acceleration in the band of the table [1]
    distortion_all: float  # of the acceleration, at all frequencies [1]
    distortion_displacement: float
    peak_spool: float  # largest command [1]


@dataclass(frozen=True, repr=False)
class SineTest(Shown):
    """A sine reproduced by the three-variable controller alone, and with APC and AHC."""

    settings: ControllerSettings
    target: Target
    axis: str
    amplitude: float  # [m, rad]
    frequency: float  # [Hz]
    measured: slice  # samples over which amplitude, phase and distortion are taken
    before: SineResult
    after: SineResult
    cancelled: int  # multiples of the frequency, itself included, that have a canceller
    wanted: int  # multiples that were to have one


def axis_row(plant: Plant, axis: str) -> int:
    """Index of an axis among the free ones; raises SimulationError, with their names, for any other."""
    free = [AXES[k] for k in plant.axes]
    if axis not in free:
        raise SimulationError(f"{plant.machine.name} cannot move in {axis}; choose --axis from {', '.join(free)}")
    return free.index(axis)


def with_cancellers(
    controller: Controller, axis: str, frequency: float, count: int, time_constant: float
) -> Controller:
    """Controller with cancellers of the first `count` multiples of a frequency [Hz] on one axis; constant in [s].

    There is none from the first multiple on at which the size of T rises or falls too fast with frequency
    (`canceller.slope` of the tuning file): about a pair of zeros and poles, as in pitch at 31 and 36 Hz, where x moves
    with it, the phase of the linear model is off by more than 90 degrees, with which a canceller grows. The fundamental
    always has one.

    Raises SimulationError for an axis that is not free, and in other modes than acceleration: there the generator
    differentiates the output of the cancellers, and the loop through them becomes unstable above their harmonics.
    """
    mode = controller.settings.mode
    if mode != "acceleration":
        raise SimulationError(
            f"cancellers need a reference generator in acceleration mode; that of {controller.settings.name} is in "
            f"{mode} mode: choose other settings"
        )
    a = axis_row(controller.plant, axis)
    multiples = np.asarray(frequency * np.arange(1, count + 1), np.float64)
    step = tuning_numbers().number("canceller.step")
    response, above, below = _drive_response(controller, a, np.outer([1.0, 1.0 + step, 1.0 - step], multiples))
    slope = np.abs(np.log(np.abs(above / below))) / np.log((1.0 + step) / (1.0 - step))
    steep = slope > tuning_numbers().number("canceller.slope")
    count = max(1, int(np.argmax(steep)) if steep.any() else count)
    multiples, response = multiples[:count], response[:count]
    table = np.zeros(count, CANCELLER)
    table["axis"] = a
    table["turn"] = 2.0 * np.pi * multiples / SAMPLE_RATE
    table["cosine"], table["sine"] = np.cos(np.angle(response)), np.sin(np.angle(response))
    table["rate"] = 2.0 / (time_constant * SAMPLE_RATE) / np.abs(response)
    return controller._replace(canceller=table)


def _drive_response(controller: Controller, a: int, frequency: Array) -> Complex:
    """Response of the linear model from drive to acceleration of free axis a, at frequencies of any shape [Hz]."""
    row, every = controller.axis[a], frequency.ravel()
    generator = row["generator_a"], row["generator_b"], row["generator_c"], row["generator_d"]
    reference = sampled_response(generator, every, float(SAMPLE_RATE))[:, 0, 0]
    followed = expected_response(make_loop_model(controller, every), controller)[:, a, a]
    return np.asarray(((2j * np.pi * every) ** 2 * followed * reference).reshape(frequency.shape))


def sine_target(axis: str, amplitude: float, frequency: float) -> tuple[Target, Array, slice]:
    """Target of a sine long enough for cancellers to converge, its envelope 0 to 1 (n,), and the samples evaluated.

    Raises SimulationError for a frequency outside the band in which the table is tuned, MotionError for no amplitude.
    """
    parameters = tuning_numbers()
    numbers = section(parameters, "sine")
    low, high = parameters.number("noise.slow_low"), parameters.number("feedforward_targets.high")
    if not low <= frequency <= high:
        raise SimulationError(
            f"a sine of {frequency:g} Hz lies outside the table's band; choose a frequency from {low:g} to {high:g} Hz"
        )
    cycles = int(numbers.measured_cycles)
    ramp = next(int(o.default) for o in motion_options("sine") if o.name == "ramp_cycles")
    whole = int(np.ceil(numbers.settling * numbers.time_constant * frequency)) + cycles
    motion = find_motion("sine", axis=axis, amplitude=amplitude, period=1.0 / frequency, cycles=whole, ramp_cycles=ramp)
    target = make_target(motion, axes=axis, low_pass=max(processing()["low_pass"], _CLEAR * frequency))
    periods = (target.time + target.reference.start) * frequency  # since the start of the sine
    level = smooth_step(periods / ramp)[0] * smooth_step((whole + 2 * ramp - periods) / ramp)[0]
    first = int(np.searchsorted(periods, ramp + whole - cycles))
    return target, level, slice(first, first + int(np.ceil(cycles / frequency * SAMPLE_RATE)))


def default_amplitude(plant: Plant, axis: str, frequency: float) -> float:
    """Amplitude [m, rad] of a sine on an axis that is a share (`sine.share` of the tuning file) of what fits.

    Rounded down to two digits; raises as `sine_target` does.
    """
    share = tuning_numbers().number("sine.share")
    stated = plant.machine.limits.displacement[AXES.index(axis)]
    fits = stated * fitting_scale(plant, sine_target(axis, stated, frequency)[0])
    return rounded_down(share * fits, 2)


def sine_test(
    machine: Machine,
    settings: ControllerSettings,
    *,
    axis: str,
    amplitude: float,
    frequency: float,
    progress: Progress | None = None,
    **options: Any,
) -> SineTest:
    """Run a sine [m or rad, Hz] from rest without and with APC and AHC; options go to `simulate`.

    Raises SimulationError if a run does not last or becomes unphysical.
    """
    parameters = tuning_numbers()
    numbers = section(parameters, "sine")
    plant, rest, alone = controlled(machine, settings)
    target, level, measured = sine_target(axis, amplitude, frequency)
    counted = int(parameters.number("feedforward_targets.high") / frequency)
    count = min(int(numbers.harmonics), counted)
    adaptive = with_cancellers(alone, axis, frequency, count, numbers.time_constant)
    wanted = alone.drive_for(target.displacement, target.velocity, target.acceleration)
    options = {"engine": fastest_engine(plant), **options}
    found = []
    extended = np.column_stack([wanted, target.acceleration, level])
    for n, (controller, drive) in enumerate(((alone, wanted), (adaptive, extended))):
        run = with_pressure_trouble(
            simulate(plant, ClosedLoop(controller, drive, rest), samples=len(wanted), **options)
        )
        if run.trouble:
            why = ". Without them the same sine runs to its end: the cancellers are unstable here" if n else ""
            why = why or _overshoot(run, target, AXES.index(axis))
            raise SimulationError(f"{'with' if n else 'without'} cancellers the run {run.trouble}{why}")
        found.append(_evaluate(run, target, AXES.index(axis), frequency, measured, counted))
        if progress is not None:
            progress((n + 1) / 2)
    cancelled, (before, after) = len(adaptive.canceller), found
    return SineTest(settings, target, axis, amplitude, frequency, measured, before, after, cancelled, count)


def _overshoot(run: Run, target: Target, k: int) -> str:
    """A sentence on an acceleration beyond that of the target, which alone was held against the limits."""
    count = len(run.time)
    achieved = np.abs(platen_motion(run.plant, run.q, run.v, run.a).acceleration[:, k]).max()
    factor = float(achieved / np.abs(target.acceleration[:count, k]).max())
    if not 1.0 < factor < np.inf:
        return ""
    return f". The acceleration reaches {factor:.3g} times that of the target: choose an amplitude smaller by as much"


def _evaluate(run: Run, target: Target, k: int, frequency: float, measured: slice, count: int) -> SineResult:
    motion = platen_motion(run.plant, run.q, run.v, run.a)
    wanted, displacement, acceleration = (
        harmonics(values[measured, k], float(SAMPLE_RATE), frequency, multiples)
        for values, multiples in ((target.displacement, 1), (motion.displacement, count), (motion.acceleration, count))
    )
    return SineResult(
        run=run,
        displacement=displacement,
        acceleration=acceleration,
        amplitude_error=float(displacement.amplitude[0] / wanted.amplitude[0] - 1.0),
        phase_error=phase_between(wanted, displacement),
        distortion=total_harmonic_distortion(acceleration),
        distortion_all=total_distortion(motion.acceleration[measured, k], float(SAMPLE_RATE), frequency),
        distortion_displacement=total_harmonic_distortion(displacement),
        peak_spool=run.peak_command,
    )
