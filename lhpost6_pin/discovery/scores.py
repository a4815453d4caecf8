"""Scores of candidates: the gain of each, with all parameters and sensor errors refitted, to first order.

The background are the derivatives of the residuals by parameters, sensor errors and the scatter of identical
components. The gain is the log-likelihood that a candidate adds to a refit without it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import lsq_linear

from ..core.arrays import Array, Mask
from ..identification.calibration.bin_rows import BinRows, over

__all__ = ["Background", "Block", "Columns", "Score", "block_of", "less_noise", "make_block", "score"]

Columns = Sequence[BinRows]
"""Derivatives by k amplitudes of every test."""

WORTH = 0.5
"""Log-likelihood below which further steps are skipped."""


@dataclass(frozen=True)
class Block:
    """Normal equations of a candidate's amplitudes with themselves and with the background, by test."""

    cross: Array  # (t, p, q)
    own: Array  # (t, q, q)
    side: Array  # (t, q)

    def select(self, parts: Array) -> "Block":
        """Block of amplitudes that are sums of these, parts (k, q)."""
        return Block(self.cross @ parts, parts.T @ self.own @ parts, self.side @ parts)


@dataclass(frozen=True)
class Background:
    """Normal equations of all that is refitted in every comparison, by test; x in units of the priors.

    Rows are over the roots of the remaining power.
    """

    slope: Sequence[BinRows]  # of every test
    residual: Sequence[Array]  # (c, 2 m)
    root: Sequence[Array]  # (m, c) roots of power
    matrix: Array  # (t, p, p)
    side: Array  # (t, p)
    place: Array  # (p,) of the solution, in units of the priors
    inward: Array  # (p,) direction in which an unknown at its bound may move, +1 or -1; else zero
    noise: Sequence[tuple[Sequence[BinRows], Sequence[Array]]] = ()  # by replica, test: changes of slope, of rest

    @property
    def free(self) -> Array:
        """One, or zero at a bound (p,)."""
        return (self.inward == 0.0).astype(float)

    @cached_property
    def summed(self) -> list["_Summed"]:
        """Its equations with the priors: of all tests, then without each."""
        found, both, bound = [], np.outer(self.free, self.free), self.inward != 0.0
        for without in range(-1, len(self.matrix)):
            keep = np.arange(len(self.matrix)) != without
            matrix, side = self.matrix[keep].sum(axis=0), self.side[keep].sum(axis=0) + self.place
            factor = cho_factor(matrix * both + np.eye(len(self.place)))
            cross = matrix[:, bound] * self.free[:, None]
            through = cho_solve(factor, cross)
            own = matrix[np.ix_(bound, bound)] - cross.T @ through + np.eye(int(bound.sum()))
            found.append(_Summed(keep, factor, side * self.free, side[bound], cross, through, own))
        return found

    @cached_property
    def still(self) -> tuple[Array, Array]:
        """Without a candidate: gain of the unknowns at a bound, of all tests and without each (1 + t,); change (p,)."""
        tests, p, none = len(self.matrix), len(self.place), np.zeros(0)
        empty = Block(np.zeros((tests, p, 0)), np.zeros((tests, 0, 0)), np.zeros((tests, 0)))
        profiles = [_Profile(self, empty, none, without) for without in range(-1, tests)]
        best = [one.best(none, none) for one in profiles]
        gains = np.array([one.gain(theta) for one, theta in zip(profiles, best, strict=True)])
        return gains, profiles[0].change(best[0])

    def explained(self, columns: Columns, amplitude: Array) -> list[Array]:
        """Row (c, 2 m) of every test that columns explain with amplitudes (k,)."""
        return [c.times(amplitude) * over(root) for c, root in zip(columns, self.root, strict=True)]


def make_block(background: Background, columns: Columns) -> Block:
    """Block of columns by test."""
    cross, own, side = [], [], []
    for slope, rest, root, column in zip(background.slope, background.residual, background.root, columns, strict=True):
        c = column.weighed(root)
        cross.append(slope.products(c))
        own.append(c.squares())
        side.append(c.dot(rest))
    return Block(np.array(cross), np.array(own), np.array(side))


def block_of(background: Background, place: int) -> Block:
    """Block of one unknown of the background, repeated without its prior."""
    cross = background.matrix[:, :, place : place + 1]
    return Block(cross, cross[:, place : place + 1], background.side[:, place : place + 1])


def less_noise(background: Background, block: Block, columns: Columns, noisy: Sequence[Columns]) -> Block:
    """The block corrected for noise, from the columns of the replicas.

    The correction is limited to half of a column's square.
    """
    cross, own, side = block.cross.copy(), block.own.copy(), block.side.copy()
    for t, (column, root) in enumerate(zip(columns, background.root, strict=True)):
        changes = [seen[t].less(column).weighed(root) for seen in noisy]
        added = sum(c.squares() for c in changes) / len(noisy)
        most = np.max(np.diag(added) / np.maximum(np.diag(own[t]), 1e-300))
        share = min(1.0, 0.5 / max(most, 1e-300)) / len(noisy)
        own[t] -= share * len(noisy) * added
        for change, (slopes, rests) in zip(changes, background.noise, strict=True):
            cross[t] -= share * slopes[t].products(change)
            side[t] -= share * change.dot(rests[t])
    return Block(cross, own, side)


