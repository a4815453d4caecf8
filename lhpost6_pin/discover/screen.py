"""Screening: what each candidate would explain, with all known parameters and sensor errors refitted.

Everything is linear here: the residuals' derivatives by knobs, sensor errors and scatter between twins (the
background), and by a candidate's amplitudes. The gain is the log-likelihood that the candidate adds to a refit without
it; held out is what it adds on each test when everything was fitted on the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

__all__ = ["Background", "Block", "Score", "make_block", "real_bins", "score"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Block:
    """Normal equations of a candidate's amplitudes with themselves and with the background, by test."""

    cross: Array  # (t, p, q)
    own: Array  # (t, q, q)
    side: Array  # (t, q)

    def select(self, parts: Array) -> "Block":
        """Block of amplitudes each of which is a sum of these, parts (k, q)."""
        return Block(self.cross @ parts, parts.T @ self.own @ parts, self.side @ parts)


@dataclass(frozen=True)
class Background:
    """Normal equations of everything that is refitted in every comparison, by test; x in units of the priors.

    Bins are real here: real parts, then imaginary parts, times the root of two over that of the power left in them.
    """

    slope: Sequence[Array]  # (n, p) of every test
    rest: Sequence[Array]  # (n,)
    root: Sequence[Array]  # (m, c) roots of power
    matrix: Array  # (t, p, p)
    side: Array  # (t, p)
    place: Array  # (p,) where the background stands, in units of the priors
    free: Array  # (p,) one, or zero for what is at its bound and stays there

    @cached_property
    def factors(self) -> list[tuple[tuple[Array, bool], Array]]:
        """Cholesky factor and right side with the priors: of all tests, then of all but each."""
        found, both = [], np.outer(self.free, self.free)
        for without in range(-1, len(self.matrix)):
            keep = np.arange(len(self.matrix)) != without
            matrix = self.matrix[keep].sum(axis=0) * both + np.eye(len(self.place))
            found.append((cho_factor(matrix), (self.side[keep].sum(axis=0) + self.place) * self.free))
        return found

    @cached_property
    def alone(self) -> Array:
        """What it changes (p,) where nothing is added."""
        factor, side = self.factors[0]
        return np.asarray(-cho_solve(factor, side))

    @cached_property
    def still(self) -> Array:
        """What the background alone explains (t,): of the log-likelihood of each test, fitted on the others."""
        found = []
        for (factor, side), matrix, own in zip(self.factors[1:], self.matrix, self.side, strict=True):
            x = -cho_solve(factor, side)
            found.append(0.5 * x @ matrix @ x + own @ x)
        return np.array(found)


def real_bins(bins: Complex, root: Array) -> Array:
    """Bins (m, c, ...) as real rows (2 m c, ...), over the roots of power (m, c)."""
    scaled = bins * (np.sqrt(2.0) / root).reshape(root.shape + (1,) * (bins.ndim - 2))
    flat = scaled.reshape(-1, *bins.shape[2:])
    return np.concatenate([flat.real, flat.imag])


def make_block(background: Background, columns: Sequence[Complex]) -> Block:
    """Block of columns (m, c, k) by test."""
    cross, own, side = [], [], []
    for slope, rest, root, column in zip(background.slope, background.rest, background.root, columns, strict=True):
        c = real_bins(column, root)
        cross.append((slope * background.free).T @ c)
        own.append(c.T @ c)
        side.append(c.T @ rest)
    return Block(np.array(cross), np.array(own), np.array(side))


@dataclass(frozen=True)
class Score:
    """What a candidate explains."""

    gain: float  # of log-likelihood
    amplitude: Array  # (q,)
    sd: Array  # (q,)
    held_out: Array  # (t,) gain on each test, fitted on the others
    change: Array  # (p,) of the background with it, in units of the priors


def score(background: Background, block: Block, low: Array, high: Array, spread: float = np.inf) -> Score:
    """Score a candidate whose amplitudes (q,) are within low and high, with normal priors of deviation `spread`."""
    amplitude, change, schur, gain = _fit(background, block, low, high, spread, -1)
    held_out = []
    for t in range(len(block.own)):
        theta, moved, _, _ = _fit(background, block, low, high, spread, t)
        with_it = 0.5 * moved @ background.matrix[t] @ moved + background.side[t] @ moved
        with_it += theta @ (block.cross[t].T @ moved + 0.5 * block.own[t] @ theta + block.side[t])
        held_out.append(background.still[t] - with_it)
    sd = np.sqrt(np.maximum(np.diag(np.linalg.pinv(schur, hermitian=True)), 0.0))
    return Score(gain, amplitude, sd, np.array(held_out), change)


def _fit(
    background: Background, block: Block, low: Array, high: Array, spread: float, without: int
) -> tuple[Array, Array, Array, float]:
    """Amplitudes (q,), change of the background (p,), Schur complement (q, q), gain; of all tests but one."""
    keep = np.arange(len(block.own)) != without
    factor, side = background.factors[without + 1]
    cross, own, right = block.cross[keep].sum(axis=0), block.own[keep].sum(axis=0), block.side[keep].sum(axis=0)
    through = cho_solve(factor, cross)
    schur = own - cross.T @ through + np.eye(len(own)) / spread**2
    rest = right - through.T @ side
    theta = np.clip(-np.linalg.pinv(schur, rcond=1e-10, hermitian=True) @ rest, low, high)
    gain = -float(0.5 * theta @ schur @ theta + rest @ theta)
    return theta, -cho_solve(factor, side + cross @ theta), schur, gain
