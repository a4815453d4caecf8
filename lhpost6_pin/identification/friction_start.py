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
from ..mechanics.pose import plant_motion
from .inverse_dynamics import leg_wrenches, with_loads
from .prepare import MeasuredTest, actuator_forces
from .residual_kernels import row_wrenches
from .residuals import Path, evaluate_residuals, follow

__all__ = ["estimate_start", "largest_share", "start_deviation", "start_wrenches"]

APART = 0.5
"""State, of full friction, above and below zero between which its change of the wrench is taken."""

ROUNDS = 3
"""Estimates: size and correlation of the error that weighs one are of what the one before leaves."""

MOST_ROUNDS, PATIENCE, STEP, SETTLED = 20, 4, 1e-3, 1e-6
"""Of a record without noise: Gauss-Newton steps at most, as the law of Bouc and Wen is strongly curved near full
friction; after how many the squares must have halved; the difference by which states are varied in them; and the
largest change of a state at which they end."""

BALANCED, SHOWN = 1e-4, 1e-2
"""Residual over measured wrench of an axis up to which a record without noise is in balance as it is; and variation of
an axis over that of the largest, forces and moments alike, below which its residual counts as of one so large."""


def start_deviation() -> float:
    """Prior standard deviation of a state at the start, of full friction (`models/procedures/decompose.toml`)."""
    return _number("friction.held")


def start_wrenches(
    plant: Plant, test: MeasuredTest, path: Path | None = None, *, about: Array | None = None, apart: float = APART
) -> tuple[Array, NDArray[np.intp]]:
    """Wrenches (n, 6, k) on the platen at C in {c} [N, N m] by a unit of each of k states at the start; their places.

    They are differences between states `apart` above and below `about` (n_states,), by default zero. path is that of
    `follow`, if it is known. There are none (k = 0) where forces are not measured, as there is no balance of them.
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
        for change in (apart, -apart):
            state = np.zeros(len(plant.states)) if about is None else about.copy()
            state[own] += change
            began = follow(plant, test, known, start=state)
            z = with_loads(plant, began.ports, began.required, began.z, force)
            sides.append(row_wrenches(plant, began.ports, z, some))
        found.append((sides[0] - sides[1]) / (2.0 * apart))
        places += own
    return np.concatenate(found, axis=1).swapaxes(1, 2), np.array(places)


def estimate_start(plant: Plant, test: MeasuredTest, cutoff: float) -> Array:
    """Friction's states (n_states,) at the start of a test, by the balance of forces up to `cutoff` [Hz].

    In a measured test the most probable ones, with the prior of `start_deviation` and an error of the balance that is,
    on each axis, as large as what remains of it, and as correlated from sample to sample (an autoregression of first
    order, after Cochrane and Orcutt, 1949). Means over the test count for nothing: a force that stays may be the offset
    of a sensor. In a simulated test those that balance its forces, if zero does not (`friction.held_gain` of
    `decompose.toml`), else zero. Zero where forces are not measured.
    """
    out = np.zeros(len(plant.states))
    path = follow(plant, test)
    if not is_measured(test.record):
        return _without_noise(plant, test, path)
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
    return _limited(plant, out)


def _without_noise(plant: Plant, test: MeasuredTest, path: Path) -> Array:
    """States (n_states,) at the start that balance the forces of a record without noise, by Gauss and Newton.

    The prior decides between states that the balance does not distinguish. Zero where they leave more than a share of
    the squares that zero leaves: then it is not the start that the balance lacks.
    """
    zero = state = np.zeros(len(plant.states))
    force = actuator_forces(plant.machine, test.channels)
    if force is None or not len(_friction_rows(plant)):
        return zero
    residual = evaluate_residuals(plant, test, ("wrench",), path=path).wrench[:, plant.axes]
    measured = leg_wrenches(plant, plant_motion(plant, test.motion).q, force).sum(axis=1)[:, plant.axes]
    size = np.std(measured, axis=0)
    if not size.any():
        return zero
    size = np.maximum(size, SHOWN * size.max())
    least = before = float(np.sum((residual / size) ** 2))
    if before <= BALANCED**2 * residual.size:
        return zero
    best, apart, prior = zero, APART, 1.0 / start_deviation() ** 2
    for rounds in range(MOST_ROUNDS):
        if rounds == PATIENCE and least > 0.5 * before:
            break
        slopes, places = start_wrenches(plant, test, path, about=state, apart=apart)
        error = np.sqrt(np.mean(residual**2, axis=0)) + BALANCED * size
        rows = (slopes[:, plant.axes] / error[:, None]).reshape(-1, len(places))
        pull = rows.T @ (residual / error).ravel() - prior * state[places]
        changed = state.copy()
        changed[places] += np.linalg.solve(rows.T @ rows + prior * np.eye(len(places)), pull)
        last, state, apart = state, _limited(plant, changed), STEP
        began = follow(plant, test, (plant, path), start=state)
        residual = evaluate_residuals(plant, test, ("wrench",), path=began).wrench[:, plant.axes]
        left = float(np.sum((residual / size) ** 2))
        if left < least:
            least, best = left, state
        if np.abs(state - last).max() < SETTLED:
            break
    return best if least * _number("friction.held_gain") <= before else zero


def _limited(plant: Plant, states: Array) -> Array:
    """The states (n_states,) with no more than full friction in each row."""
    out = states.copy()
    for row in _friction_rows(plant):
        own = out[states_of(row)]
        own /= max(float(np.linalg.norm(own)), 1.0)
    return out


def largest_share(plant: Plant, start: Array) -> float:
    """Largest share of its friction that a seal or pad holds with the states `start` (n_states,)."""
    return max((float(np.linalg.norm(start[states_of(row)])) for row in _friction_rows(plant)), default=0.0)


def _number(path: str) -> float:
    """Number of `models/procedures/decompose.toml`."""
    return load_parameters(models_folder() / "procedures" / "decompose.toml").number(path)


def _friction_rows(plant: Plant) -> NDArray[np.void]:
    return np.array([row for row in plant.rows if law_of(row).friction_memory], plant.rows.dtype)


def _varying(x: Array) -> Array:
    return np.asarray(x - x.mean(axis=0))


def _new(x: Array, share: Array) -> Array:
    """What samples (n, ...) have beyond a share of the one before."""
    return np.asarray(x[1:] - share * x[:-1])
