"""Friction's state at the start of a test, which nothing measures: what it changes is taken out of the residuals.

The change of the whitened bins by each state (`friction_start`) is known but for its size, for which there is a prior.
Without it the covariance of the bins is the identity I, with it I + D D^T, where D are those changes, one prior
deviation each; what is compared is multiplied by the inverse root of that: along the singular vectors of D by
(1 + s^2)^-1/2, elsewhere by one. This is the estimate with one more unknown for each state.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array, Complex
from .sparse_bins import SparseBins

__all__ = ["StartStates", "no_start_states", "start_states"]

LEAST = 0.1
"""Singular value, in deviations of noise, below which a direction is left: it would change by half a per cent."""


class StartStates(NamedTuple):
    """Directions in which states at the start of a test move its whitened bins, in k columns of the residuals.

    Real and imaginary parts alternate: products of them take half the work of complex ones.
    """

    columns: NDArray[np.intp]  # (k,) those in which directions are not zero
    directions: Array  # (s, 2 k m)
    duals: Array  # (s, 2 k m): their products with the directions are one or zero
    removed: Array  # (s,) share of what lies along each

    def less(self, some: SparseBins) -> SparseBins:
        """Whitened bins less what states at the start explain of them."""
        return self._along(some, -self.removed)

    def restored(self, some: SparseBins) -> SparseBins:
        """Whitened bins of which `less` has left some."""
        return self._along(some, self.removed / (1.0 - self.removed))

    def _along(self, some: SparseBins, share: Array) -> SparseBins:
        """Whitened bins and shares (s,) of what lies along each direction."""
        if not (len(self.removed) and np.isin(self.columns, some.columns).any()):
            return some
        columns = np.union1d(self.columns, some.columns)
        out = np.zeros((len(columns), *some.each.shape[1:]), np.complex128)
        out[np.searchsorted(columns, some.columns)] = some.each
        places = np.searchsorted(columns, self.columns)
        own = out[places].swapaxes(0, 1)
        flat = _parts(own)
        flat += ((flat @ self.duals.T) * share) @ self.directions
        out[places] = flat.view(np.complex128).reshape(own.shape).swapaxes(0, 1)
        return SparseBins(columns, out.reshape(len(columns), *some.bins.shape[1:]))

    def scaled(self, scale: Array) -> "StartStates":
        """The same for whitened bins that are larger by a scale (m, c)."""
        own = np.repeat(scale.T[self.columns].ravel(), 2)
        return self._replace(directions=self.directions * own, duals=self.duals / own)


def _parts(bins: Complex) -> Array:
    """Real and imaginary parts (p, 2 k m) of bins (p, k, m)."""
    return np.ascontiguousarray(bins).view(np.float64).reshape(len(bins), -1)


def start_states(whitened: SparseBins) -> StartStates:
    """Directions of a test by whitened bins (k, p, m) of one prior deviation of each of p states."""
    flat = _parts(whitened.bins.swapaxes(0, 1))
    squares, turned = np.linalg.eigh(flat @ flat.T)
    seen = squares > LEAST**2
    directions = (turned[:, seen] / np.sqrt(squares[seen])).T @ flat
    return StartStates(whitened.columns, directions, directions, 1.0 - 1.0 / np.sqrt(1.0 + squares[seen]))


def no_start_states() -> StartStates:
    """Of a test without friction, or without forces."""
    none = np.zeros((0, 0))
    return StartStates(np.zeros(0, np.intp), none, none, np.zeros(0))
