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

__all__ = ["StartStates", "no_start_states", "start_states"]

LEAST = 0.1
"""Singular value, in deviations of noise, below which a direction is left: it would change by half a per cent."""


class StartStates(NamedTuple):
    """Directions in which states at the start of a test move its whitened bins, in k columns of the residuals."""

    columns: NDArray[np.intp]  # (k,) those in which directions are not zero
    directions: Array  # (2, m, k, s) real and imaginary parts
    duals: Array  # (2, m, k, s): their products with the directions are one or zero
    removed: Array  # (s,) share of what lies along each

    def less(self, bins: Complex) -> Complex:
        """Whitened bins (m, c, p) less what states at the start explain of them."""
        own, count = _parts(bins[:, self.columns]), len(self.removed)
        if not (count and own.any()):
            return bins
        flat = own.reshape(-1, bins.shape[2])
        along = (self.duals.reshape(-1, count).T @ flat) * self.removed[:, None]
        flat -= self.directions.reshape(-1, count) @ along
        out = bins.copy()
        out.real[:, self.columns], out.imag[:, self.columns] = own
        return out

    def scaled(self, scale: Array) -> "StartStates":
        """The same for whitened bins that are larger by a scale (m, c)."""
        own = scale[:, self.columns, None]
        return self._replace(directions=self.directions * own, duals=self.duals / own)


def _parts(x: Complex) -> Array:
    """Real and imaginary parts (2, ...): products of them take half the work of complex ones."""
    return np.array([x.real, x.imag])  # in C order, so that a reshaped one is a view


def start_states(whitened: Complex) -> StartStates:
    """Directions of a test by whitened bins (m, c, k) of one prior deviation of each of k states."""
    columns = np.flatnonzero(whitened.any(axis=(0, 2)))
    flat = whitened[:, columns].reshape(-1, whitened.shape[2])
    squares, turned = np.linalg.eigh((flat.conj().T @ flat).real)
    seen = squares > LEAST**2
    directions = flat @ (turned[:, seen] / np.sqrt(squares[seen]))
    directions = _parts(directions.reshape(len(whitened), len(columns), int(seen.sum())))
    return StartStates(columns, directions, directions, 1.0 - 1.0 / np.sqrt(1.0 + squares[seen]))


def no_start_states(bins: int) -> StartStates:
    """Of a test without friction, or without forces, of so many bins."""
    none = np.zeros((2, bins, 0, 0))
    return StartStates(np.zeros(0, np.intp), none, none, np.zeros(0))
