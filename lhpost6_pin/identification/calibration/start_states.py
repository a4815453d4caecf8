"""Friction's state at the start of a test, which nothing measures: what it changes is taken out of the residuals.

Seals and pads hold a part of their friction from where the platen came. Two states along one slip differ by an amount
that decays with the travel and is nearly proportional to their first difference. The change of the whitened bins by
each state is therefore known but for its size, for which there is a prior. Without it the covariance of the bins is
the identity I, with it I + D D^T, where D are those changes, one prior deviation each; what is compared is multiplied
by the inverse root of that: along the singular vectors of D by (1 + s^2)^-1/2, elsewhere by one. This is the estimate
with one more unknown for each state.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array, Complex
from ...effects.registry import law_of, states_of
from ...mechanics.plant import Plant
from ..inverse_dynamics import with_loads
from ..prepare import MeasuredTest, actuator_forces
from ..residual_kernels import row_wrenches
from ..residuals import follow

__all__ = ["StartStates", "no_start_states", "start_states", "start_wrenches"]

APART = 0.5
"""State, of full friction, above and below zero between which its change of the wrench is taken."""

LEAST = 0.1
"""Singular value, in deviations of noise, below which a direction is left: it would change by half a per cent."""


class StartStates(NamedTuple):
    """Directions in which states at the start of a test move its whitened bins, in k columns of the residuals."""

    columns: NDArray[np.intp]  # (k,) those in which directions are not zero
    directions: Complex  # (m, k, s)
    duals: Complex  # (m, k, s): the real parts of their products with the directions are one or zero
    removed: Array  # (s,) share of what lies along each

    def less(self, bins: Complex) -> Complex:
        """Whitened bins (m, c, p) less what states at the start explain of them."""
        own = bins[:, self.columns].reshape(-1, bins.shape[2])
        if not own.any():
            return bins
        along = (self.duals.reshape(len(own), len(self.removed)).conj().T @ own).real * self.removed[:, None]
        out = bins.copy()
        out[:, self.columns] -= (self.directions @ along).reshape(len(bins), len(self.columns), bins.shape[2])
        return out

    def scaled(self, scale: Array) -> "StartStates":
        """The same for whitened bins that are larger by a scale (m, c)."""
        own = scale[:, self.columns, None]
        return self._replace(directions=self.directions * own, duals=self.duals / own)


def start_wrenches(plant: Plant, test: MeasuredTest) -> Array:
    """Wrenches (n, 6, k) on the platen at C in {c} [N, N m] by a unit of each of k friction states at the start.

    There are none (k = 0) where forces are not measured, as there is no balance of them.
    """
    force = actuator_forces(plant.machine, test.channels)
    rows = np.array([row for row in plant.rows if law_of(row).friction_memory], plant.rows.dtype)
    if force is None or not len(rows):
        return np.zeros((test.samples, 6, 0))
    sizes = [states_of(row).stop - states_of(row).start for row in rows]
    found = []
    for place in range(max(sizes)):
        some = rows[[size > place for size in sizes]]
        sides = []
        for start in (APART, -APART):
            state = np.zeros(len(plant.states))
            state[[states_of(row).start + place for row in some]] = start
            path = follow(plant, test, start=state)
            z = with_loads(plant, path.ports, path.required, path.z, force)
            sides.append(row_wrenches(plant, path.ports, z, some))
        found.append((sides[0] - sides[1]) / (2.0 * APART))
    return np.concatenate(found, axis=1).swapaxes(1, 2)


def start_states(whitened: Complex) -> StartStates:
    """Directions of a test by whitened bins (m, c, k) of one prior deviation of each of k states."""
    columns = np.flatnonzero(whitened.any(axis=(0, 2)))
    flat = whitened[:, columns].reshape(-1, whitened.shape[2])
    squares, turned = np.linalg.eigh((flat.conj().T @ flat).real)
    seen = squares > LEAST**2
    directions = flat @ (turned[:, seen] / np.sqrt(squares[seen]))
    directions = directions.reshape(len(whitened), len(columns), int(seen.sum()))
    return StartStates(columns, directions, directions, 1.0 - 1.0 / np.sqrt(1.0 + squares[seen]))


def no_start_states(bins: int) -> StartStates:
    """Of a test without friction, or without forces, of so many bins."""
    none = np.zeros((bins, 0, 0), np.complex128)
    return StartStates(np.zeros(0, np.intp), none, none, np.zeros(0))
