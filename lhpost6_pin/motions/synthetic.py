"""Motions made from a few numbers: triangular waves, sines, white noise, and a six-axial synthetic."""

from collections.abc import Sequence

import numpy as np

from ..core.errors import MotionError
from .motion import AXES, GroundMotion, make_motion
from .process import smooth_step

__all__ = ["sine", "six_axial", "triangle", "white_noise"]


def triangle(
    *,
    name: str,
    axis: str,
    amplitude: float,
    velocity: float,
    corner_acceleration: float,
    cycles: int,
    time_step: float,
) -> GroundMotion:
    """Triangular displacement wave of one axis: constant `velocity` [m/s] between peaks of `amplitude` [m].

    In the corners the velocity follows half a cosine, so the acceleration is half a sine wave of peak
    `corner_acceleration` [m/s^2]: a reversal lasts pi v / a, the start and the stop half as long. The peaks
    of the displacement are the amplitude. Rotations take rad, rad/s, rad/s^2.

    Raises MotionError for cycles that are not whole or corners that leave no straight part.
    """
    if not (cycles >= 1 and cycles == int(cycles)):
        raise MotionError(f"{name}: option cycles is {cycles}; give a whole number, one or more")
    reversal = np.pi * velocity / corner_acceleration
    straight = 2 * (amplitude - velocity * reversal / np.pi) / velocity  # from peak to opposite peak
    first = straight / 2 - reversal / 4  # the start takes v T/2 over its T = reversal/2
    if not (min(amplitude, velocity, corner_acceleration) > 0 and first > 0):
        raise MotionError(
            f"{name}: {amplitude} at {velocity} per second leaves no straight part between corners of "
            f"{corner_acceleration} per second squared; give a larger amplitude or corner_acceleration"
        )
    parts = [(reversal / 2, 0.0, velocity), (first, velocity, velocity)]
    sign = 1.0
    for i in range(2 * int(cycles)):
        parts.append((reversal, sign * velocity, -sign * velocity))
        sign = -sign
        last = i == 2 * int(cycles) - 1
        parts.append((first if last else straight, sign * velocity, sign * velocity))
    parts.append((reversal / 2, sign * velocity, 0.0))
    displacement = _ramps(parts, time_step)
    return make_motion(name, time_step, {axis: displacement}, "displacement", "triangular wave")


def sine(
    *,
    name: str,
    axis: str,
    amplitude: float,
    period: float,
    cycles: float,
    ramp_cycles: float,
    time_step: float,
) -> GroundMotion:
    """Sine of `amplitude` [m, rad] and `period` [s] on one axis: `cycles` at full amplitude between ramps."""
    if not (period > 0 and cycles > 0 and ramp_cycles > 0):
        raise MotionError(f"{name}: period, cycles and ramp_cycles must be positive")
    duration = (cycles + 2 * ramp_cycles) * period
    time = np.arange(round(duration / time_step) + 1) * time_step
    envelope = (
        smooth_step(time / (ramp_cycles * period))[0] * smooth_step((duration - time) / (ramp_cycles * period))[0]
    )
    displacement = amplitude * envelope * np.sin(2 * np.pi * time / period)
    return make_motion(name, time_step, {axis: displacement}, "displacement", "sine wave")


def white_noise(
    *,
    name: str,
    rms: float,
    rotation_rms: float,
    low: float,
    high: float,
    duration: float,
    ramp: float,
    time_step: float,
    six_axis: bool,
    seed: int,
) -> GroundMotion:
    """Gaussian acceleration with a flat spectrum from `low` to `high` [Hz], independent on each axis.

    `rms` [m/s^2] (and `rotation_rms` [rad/s^2] where `six_axis`) holds between the ramps of `ramp` [s].
    """
    if not 0 < low < high < 0.5 / time_step or not duration > 2 * ramp > 0:
        raise MotionError(
            f"{name}: band {low} to {high} Hz, {duration} s with ramps of {ramp} s; need 0 < low < high < "
            f"{0.5 / time_step:g} Hz and a duration beyond the ramps"
        )
    generator = np.random.default_rng(seed)
    time = np.arange(round(duration / time_step) + 1) * time_step
    envelope = smooth_step(time / ramp)[0] * smooth_step((duration - time) / ramp)[0]
    frequency = np.fft.rfftfreq(len(time), time_step)
    band = (frequency >= low) & (frequency <= high)
    channels = {}
    for axis in AXES if six_axis else AXES[:3]:
        noise = np.fft.irfft(np.where(band, np.fft.rfft(generator.standard_normal(len(time))), 0), len(time))
        level = np.sqrt(np.mean(noise[envelope == 1] ** 2))
        channels[axis] = (rms if axis in "xyz" else rotation_rms) / level * envelope * noise
    return make_motion(name, time_step, channels, "acceleration", f"white noise {low:g} to {high:g} Hz, seed {seed}")


