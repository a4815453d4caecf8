"""Programs that a panel runs: waves of a function generator, and motions, as functions of the program's own clock."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..core.arrays import Array
from ..core.errors import MotionError
from ..core.names import SAMPLE_RATE
from .moves import Moved

__all__ = ["WAVES", "Program", "Recorded", "Wave", "make_wave"]

WAVES = ("sine", "triangle", "sweep")
"""Waves of the function generator."""
_AT_ONCE = 1024  # times whose harmonics are evaluated together: a triangle may have hundreds


class Program(Protocol):
    """What is run: its name, its duration (None: until it is stopped) and its motion, six axes."""

    @property
    def name(self) -> str:
        """Name on the page."""
        ...

    @property
    def duration(self) -> float | None:
        """Duration on its own clock [s]; None if it goes on until it is stopped."""
        ...

    @property
    def by_span(self) -> bool:
        """Whether amplitudes are the spans of the axes; else there is one scale for all."""
        ...

    def at(self, time: Array) -> Moved:
        """Motion (n, 6) at times (n,) of its own clock, with its derivatives by it."""
        ...


@dataclass(frozen=True)
class Wave:
    """A wave of unit amplitude on some axes: the sum of sines, or a sweep in which the frequency grows by octaves."""

    name: str
    axes: tuple[int, ...]
    frequency: float  # [Hz]
    duration: float | None
    harmonics: tuple[tuple[int, float], ...] = ((1, 1.0),)  # order and amplitude
    to: float | None = None  # [Hz], of a sweep at its end

    by_span = True

    def at(self, time: Array) -> Moved:
        """See `Program`."""
        time = np.asarray(time, dtype=float)
        if self.to is not None and self.duration is not None:
            rise = math.log(self.to / self.frequency) / self.duration
            time = np.maximum(time, 0.0)
            speed = 2.0 * np.pi * self.frequency * np.exp(rise * time)
            phase, growth = (speed - 2.0 * np.pi * self.frequency) / rise, rise * speed
        else:
            speed = np.full(len(time), 2.0 * np.pi * self.frequency)
            phase, growth = speed * time, np.zeros(len(time))
        value, rate, acceleration = np.zeros((3, len(time)))
        order, amplitude = np.array(self.harmonics).T
        for part in (slice(k, k + _AT_ONCE) for k in range(0, len(time), _AT_ONCE)):
            angle = np.outer(phase[part], order)
            sine, cosine = np.sin(angle), np.cos(angle)
            slope = cosine @ (amplitude * order)
            value[part], rate[part] = sine @ amplitude, speed[part] * slope
            acceleration[part] = growth[part] * slope - speed[part] ** 2 * (sine @ (amplitude * order**2))
        moved = np.zeros((3, len(time), 6))
        moved[:, :, list(self.axes)] = np.stack([value, rate, acceleration])[:, :, None]
        return Moved(*moved)


@dataclass(frozen=True, eq=False)
class Recorded:
    """A motion that is sampled at the controller's rate, at rest at both ends."""

    name: str
    displacement: Array  # (n, 6), as the following
    velocity: Array
    acceleration: Array

    by_span = False

    @property
    def duration(self) -> float:
        """See `Program`."""
        return (len(self.displacement) - 1) / SAMPLE_RATE

    def at(self, time: Array) -> Moved:
        """See `Program`; between samples the displacement is the polynomial of both ends' motions."""
        place = np.clip(np.asarray(time, dtype=float) * SAMPLE_RATE, 0.0, len(self.displacement) - 1.0)
        index = np.minimum(place.astype(int), len(self.displacement) - 2)
        x = (place - index)[:, None]
        step = 1.0 / SAMPLE_RATE
        rows = self.displacement, self.velocity, self.acceleration
        (d0, d1), (v0, v1), (a0, a1) = ((row[index], row[index + 1]) for row in rows)
        smooth = x * x * (3.0 - 2.0 * x)
        value = d0 + smooth * (d1 - d0) + step * x * (1.0 - x) * ((1.0 - x) * v0 - x * v1)
        return Moved(value, v0 + x * (v1 - v0), a0 + x * (a1 - a0))


def make_wave(
    wave: str,
    *,
    axes: tuple[int, ...],
    frequency: float,
    highest: float,
    reversal: float,
    cycles: float | None = None,
    to: float | None = None,
    duration: float | None = None,
) -> Wave:
    """Wave of the function generator; `cycles` of it (None: until stopped), for a sweep `to` and `duration`.

    Frequencies are at most `highest` [Hz]. A triangle turns round with the acceleration of half a sine in the share
    `reversal` of its period [1], as `motions.triangle` does, and has its odd harmonics up to `highest`. Raises
    MotionError for what cannot be.
    """
    if wave not in WAVES:
        raise MotionError(f"no wave named {wave!r}; choose {', '.join(WAVES)}")
    if not axes:
        raise MotionError("the function generator needs an axis; choose one or more")
    for what, value in (("frequency", frequency), ("last frequency", to)):
        if value is not None and not 0.0 < value <= highest:
            raise MotionError(f"a {what} of {value:g} Hz; give one above 0 and up to {highest:g} Hz")
    for what, value in (("number of cycles", cycles), ("duration", duration)):
        if value is not None and not 0.0 < value < math.inf:
            raise MotionError(f"a {what} of {value:g}; give a number above 0")
    if wave == "sweep":
        if to is None or duration is None or to == frequency:
            raise MotionError("a sweep goes from one frequency to another in a time; give all three")
        return Wave(f"sweep {frequency:g} to {to:g} Hz", axes, frequency, duration, to=to)
    harmonics: tuple[tuple[int, float], ...] = ((1, 1.0),)
    if wave == "triangle":
        harmonics = _triangle(int(highest / frequency), reversal)
    return Wave(f"{wave} {frequency:g} Hz", axes, frequency, None if cycles is None else cycles / frequency, harmonics)


def _triangle(most: int, reversal: float) -> tuple[tuple[int, float], ...]:
    """Odd harmonics up to the order `most` of a triangle convolved with half a sine; its peak is one."""
    orders = range(1, most + 1, 2)
    signs = [(-1) ** (n // 2) for n in orders]
    sizes = [_half_sine(n * reversal) / n**2 for n in orders]
    return tuple((n, sign * size / sum(sizes)) for n, sign, size in zip(orders, signs, sizes, strict=True))


def _half_sine(x: float) -> float:
    """Fourier transform of half a period of a sine of unit area, at its duration times the frequency."""
    left = 1.0 - 4.0 * x * x
    return 0.25 * math.pi if abs(left) < 1e-9 else math.cos(math.pi * x) / left
