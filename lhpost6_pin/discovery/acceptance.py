"""Weighing what is left: by how much a candidate lowers it, and whether that is enough to add it.

Screening is linear and takes what is left for noise of the power that it has now. What a candidate explains lowers that
power: here residuals are weighed anew, each band and column of a test as noise of its own power, so that what takes
much away counts for as much as it should.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..identification.calibration.problem import Problem
from ..identification.calibration.whitened_residuals import mean_squares, negative_log_likelihood
from ..machine.library import Family
from ..machine.parameters import Parameters
from .scores import Background, Score

__all__ = ["Lowered", "Reweighting", "gate", "refusal", "squares_by_column"]

Array = NDArray[np.float64]


class Lowered(NamedTuple):
    """By how much a candidate lowers what is left, with the refit that comes with it."""

    gain: float  # of log-likelihood and log-prior
    beyond: float  # of log-likelihood, by what even `doubt` times the stated noise would not have
    share: float  # of what is so far beyond noise in a column's means, or in what moves in it, where most is explained
    of_first: float  # in the column where this is most: of the squares that were there before any effect was added


class Reweighting:
    """Weighs what is left anew, with a candidate and without: large effects count for more than their linear gain."""

    def __init__(self, problem: Problem, background: Background, first: Array, numbers: Parameters) -> None:
        """`first` (c,) are the squares before any effect was added."""
        self.problem, self.background, self.first = problem, background, first
        self.doubt, self.much = numbers.number("accept.doubt"), numbers.number("accept.gain")
        self.before = self._left(background.alone, [np.zeros(len(r)) for r in background.residual])

    def _left(self, change: Array, explained: Sequence[Array]) -> tuple[Array, Array, float]:
        """What is left by a change (p,) of the background and what is explained (n,) of every test.

        Negative log-likelihood and squares (2, c); log-likelihood of what is no noise, of means and of what moves
        (2, c); that of the prior.
        """
        b, whole, beyond = self.background, np.zeros((2, self.first.size)), np.zeros((2, self.first.size))
        for slope, rest, root, more, f in zip(
            b.slope, b.residual, b.root, explained, self.problem.frequency, strict=True
        ):
            left = (rest + slope @ change + more) ** 2
            squares = 0.5 * (left[: root.size] + left[root.size :]).reshape(root.shape) * root**2
            means, counts = mean_squares(self.problem.whitener, squares, f)
            whole += negative_log_likelihood(means, counts), squares.sum(axis=0)
            more_than_noise = np.maximum(means / self.doubt, 1.0)
            first = int(f[0] == 0.0)  # the band of the means alone
            for k, part in enumerate((slice(0, first), slice(first, None))):
                beyond[k] += negative_log_likelihood(more_than_noise[part], counts[part]) - counts[part].sum()
        return whole, beyond, 0.5 * float(np.sum((b.place + change) ** 2))

    def lowered(self, explained: Sequence[Array], one: Score) -> Lowered:
        """How a candidate lowers what is left, explained (n,) of every test."""
        (before, doubted, prior), (after, still, then) = self.before, self._left(one.change, explained)
        fall, squares = before - after
        falls = fall > 0.5 * self.much
        of_first = float(np.max(squares[falls] / self.first[falls], initial=0.0))
        beyond = doubted - still
        most = np.unravel_index(np.argmax(beyond), beyond.shape)
        share = float(beyond[most] / doubted[most]) if doubted[most] > self.much else 1.0
        return Lowered(float(fall.sum()) + prior - then, float(beyond.sum()), share, of_first)


def squares_by_column(rest: Sequence[NDArray[np.complex128]]) -> Array:
    """Sums (c,) of squared whitened bins (m, c) over all tests."""
    return np.asarray(sum((np.abs(r) ** 2).sum(axis=0) for r in rest))


def gate(family: Family, numbers: Parameters) -> float:
    """Least gain of log-likelihood for a candidate of a family."""
    return numbers.number("accept.confusable" if family.confusable else "accept.gain")


def refusal(families: Sequence[Family], one: Score, less: Lowered, numbers: Parameters) -> str:
    """Why a candidate, or several together, may not be added; empty if they may be."""
    if one.gain < numbers.number("accept.look"):
        return "gains too little"
    if less.gain < sum(gate(family, numbers) for family in families):  # the noise in derivatives is all it has
        return "does not lower what is left"
    held = one.held_out
    if held.sum() < numbers.number("accept.held_out") * one.gain:
        return "does not hold on tests that it was not fitted on"
    chance = numbers.number("accept.chance")
    better = np.mean(held > -max(chance, numbers.number("accept.worse") * one.gain))
    worst = -max(2.0 * chance, numbers.number("accept.worst") * one.gain)
    if better < numbers.number("accept.better") or held.min() < worst:
        return "makes tests worse that it was not fitted on"
    if less.beyond < sum(gate(family, numbers) for family in families if family.confusable):
        return "explains what may be noise"
    if less.share < numbers.number("accept.closure"):
        return "explains too little of what is more than noise"
    if less.of_first < numbers.number("accept.of_first"):
        return "explains too little of what was there at first"
    return ""