def six_axial(
    *,
    name: str,
    peak_displacement: Sequence[float],
    peak_velocity: Sequence[float],
    peak_acceleration: Sequence[float],
    peak_rotation: Sequence[float],
    peak_rotation_velocity: Sequence[float],
    peak_rotation_acceleration: Sequence[float],
    duration: float,
    time_step: float,
    seed: int,
) -> GroundMotion:
    """Six independent displacement channels with given peaks of displacement, velocity and acceleration.

    Each channel is a sum of three wavelets, cosines under a Gaussian, about the frequencies that the peaks
    imply (v/d and a/v); their amplitudes are solved so that all three peaks hold, their phases and arrivals
    drawn with `seed`. Raises MotionError for peaks that no such sum has (v^2 may hardly exceed d a).
    """
    generator = np.random.default_rng(seed)
    time = np.arange(round(duration / time_step) + 1) * time_step
    peaks = np.concatenate(
        [
            np.array([peak_displacement, peak_velocity, peak_acceleration]).T,
            np.array([peak_rotation, peak_rotation_velocity, peak_rotation_acceleration]).T,
        ]
    )  # (6, 3)
    channels = {
        axis: _with_peaks(time, row, generator, f"{name}, axis {axis}") for axis, row in zip(AXES, peaks, strict=True)
    }
    return make_motion(name, time_step, channels, "displacement", f"six-axial synthetic, seed {seed}")


def _with_peaks(time: np.ndarray, peaks: np.ndarray, generator: np.random.Generator, where: str) -> np.ndarray:
    """Displacement (n,) with the given peaks (3,) of displacement, velocity and acceleration."""
    from scipy.optimize import least_squares

    displacement, velocity, acceleration = peaks
    slow, fast = velocity / displacement, acceleration / velocity  # [rad/s]
    for _attempt in range(20):
        waves = np.stack(
            [_wavelet(time, angular, generator) for angular in (0.8 * slow, np.sqrt(slow * fast), 1.25 * fast)],
            axis=-1,
        )  # (3 derivatives, n, 3 wavelets)

        def misfit(logs: np.ndarray, waves: np.ndarray = waves) -> np.ndarray:
            return np.log(np.abs(waves @ np.exp(logs)).max(axis=1) / peaks)

        start = np.log([displacement / 2, velocity / np.sqrt(slow * fast) / 2, acceleration / fast**2 / 2])
        found = least_squares(misfit, start, xtol=1e-12, ftol=1e-12)
        if np.abs(found.fun).max() < 1e-6:
            tail = time[-1] / 20  # led to rest: a step of the wavelets' tails would be a spike of acceleration
            return waves[0] @ np.exp(found.x) * smooth_step(time / tail)[0] * smooth_step(time[::-1] / tail)[0]
    raise MotionError(f"{where}: no motion found with peaks {peaks}; peak velocity is too large or too small for them")


def _wavelet(time: np.ndarray, angular: float, generator: np.random.Generator) -> np.ndarray:
    """Return a unit wavelet and its two derivatives (3, n): Re of exp(-(t/s)^2/2 + i w t + i phase)."""
    spread = 2.5 / angular
    middle = time[-1] / 2 + min(spread, time[-1] / 10) * generator.uniform(-1, 1)
    s = time - middle
    phase = generator.uniform(0, 2 * np.pi)
    wave = np.exp(-0.5 * (s / spread) ** 2 + 1j * (angular * s + phase))
    slope = -s / spread**2 + 1j * angular
    return np.stack([wave.real, (slope * wave).real, ((slope**2 - 1 / spread**2) * wave).real])


def _ramps(parts: "list[tuple[float, float, float]]", time_step: float) -> np.ndarray:
    """Displacement (n,) of velocity ramps (duration, first, last velocity), each half a cosine."""
    durations, before, after = np.array(parts).T
    mean, half = (before + after) / 2, (before - after) / 2
    ends = np.cumsum(durations)
    starts = ends - durations
    reached = np.concatenate([[0.0], np.cumsum(mean * durations)])
    time = np.arange(round(ends[-1] / time_step) + 1) * time_step
    part = np.minimum(np.searchsorted(ends, time, side="right"), len(parts) - 1)
    inside = np.minimum(time - starts[part], durations[part])
    curve = half[part] * durations[part] / np.pi * np.sin(np.pi * inside / durations[part])
    return reached[part] + mean[part] * inside + curve
