"""The reference of a driven table: setpoint plus span times program, each of which moves smoothly.

    x(t) = S(t) + G(t) P(tau(t))

S is the setpoint, G the spans (or the scale of a motion), P the program and tau its clock, whose rate goes from zero to
one and back. Velocity and acceleration follow by the product and chain rules.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.names import SAMPLE_RATE
from ..machine.parameters import Parameters
from .moves import Move, Moved, at_rest, move_to
from .programs import Program

__all__ = ["Drive", "DriveState"]

_PEAK = 1.875  # peak over mean velocity of a move from rest to rest


class DriveState(NamedTuple):
    """What runs: state and time of the program, and whether the setpoint is reached."""

    program: str | None
    state: str  # stopped, running, holding or stopping
    time: float  # on the program's clock [s]
    duration: float | None
    settled: bool


class Drive:
    """Reference of a table that is driven by hand, sample after sample.

    Attributes: setpoint, span (6,) and scale, that are wanted; program.
    """

    def __init__(self, numbers: Parameters, speed: Array, start: Array) -> None:
        """Rest at `start` (6,) [m, rad]; `speed` (6,): velocity limits of the axes, infinite for a locked one."""
        self._numbers, self._speed = numbers, speed * numbers.number("setpoint.speed")
        self.span, self.scale = np.zeros(6), 1.0
        self.program: Program | None = None
        self._clock = 0.0
        self._gain, self._rate = at_rest(np.zeros(6)), at_rest(np.zeros(1))
        self._stopping = False
        self.setpoint = np.array(start, dtype=float)
        self._place = at_rest(self.setpoint)

    def state(self, sample: int) -> DriveState:
        """State at a sample."""
        time, program = sample / SAMPLE_RATE, self.program
        settled = self._place.ended(time)
        if program is None:
            return DriveState(None, "stopped", 0.0, None, settled)
        still, wanted = self._rate.ended(time), bool(self._rate.target[0])
        word = "stopping" if self._stopping else "running" if wanted else "holding"
        started = self._clock > 0.0 or wanted or not still
        return DriveState(program.name, word if started else "stopped", self._clock, program.duration, settled)

    # ------------------------------------------------------------------------------------- what a driver does
    def move_setpoint(self, setpoint: Array, sample: int) -> None:
        """Go to a setpoint (6,), no faster than the share of the velocity limits that is stated."""
        self.setpoint = np.array(setpoint, dtype=float)
        self._approach(self._now(self._place, sample), sample)

    def _approach(self, now: Moved, sample: int) -> None:
        """Move to the setpoint from the motion `now` (6,) each."""
        seconds = self._seconds(np.abs(self.setpoint - now.value))
        self._place = move_to(self.setpoint, sample / SAMPLE_RATE, seconds, now)

    def _seconds(self, way: Array) -> float:
        """Duration of a move over ways (6,) from rest to rest."""
        with np.errstate(divide="ignore", invalid="ignore"):
            seconds = np.nan_to_num(_PEAK * way / self._speed, posinf=0.0).max()
        return max(float(seconds), self._numbers.number("setpoint.shortest"))

    def approach_velocity(self, setpoint: Array, place: Array) -> Array:
        """Peak velocity (6,) [m/s, rad/s] of a move to a setpoint (6,) from rest at a place (6,) [m, rad]."""
        way = np.abs(setpoint - place)
        return _PEAK * way / self._seconds(way)

    def set_span(self, span: Array, sample: int) -> None:
        """Take new spans (6,) of the axes."""
        self.span = np.array(span, dtype=float)
        if self.program is not None and self.program.by_span:
            self._move_gain(self.span, sample)

    def set_scale(self, scale: float, sample: int) -> None:
        """Take a new scale of a motion."""
        self.scale = scale
        if self.program is not None and not self.program.by_span:
            self._move_gain(np.full(6, scale), sample)

    def load(self, program: Program | None, scale: float | None = None) -> None:
        """Take a program in place of another, which must be stopped, at a scale if it has one; None: no program."""
        self.program, self._clock, self._stopping = program, 0.0, False
        before = 1.0 if program is not None and program.by_span else self.scale  # a motion's is not that of a wave
        self.scale = before if scale is None else scale
        self._rate = at_rest(np.zeros(1))
        if program is None:
            return
        self._gain = at_rest(self.span if program.by_span else np.full(6, self.scale))

    def run(self, sample: int) -> None:
        """Start the program, or go on after a hold."""
        self._stopping = False
        self._move_rate(1.0, sample)

    def hold(self, sample: int) -> None:
        """Bring the program's clock to rest."""
        self._move_rate(0.0, sample)

    def stop(self, sample: int) -> None:
        """Bring the program's clock to rest, then end the program and return to the setpoint."""
        self._stopping = True
        self._move_rate(0.0, sample)

    def take_over(self, place: Array, sample: int) -> None:
        """Rest at a place (6,) without a program, as after a trip."""
        self._end_program()
        self._place = at_rest(place, sample / SAMPLE_RATE)

    # ------------------------------------------------------------------------------------- samples
    def advance(self, sample: int, count: int) -> Moved:
        """Reference (count, 6) of the samples from `sample` on; the program's clock goes on by as many."""
        time = (sample + np.arange(count)) / SAMPLE_RATE
        place = self._place.at(time)
        if self.program is None:
            return place
        rate = self._rate.at(np.append(time, time[-1] + 1.0 / SAMPLE_RATE))
        speed = rate.value[:, 0]
        clock = self._clock + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) / SAMPLE_RATE
        p, g = self.program.at(clock[:-1]), self._gain.at(time)
        r, r1 = rate.value[:-1], rate.rate[:-1]
        v, a = r * p.rate, r**2 * p.acceleration + r1 * p.rate
        found = Moved(
            place.value + g.value * p.value,
            place.rate + g.rate * p.value + g.value * v,
            place.acceleration + g.acceleration * p.value + 2.0 * g.rate * v + g.value * a,
        )
        self._clock = float(clock[-1])
        self._finish(sample + count)
        return found

    def _finish(self, sample: int) -> None:
        """End a program that came to its end, or to rest after a stop."""
        program, time = self.program, sample / SAMPLE_RATE
        if program is None:
            return
        if program.duration is not None and self._clock >= program.duration and not self._stopping:
            if program.by_span:  # a wave that is to end where it moves
                self.stop(sample)
            else:
                self._end_program()
        elif self._stopping and self._rate.ended(time):
            left = self._gain.at(np.array([time])).value[0] * program.at(np.array([self._clock])).value[0]
            now = self._now(self._place, sample)
            self._end_program()
            self._approach(now._replace(value=now.value + left), sample)

    def _end_program(self) -> None:
        self._clock, self._stopping = 0.0, False
        self._rate = at_rest(np.zeros(1))

    def _move_gain(self, target: Array, sample: int) -> None:
        seconds = self._numbers.number("span.time")
        self._gain = move_to(target, sample / SAMPLE_RATE, seconds, self._now(self._gain, sample))

    def _move_rate(self, target: float, sample: int) -> None:
        seconds = self._numbers.number("program.start")
        start = self._now(self._rate, sample)
        self._rate = move_to(np.array([target]), sample / SAMPLE_RATE, seconds, start)

    @staticmethod
    def _now(move: Move, sample: int) -> Moved:
        return Moved(*(x[0] for x in move.at(np.array([sample / SAMPLE_RATE]))))
