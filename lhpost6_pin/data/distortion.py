"""Harmonics of a sine test: amplitudes and phases, total harmonic distortion, lag behind the reference."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core.arrays import Array

__all__ = ["Harmonics", "harmonics", "phase_between", "total_distortion", "total_harmonic_distortion"]


class Harmonics(NamedTuple):
    """Fundamental and harmonics of a periodic signal, c + sum amplitude cos(2 pi frequency t + phase).

    t = 0 is the first sample of the record, so phases of signals recorded together compare.
    """

    frequency: Array  # (count,) [Hz], multiples of the fundamental
    amplitude: Array  # (count,) [unit of the signal]
    phase: Array  # (count,) [rad], in (-pi, pi]


def harmonics(signal: ArrayLike, rate: float, fundamental: float, count: int) -> Harmonics:
    """First `count` harmonics, the fundamental included, over the longest whole number of last periods.

    Least squares of sines, cosines and a constant: exact for a sum of these whether or not a period is a
    whole number of samples.

    Parameters: `signal` (n,), `rate` and `fundamental` [Hz]. Raises `ValueError` for a record shorter than one
    period, a sample that is not finite, or a highest harmonic that is not below half the rate.
    """
    x = np.asarray(signal, dtype=float)
    if x.ndim != 1 or not np.isfinite(x).all():
        raise ValueError("the signal must be one column of finite samples")
    if not (fundamental > 0 and count >= 1 and 2 * count * fundamental < rate):
        raise ValueError(f"{count} harmonics of {fundamental:g} Hz do not lie between 0 and {rate / 2:g} Hz")
    used = _whole_periods(len(x), rate, fundamental)
    if used == 0:
        raise ValueError(f"{len(x) / rate:g} s are less than one period of {fundamental:g} Hz")
    frequency = np.linspace(fundamental, count * fundamental, count)
    angle = 2 * np.pi * np.multiply.outer(np.arange(len(x) - used, len(x)) / rate, frequency)
    waves = np.hstack([np.cos(angle), np.sin(angle), np.ones((used, 1))])
    weights = np.linalg.lstsq(waves, x[-used:], rcond=None)[0]
    cosine, sine = weights[:count], weights[count : 2 * count]
    return Harmonics(frequency, np.hypot(cosine, sine), np.arctan2(-sine, cosine))


def _whole_periods(samples: int, rate: float, fundamental: float) -> int:
    """Samples of the longest whole number of periods, rounded up: more than the unknowns of as many harmonics."""
    periods = int(samples * fundamental / rate + 1e-9)
    return min(samples, int(np.ceil(periods * rate / fundamental - 1e-6))) if periods else 0


def total_harmonic_distortion(h: Harmonics) -> float:
    """Amplitude of all harmonics together over that of the fundamental [1]; NaN without one, or without harmonics."""
    first, *rest = h.amplitude
    return float(np.linalg.norm(rest) / first) if first > 0 and rest else float("nan")


def total_distortion(signal: ArrayLike, rate: float, fundamental: float) -> float:
    """RMS of all but the fundamental over that of the fundamental [1], at all frequencies; NaN without a fundamental.

    Over the longest whole number of last periods of `signal` (n,), as `harmonics`, whose errors it raises.
    """
    x, first = np.asarray(signal, dtype=float), harmonics(signal, rate, fundamental, 1)
    used = _whole_periods(len(x), rate, fundamental)
    time = np.arange(len(x) - used, len(x)) / rate
    rest = x[-used:] - first.amplitude[0] * np.cos(2 * np.pi * fundamental * time + first.phase[0])
    size = float(first.amplitude[0])
    return float(np.sqrt(2.0) * rest.std() / size) if size > 0 else float("nan")


def phase_between(reference: Harmonics, signal: Harmonics) -> float:
    """Phase of the signal's fundamental less the reference's [rad], in (-pi, pi]; negative where it is late."""
    difference = signal.phase[0] - reference.phase[0]
    return float(np.pi - np.mod(np.pi - difference, 2 * np.pi))
