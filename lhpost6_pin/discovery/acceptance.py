"""Acceptance of candidates: by how much one lowers the residual, and whether that is enough to add it.

Screening is linear and weighs the residual by its present power. A candidate lowers that power: here the residual is
reweighted, each band and column of a test by its own remaining power, so that large effects count in full.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array, Complex, Mask
from ..identification.calibration.bin_rows import squares_of
from ..identification.calibration.problem import Problem
from ..identification.calibration.whitened_residuals import mean_squares, negative_log_likelihood
from ..identification.residuals import kinds_shown
from ..machine.library import Family
from ..machine.parameters import Parameters
from .scores import Background, Score
from .search_state import Search

__all__ = ["Lowered", "Reweighting", "form_share", "gate", "refusal", "share_explained"]
__all__ += ["rows_shown", "squares_by_column"]


class Lowered(NamedTuple):
    """By how much a candidate lowers the residual, with the refit that comes with it."""

    gain: float  # of log-likelihood and log-prior
    beyond: float  # of log-likelihood, beyond `doubt` times the stated noise
    share: float  # explained of the excess over noise, in the column (its means or its variation) explained best
    of_first: float  # explained of the squares before any effect was added, in the column where this is most


class Reweighting:
    """Log-likelihood of the residual with and without a candidate, each weighed by its own power."""

    def __init__(self, found: Search, background: Background) -> None:
        """Of a search, about the solution of `background`."""
        self.problem, self.background = found.refit.normal.problem, background
        self.first = squares_by_column(found.refit.normal.residual)
        self.doubt, self.much = found.numbers.number("accept.doubt"), found.numbers.number("accept.gain")
        self.before = self._terms(background.still[1], [np.zeros_like(r) for r in background.residual])

    def _terms(self, change: Array, explained: Sequence[Array]) -> tuple[Array, Array, float]:
        """Terms of the objective for a change (p,) of the background and an explained part (c, 2 m) of every test.

        Negative log-likelihood and squares (2, c); log-likelihood beyond noise, of means and of variation (2, c); and
        the prior's.
        """
        b, whole, beyond = self.background, np.zeros((2, self.first.size)), np.zeros((2, self.first.size))
        tests = zip(b.slope, b.residual, b.root, explained, self.problem.frequency, strict=True)
        for slope, residual, root, more, f in tests:
            squares = squares_of(residual + slope.times(change) + more) * root**2
            means, counts = mean_squares(self.problem.whitener, squares, f)
            whole += negative_log_likelihood(means, counts), squares.sum(axis=0)
            beyond += _beyond_noise(means, counts, f, self.doubt)
        return whole, beyond, 0.5 * float(np.sum((b.place + change) ** 2))

    def lowered(self, explained: Sequence[Array], one: Score) -> Lowered:
        """How a candidate lowers the residual, explained (c, 2 m) of every test."""
        (before, doubted, prior), (after, remaining, then) = self.before, self._terms(one.change, explained)
        fall, squares = before - after
        falls = fall > 0.5 * self.much
        of_first = float(np.max(squares[falls] / self.first[falls], initial=0.0))
        beyond = doubted - remaining
        most = np.unravel_index(np.argmax(beyond), beyond.shape)
        share = float(beyond[most] / doubted[most]) if doubted[most] > self.much else 1.0
        return Lowered(float(fall.sum()) + prior - then, float(beyond.sum()), share, of_first)


def _beyond_noise(means: Array, counts: NDArray[np.intp], f: Array, doubt: float) -> Array:
    """Log-likelihood (2, c), of means and of variation, of a test's `mean_squares` beyond `doubt` times noise."""
    excess, first = np.maximum(means / doubt, 1.0), int(f[0] == 0.0)  # the band of the means alone
    parts = (slice(0, first), slice(first, None))
    return np.array([negative_log_likelihood(excess[p], counts[p]) - counts[p].sum() for p in parts])


def share_explained(
    problem: Problem, before: Sequence[Complex], after: Sequence[Complex], family: Family, numbers: Parameters
) -> float:
    """Share of the log-likelihood beyond noise that is explained, in the column where it is most.

    Of residuals of a problem's tests, whitened bins (m, c), before and after a joint fit, in the columns that a family
    shows in; nan where hardly anything is beyond noise.
    """
    doubt, rows = numbers.number("accept.doubt"), rows_shown(problem, family)

    def beyond(residual: Sequence[Complex]) -> Array:
        pairs = zip(residual, problem.frequency, strict=True)
        means = ((mean_squares(problem.whitener, np.abs(bins) ** 2, f), f) for bins, f in pairs)
        return np.asarray(sum(_beyond_noise(*m, f, doubt) for m, f in means))[:, rows]

    old, new = beyond(before), beyond(after)
    most = np.unravel_index(np.argmax(old - new), old.shape)
    return float((old - new)[most] / old[most]) if old[most] > numbers.number("accept.gain") else np.nan


def rows_shown(problem: Problem, family: Family) -> Mask:
    """Mask (c,) of the residuals' columns in which a family shows, with the channels of the tests."""
    kinds = kinds_shown(family.shows_in, problem.tests[0].channels)
    return np.asarray(np.any([problem.rows(kind) for kind in kinds if kind in problem.kinds], axis=0))


def squares_by_column(residual: Sequence[Complex]) -> Array:
    """Sums (c,) of squared whitened bins (m, c) over all tests."""
    return np.asarray(sum((np.abs(r) ** 2).sum(axis=0) for r in residual))


def gate(family: Family, numbers: Parameters) -> float:
    """Least gain of log-likelihood for a candidate of a family."""
    return numbers.number("accept.confusable" if family.confusable else "accept.gain")


def form_share(family: Family, numbers: Parameters) -> float:
    """Share of what an effect explains up to which the residual is attributed to its form."""
    form = "rest_friction" if family.confusable else "rest_elastic" if family.elastic else "rest"
    return numbers.number(f"verdict.{form}")


def refusal(
    families: Sequence[Family], one: Score, less: Lowered, numbers: Parameters, *, absorbed: bool = False
) -> str:
    """Why a candidate, or several together, may not be added; empty if they may be.

    Where parameters that run to their bounds have `absorbed` a part of it, what is left need not be beyond noise, nor
    a share of the initial residual.
    """
    n = numbers.number
    if one.gain < n("accept.look"):
        return "gain below the threshold"
    if less.gain < sum(gate(family, numbers) for family in families):  # noise in derivatives accounts for it
        return "does not lower the residual"
    held = one.held_out
    if held.sum() < n("accept.held_out") * one.gain:
        return "no gain in cross-validation"
    chance = n("accept.chance")
    better = np.mean(held > -max(chance, n("accept.worse") * one.gain))
    if better < n("accept.better") or held.min() < -max(2.0 * chance, n("accept.worst") * one.gain):
        return "fails cross-validation"
    if absorbed:
        return ""
    if less.beyond < sum(gate(family, numbers) for family in families if family.confusable):
        return "within the uncertainty of the expected scatter"
    if less.share < n("accept.closure"):
        return "explains too little of the residual beyond the expected scatter"
    if less.of_first < n("accept.of_first"):
        return "explains too little of the initial residual"
    return ""
