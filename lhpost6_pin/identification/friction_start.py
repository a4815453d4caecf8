"""What seals and pads hold at the start of a test, from where the platen came: friction's hidden states then.

Nothing measures them. They change the balance of forces until the platen has travelled some yield slips, nearly in
proportion: two states along one slip differ by an amount that decays with the travel.
"""

from dataclasses import replace

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

__all__ = ["estimate_start", "largest_share", "start_deviation", "start_wrenches", "with_start"]

APART = 0.5
"""State, of full friction, above and below a state between which its change of the wrench is taken."""

ROUNDS = 4
"""Linearisations: on a triangle whose seals and pads held all of their friction, what the third one left of its wrench
was that of the true states within a tenth."""

WEIGHINGS = 2
"""Estimates in each: size and correlation of the error that weighs one are of what the one before leaves."""


def start_deviation() -> float:
    """Prior standard deviation of a state at the start, of full friction (`models/procedures/decompose.toml`)."""
    return load_parameters(models_folder() / "procedures" / "decompose.toml").number("friction.held")


def start_wrenches(
    plant: Plant, test: MeasuredTest, path: Path | None = None, about: Array | None = None
) -> tuple[Array, NDArray[np.intp]]:
    """Wrenches (n, 6, k) on the platen at C in {c} [N, N m] by a unit of each of k states at the start; their places.

    Of states near those of `about` (n_states,), by default the test's own, and up to full friction. path is that of
    `follow`, if it is known. There are none (k = 0) where forces are not measured, as there is no balance of them.
    """
    force, rows = actuator_forces(plant.machine, test.channels), _friction_rows(plant)
    if force is None or not len(rows):
        return np.zeros((test.samples, 6, 0)), np.zeros(0, np.intp)
    known = plant, path or follow(plant, test)
    middle = test.states_at_start(plant.states) if about is None else about
    sizes = [states_of(row).stop - states_of(row).start for row in rows]
    found, places = [], []
    for nth in range(max(sizes)):
        some = rows[[size > nth for size in sizes]]
        own = [states_of(row).start + nth for row in some]
        sides, states = [], []
        for step in (APART, -APART):
            state = middle.copy()
            state[own] = np.clip(state[own] + step, -1.0, 1.0)
            began = follow(plant, test, known, start=state)
            z = with_loads(plant, began.ports, began.required, began.z, force)
            sides.append(row_wrenches(plant, began.ports, z, some))
            states.append(state[own])
        found.append((sides[0] - sides[1]) / (states[0] - states[1])[:, None])
        places += own
    return np.concatenate(found, axis=1).swapaxes(1, 2), np.array(places)


def estimate_start(plant: Plant, test: MeasuredTest, cutoff: float) -> Array:
    """Friction's states (n_states,) at the start of a measured test, by the balance of forces up to `cutoff` [Hz].

    The most probable ones, at most full friction, with the prior of `start_deviation` and an error of the balance that
    is, on each axis, as large as what remains of it, and as correlated from sample to sample (an autoregression of
    first order, after Cochrane and Orcutt, 1949): the balance is linearised anew about each estimate. Zero in a
    simulated test, and where forces are not measured. Means over the test count for nothing: a force that stays may be
    the offset of a sensor.
    """
    out = np.zeros(len(plant.states))
    if not is_measured(test.record):
        return out
    known, deviation = (plant, follow(plant, test)), start_deviation()
    block = max(round(0.5 / (cutoff * test.dt)), 1)
    for nth in range(ROUNDS):
        slopes, places = start_wrenches(plant, test, known[1], out)
        if not len(places):
            return out
        path = follow(plant, test, known, start=out)
        wrench = evaluate_residuals(plant, test, ("wrench",), path=path).wrench
        rest, slopes = (_varying(_averaged(x, block))[:, plant.axes] for x in (wrench, slopes))
        rest = rest + slopes @ out[places]  # without any state
        if not np.sum(rest**2, axis=0).all():  # a balance without any error: nothing is to be explained
            return out
        out[places] = _fitted(rest, slopes, out[places], deviation, white=nth == 0)
        for row in _friction_rows(plant):
            own = out[states_of(row)]
            own /= max(float(np.linalg.norm(own)), 1.0)
    return out


def with_start(plant: Plant, test: MeasuredTest, cutoff: float) -> MeasuredTest:
    """The test with friction's states at its start by `estimate_start`."""
    pairs = zip(plant.states, estimate_start(plant, test, cutoff), strict=True)
    return replace(test, start={name: float(state) for name, state in pairs if state})


def _fitted(rest: Array, slopes: Array, found: Array, deviation: float, white: bool) -> Array:
    """Most probable states (k,) by what the balance (n, a) leaves without them, and its slopes (n, a, k).

    Each has this prior deviation. The error is first that which the states `found` leave; `white`, without correlation,
    as long as the states that are to explain the balance would be its own.
    """
    from scipy.optimize import lsq_linear

    count = len(found)
    for nth in range(WEIGHINGS):
        left = rest - slopes @ found
        size = np.sum(left**2, axis=0)
        share = np.zeros(len(size)) if white and nth == 0 else np.sum(left[1:] * left[:-1], axis=0) / size
        error = np.sqrt(np.mean(_new(left, share) ** 2, axis=0))
        rows = (_new(slopes, share[:, None]) / error[:, None]).reshape(-1, count)
        rows, wanted = np.vstack([rows, np.eye(count) / deviation]), (_new(rest, share) / error).ravel()
        found = lsq_linear(rows, np.append(wanted, np.zeros(count)), (-1.0, 1.0), method="bvls").x
    return found


def largest_share(plant: Plant, start: Array) -> float:
    """Largest share of its friction that a seal or pad holds with the states `start` (n_states,)."""
    return max((float(np.linalg.norm(start[states_of(row)])) for row in _friction_rows(plant)), default=0.0)


def _friction_rows(plant: Plant) -> NDArray[np.void]:
    return np.array([row for row in plant.rows if law_of(row).friction_memory], plant.rows.dtype)


def _averaged(x: Array, block: int) -> Array:
    """Means of samples (n, ...) over blocks."""
    count = len(x) // block
    return np.asarray(x[: count * block].reshape(count, block, *x.shape[1:]).mean(axis=1))


def _varying(x: Array) -> Array:
    return np.asarray(x - x.mean(axis=0))


def _new(x: Array, share: Array) -> Array:
    """What samples (n, ...) have beyond a share of the one before."""
    return np.asarray(x[1:] - share * x[:-1])
