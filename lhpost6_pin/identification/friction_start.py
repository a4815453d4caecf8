"""What seals and pads hold at the start of a test, from where the platen came: friction's hidden states then.

Nothing measures them. They change the balance of forces until the platen has travelled some yield slips, nearly in
proportion: two states along one slip differ by an amount that decays with the travel.
"""

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.files import models_folder
from ..data.records import is_measured
from ..effects.registry import law_of, states_of
from ..machine.parameters import load_parameters
from ..mechanics.plant import Plant
from .inverse_dynamics import with_loads
from .prepare import MeasuredTest, actuator_forces
from .residual_kernels import row_wrenches
from .residuals import Path, evaluate_residuals, follow

__all__ = ["estimate_start", "largest_share", "start_deviation", "start_wrenches"]

APART = 0.5
"""State, of full friction, above and below zero between which its change of the wrench is taken."""

ROUNDS = 3
"""Estimates: size and correlation of the error that weighs one are of what the one before leaves."""


def start_deviation() -> float:
    """Prior standard deviation of a state at the start, of full friction (`models/procedures/decompose.toml`)."""
    return load_parameters(models_folder() / "procedures" / "decompose.toml").number("friction.held")


def start_wrenches(plant: Plant, test: MeasuredTest, path: Path | None = None) -> tuple[Array, NDArray[np.intp]]:
    """Wrenches (n, 6, k) on the platen at C in {c} [N, N m] by a unit of each of k states at the start; their places.

    path is that of `follow`, if it is known. There are none (k = 0) where forces are not measured, as there is no
    balance of them.
    """
    force, rows = actuator_forces(plant.machine, test.channels), _friction_rows(plant)
    if force is None or not len(rows):
        return np.zeros((test.samples, 6, 0)), np.zeros(0, np.intp)
    known = plant, path or follow(plant, test)
    sizes = [states_of(row).stop - states_of(row).start for row in rows]
    found, places = [], []
    for nth in range(max(sizes)):
        some = rows[[size > nth for size in sizes]]
        own = [states_of(row).start + nth for row in some]
        sides = []
        for start in (APART, -APART):
            state = np.zeros(len(plant.states))
            state[own] = start
            began = follow(plant, test, known, start=state)
            z = with_loads(plant, began.ports, began.required, began.z, force)
            sides.append(row_wrenches(plant, began.ports, z, some))
        found.append((sides[0] - sides[1]) / (2.0 * APART))
        places += own
    return np.concatenate(found, axis=1).swapaxes(1, 2), np.array(places)


def estimate_start(plant: Plant, test: MeasuredTest, cutoff: float) -> Array:
    """Friction's states (n_states,) at the start of a measured test, by the balance of forces up to `cutoff` [Hz].

    The most probable ones, with the prior of `start_deviation` and an error of the balance that is, on each axis, as
    large as what remains of it, and as correlated from sample to sample (an autoregression of first order, after
    Cochrane and Orcutt, 1949). Zero in a simulated test, and where forces are not measured. Means over the test count
    for nothing: a force that stays may be the offset of a sensor.
    """
    out = np.zeros(len(plant.states))
    if not is_measured(test.record):
        return out
    path = follow(plant, test)
    wrenches, places = start_wrenches(plant, test, path)
    if not len(places):
        return out
    residual = evaluate_residuals(plant, test, ("wrench",), path=path).wrench
    block = max(round(0.5 / (cutoff * test.dt)), 1)
    count = test.samples // block
    rest, slopes = (_varying(x[: count * block].reshape(count, block, *x.shape[1:]).mean(axis=1))[:, plant.axes]
                    for x in (residual, wrenches))  # fmt: skip
    found, prior = np.zeros(len(places)), np.eye(len(places)) / start_deviation() ** 2
    for _ in range(ROUNDS):
        left = rest - slopes @ found
        size = np.sum(left**2, axis=0)
        if not size.all():  # a balance without any error: nothing is to be explained
            return out
        share = np.sum(left[1:] * left[:-1], axis=0) / size
        error = np.sqrt(np.mean(_new(left, share) ** 2, axis=0))
        rows = (_new(slopes, share[:, None]) / error[:, None]).reshape(-1, len(places))
        found = np.linalg.solve(rows.T @ rows + prior, rows.T @ (_new(rest, share) / error).ravel())
    out[places] = found
    for row in _friction_rows(plant):
        own = out[states_of(row)]
        own /= max(float(np.linalg.norm(own)), 1.0)  # no more than full friction
    return out


def largest_share(plant: Plant, start: Array) -> float:
    """Largest share of its friction that a seal or pad holds with the states `start` (n_states,)."""
    return max((float(np.linalg.norm(start[states_of(row)])) for row in _friction_rows(plant)), default=0.0)


def _friction_rows(plant: Plant) -> NDArray[np.void]:
    return np.array([row for row in plant.rows if law_of(row).friction_memory], plant.rows.dtype)


def _varying(x: Array) -> Array:
    return np.asarray(x - x.mean(axis=0))


def _new(x: Array, share: Array) -> Array:
    """What samples (n, ...) have beyond a share of the one before."""
    return np.asarray(x[1:] - share * x[:-1])
