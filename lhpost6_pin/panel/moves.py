"""Smooth moves to rest: polynomials of fifth order from any motion, so that a move may begin within another."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array

__all__ = ["Move", "Moved", "at_rest", "move_to"]


class Moved(NamedTuple):
    """Values (n, k) of a move with first and second derivatives by time."""

    value: Array
    rate: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class Move:
    """Values (k,) that go from one motion to rest: at rest at its target from `begin` + `seconds` on."""

    begin: float  # [s]
    seconds: float
    powers: Array  # (6, k) coefficients of the time since the beginning over `seconds`
    target: Array  # (k,)

    def at(self, time: Array) -> Moved:
        """The move at times (n,) [s], not before its beginning."""
        x = np.clip((np.asarray(time) - self.begin) / self.seconds, 0.0, 1.0)[:, None]
        if x.size and x.min() >= 1.0:  # as the last line but one would give it, in a fifth of the time
            return Moved(np.tile(self.target, (len(x), 1)), *np.zeros((2, len(x), len(self.target))))
        order = np.arange(6)
        first, second = order[1:], order[2:]
        value = x**order @ self.powers
        rate = (first * x ** (first - 1)) @ self.powers[1:] / self.seconds
        acceleration = (second * (second - 1) * x ** (second - 2)) @ self.powers[2:] / self.seconds**2
        done = (x >= 1.0)[:, 0]
        value[done], rate[done], acceleration[done] = self.target, 0.0, 0.0
        return Moved(value, rate, acceleration)

    def ended(self, time: float) -> bool:
        """Whether the target is reached."""
        return time >= self.begin + self.seconds


def move_to(target: Array, time: float, seconds: float, start: Moved) -> Move:
    """Move from the motion `start` (k,) each at a time [s] to rest at `target` (k,) after `seconds`."""
    value, rate, acceleration = (np.asarray(x, dtype=float) for x in start)
    target = np.asarray(target, dtype=float)
    v, a = rate * seconds, 0.5 * acceleration * seconds**2
    gap = target - value - v - a  # what the powers three to five have to add up to, with their derivatives
    slope, bend = -v - 2.0 * a, -2.0 * a
    third = 10.0 * gap - 4.0 * slope + 0.5 * bend
    fourth = -15.0 * gap + 7.0 * slope - bend
    fifth = 6.0 * gap - 3.0 * slope + 0.5 * bend
    return Move(time, seconds, np.array([value, v, a, third, fourth, fifth]), target)


def at_rest(value: Array, time: float = 0.0) -> Move:
    """Values (k,) that rest."""
    value = np.asarray(value, dtype=float)
    return Move(time - 1.0, 1.0, np.vstack([value, np.zeros((5, len(value)))]), value)
