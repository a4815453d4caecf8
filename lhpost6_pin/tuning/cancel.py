"""Amplitude-phase control and harmonic cancellation of a sine-like motion, for any closed loop of the 469D.

    loop = cancelling(loop, target, "x=0.5")          # axis, fundamental [Hz]

The cancellers of `sine` learn on the wanted acceleration of the target, at the level of its fundamental: the amplitude
of its displacement at that frequency over the cycle around each sample, over the largest.
"""

import logging
import math

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..core.arrays import Array
from ..core.errors import SimulationError
from ..core.names import AXES, SAMPLE_RATE
from ..motions import Target
from ..simulation.simulate import ClosedLoop, PluggedLoop
from .identify import section, tuning_numbers
from .sine import axis_row, with_cancellers

__all__ = ["amplitude_at", "cancelling", "change_of_cycles"]

_log = logging.getLogger(__name__)

_SINE_LIKE = 0.5  # of the largest displacement, that the fundamental's amplitude reaches where a motion is a sine's
_REPEATS = 0.6  # largest change from cycle to cycle over the motion; three cycles with half a cycle of ramp: 0.50


def cancelling(loop: ClosedLoop | PluggedLoop, target: Target, sine: str) -> ClosedLoop:
    """The loop with cancellers of a fundamental, "AXIS=HERTZ", and of its harmonics in the band of the table.

    Raises SimulationError for a user's own controller, which has none, an axis that is not free or does not move, a
    frequency outside the band, or settings that are not in acceleration mode.
    """
    axis, _, text = sine.partition("=")
    axis = axis.strip()
    try:
        frequency = float(text)
    except ValueError:
        raise SimulationError(f"--cancel {sine}: write an axis and its fundamental in hertz, such as x=0.5") from None
    if isinstance(loop, PluggedLoop):
        raise SimulationError("--cancel is for the 469D's drive; a controller of your own does without")
    parameters = tuning_numbers()
    numbers = section(parameters, "sine")
    low, high = parameters.number("noise.slow_low"), parameters.number("feedforward_targets.high")
    if not (math.isfinite(frequency) and low <= frequency <= high):
        raise SimulationError(
            f"--cancel {sine}: outside the table's band; choose a fundamental from {low:g} to {high:g} Hz"
        )
    axis_row(loop.controller.plant, axis)
    x = target.displacement[:, AXES.index(axis)]
    amplitude, largest = amplitude_at(x, frequency), float(np.abs(x).max())
    most = float(amplitude.max())
    if most == 0.0:
        raise SimulationError(
            f"--cancel {sine}: the motion has nothing at {frequency:g} Hz in {axis}; name its own axis"
        )
    little = "cancellers are for motions like a sine, and do little for this one"
    if most < _SINE_LIKE * largest:
        _log.warning(
            f"--cancel {sine}: at {frequency:g} Hz the motion has at most {100.0 * most / largest:.2g} % of its "
            f"largest displacement in {axis}; {little}"
        )
    elif (change := change_of_cycles(x, frequency)) > _REPEATS:
        _log.warning(
            f"--cancel {sine}: the motion does not repeat itself at {frequency:g} Hz (from one cycle to the next it "
            f"changes by {100.0 * change:.0f} % of its RMS displacement in {axis}); {little}"
        )
    count = min(int(numbers.harmonics), int(high / frequency))
    controller = with_cancellers(loop.controller, axis, frequency, count, numbers.time_constant)
    return loop._replace(
        controller=controller, drive=np.column_stack([loop.drive, target.acceleration, amplitude / most])
    )


def amplitude_at(x: Array, frequency: float) -> Array:
    """Amplitude (n,) of a signal at a frequency [Hz] over the cycle around each sample, in its unit."""
    turning = np.exp(-2j * np.pi * frequency / SAMPLE_RATE * np.arange(len(x)))
    cycle = max(1, round(SAMPLE_RATE / frequency))
    parts = [uniform_filter1d(part, cycle, mode="constant") for part in ((x * turning).real, (x * turning).imag)]
    return 2.0 * np.hypot(*parts)


def change_of_cycles(x: Array, frequency: float) -> float:
    """RMS difference of a signal and itself a cycle earlier, over its RMS, where the amplitude is above half of it.

    A steady sine of that frequency has 0, noise the square root of 2.
    """
    cycle = max(1, round(SAMPLE_RATE / frequency))
    amplitude = amplitude_at(x, frequency)
    strong = np.flatnonzero(amplitude[cycle:] > 0.5 * amplitude.max()) + cycle
    return float(np.linalg.norm(x[strong] - x[strong - cycle]) / np.linalg.norm(x[strong])) if len(strong) else math.inf