@dataclass(frozen=True)
class Score:
    """Score of a candidate."""

    gain: float  # of log-likelihood
    amplitude: Array  # (q,)
    sd: Array  # (q,)
    held_out: Array  # (t,) gain on each test, amplitudes fitted on the others
    change: Array  # (p,) of the background with it, in units of the priors


def score(background: Background, block: Block, low: Array, high: Array, spread: Array, least: float = WORTH) -> Score:
    """Score a candidate whose amplitudes (q,) are within low and high, with normal priors of deviations `spread`.

    Cross-validation on a test is the candidate's gain in the log-probability of that test given the others, marginal
    over the background and the amplitudes: the gain of all tests less that of the others, less half the logarithm by
    which the test narrows the amplitudes. An effect excited in one test alone loses little there, a contradiction much.
    It is left at zero for a gain below `least`.
    """
    whole, still = _Profile(background, block, spread, -1), background.still[0]
    theta = whole.best(low, high)
    gain = whole.gain(theta) - float(still[0])
    held_out = []
    for t in range(len(block.own) if gain >= least else 0):
        others = _Profile(background, block, spread, t)
        narrowed = 0.5 * (whole.information - others.information)
        without = others.gain(others.best(low, high)) - float(still[1 + t])
        held_out.append(gain - without - narrowed)
    q = len(low)
    sd = np.sqrt(np.maximum(np.diag(np.linalg.pinv(whole.schur[:q, :q], hermitian=True)), 0.0))
    return Score(gain, theta[:q], sd, np.array(held_out or [0.0] * len(block.own)), whole.change(theta))


class _Summed(NamedTuple):
    """Equations of the background over some tests: of free unknowns, and of those at a bound."""

    keep: Mask  # (t,)
    factor: tuple[Array, bool]  # of free unknowns
    right: Array  # (p,)
    side: Array  # (f,) of those at a bound
    cross: Array  # (p, f)
    through: Array  # (p, f)
    own: Array  # (f, f), free unknowns eliminated


class _Profile:
    """Log-likelihood over a candidate's amplitudes and the unknowns at a bound, theta (q + f,), the rest eliminated."""

    def __init__(self, background: Background, block: Block, spread: Array, without: int) -> None:
        """Of all tests but one, or of all (-1)."""
        self.summed, self.inward = background.summed[without + 1], background.inward
        some, bound = self.summed, self.inward != 0.0
        candidate = block.cross[some.keep].sum(axis=0)
        cross = candidate * background.free[:, None]
        through = cho_solve(some.factor, cross)
        own = block.own[some.keep].sum(axis=0) - cross.T @ through + np.diag(spread**-2.0)
        between = candidate[bound] - some.through.T @ cross
        gone = np.hstack([through, some.through])
        self.schur = np.block([[own, between.T], [between, some.own]])  # (q + f, q + f), priors in it
        self.side = np.concatenate([block.side[some.keep].sum(axis=0), some.side]) - gone.T @ some.right  # (q + f,)
        self.cross = np.hstack([cross, some.cross])  # (p, q + f)
        self.count = len(spread)  # q

    def best(self, low: Array, high: Array) -> Array:
        """Optimum: amplitudes between low and high (q,), unknowns at a bound moved inward or not at all."""
        q, way = self.count, self.inward[self.inward != 0.0]
        theta = np.zeros(len(self.side))
        inverse = np.linalg.pinv(self.schur[:q, :q], rcond=1e-10, hermitian=True)
        theta[:q] = np.clip(-inverse @ self.side[:q], low, high)
        slope = (self.side + self.schur @ theta)[q:]
        own = np.maximum(np.diag(self.schur), 1e-12)  # rounding, where the background explains a column
        if not np.any((slope * way < 0.0) & (0.5 * slope**2 > WORTH * own[q:])):
            return theta
        scale = 1.0 / np.sqrt(own)
        least = np.concatenate([low, np.where(way > 0.0, 0.0, -np.inf)]) / scale
        most = np.concatenate([high, np.where(way > 0.0, np.inf, 0.0)]) / scale
        value, vector = np.linalg.eigh(self.schur * np.outer(scale, scale))
        root = np.sqrt(np.maximum(value, 1e-9))
        wanted = -(vector.T @ (self.side * scale)) / root
        # by active sets: few numbers, some not identifiable
        found = lsq_linear(root[:, None] * vector.T, wanted, bounds=(least, most), method="bvls")
        return np.asarray(found.x * scale)

    def gain(self, theta: Array) -> float:
        """Gain of theta over zero."""
        return -float(0.5 * theta @ self.schur @ theta + self.side @ theta)

    @property
    def information(self) -> float:
        """Logarithm of the determinant of the amplitudes' normal matrix."""
        return float(np.linalg.slogdet(self.schur[: self.count, : self.count])[1])

    def change(self, theta: Array) -> Array:
        """Change of the background (p,) with theta."""
        moved = -cho_solve(self.summed.factor, self.summed.right + self.cross @ theta)
        moved[self.inward != 0.0] = theta[self.count :]
        return np.asarray(moved)
