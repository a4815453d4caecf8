"""What seals and pads hold at the start of a test, from where the platen came: friction's hidden states then.

Nothing measures them. They change the balance of forces until the platen has travelled some yield slips: two states
along one slip differ by an amount that decays with the travel. Well below full friction it is in proportion to the
state, near it is not: the balance is linearised about each estimate.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.files import models_folder
from ..data.channels import MOTION
from ..data.records import is_measured, require
from ..data.sensors import SensorSet
from ..data.signals import Band
from ..effects.registry import law_of, states_of
from ..machine.parameters import load_parameters
from ..mechanics.plant import Plant
from ..mechanics.pose import plant_motion
from .inverse_dynamics import leg_wrenches, with_loads
from .prepare import AS_RECORDED, MeasuredTest, actuator_forces, prepare_test
from .residual_kernels import row_wrenches
from .residuals import Path, evaluate_residuals, follow

__all__ = ["estimate_start", "largest_share", "start_deviation", "start_note", "start_of_record", "start_wrenches"]

APART, NEAR = 0.5, 1e-3
"""Change of a state, of full friction, either way, by which that of the wrench is taken; and so without noise, where
friction near its full force, strongly curved there, has to be exact."""

LEAST_ROOM = 1e-4
"""Square of what a state may vary where the others of its pad hold all friction: its slope is taken across that."""

ROUNDS, MOST_ROUNDS, SETTLED = 4, 20, 1e-6
"""Linearisations: on a triangle whose seals and pads held all of their friction, what the third one left of its wrench
was that of the true states within a tenth. Without noise, at most, and change of the states at which they end."""

WEIGHINGS = 2
"""Estimates in each: size and correlation of the error that weighs one are of what the one before leaves."""

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

    Differences between states `apart` above and below `about` (n_states,), by default zero, and within full friction.
    path is that of `follow`, if it is known. There are none (k = 0) where forces are not measured, as there is no
    balance of them.
    """
    force, rows = actuator_forces(plant.machine, test.channels), _friction_rows(plant)
    if force is None or not len(rows):
        return np.zeros((test.samples, 6, 0)), np.zeros(0, np.intp)
    known = plant, path or follow(plant, test)
    middle = np.zeros(len(plant.states)) if about is None else about
    sizes = [states_of(row).stop - states_of(row).start for row in rows]
    found, places = [], []
    for nth in range(max(sizes)):
        some = rows[[size > nth for size in sizes]]
        own = [states_of(row).start + nth for row in some]
        sides, states = [], []
        for step in (apart, -apart):
            state = middle.copy()
            room = _room(middle, own, [states_of(row) for row in some])
            state[own] = np.clip(state[own] + step, -room, room)
            began = follow(plant, test, known, start=state)
            z = with_loads(plant, began.ports, began.required, began.z, force)
            sides.append(row_wrenches(plant, began.ports, z, some))
            states.append(state[own])
        found.append((sides[0] - sides[1]) / (states[0] - states[1])[:, None])
        places += own
    return np.concatenate(found, axis=1).swapaxes(1, 2), np.array(places)


def estimate_start(plant: Plant, test: MeasuredTest, cutoff: float) -> Array:
    """Friction's states (n_states,) at the start of a test, by the balance of forces up to `cutoff` [Hz].

    The most probable ones, at most full friction, with the prior of `start_deviation` and an error of the balance that
    is, on each axis, as large as what remains of it, and as correlated from sample to sample (an autoregression of
    first order, after Cochrane and Orcutt, 1949): the balance is linearised anew about each estimate. A force that
    stays may be the offset of a sensor: means over the test count by their own size without states, and that of what
    varies, so that states bring in no larger ones. Zero where forces are not measured; and in a simulated test unless
    states lower the squares of its residual by `friction.held_gain` of `decompose.toml`: else it is not the start that
    the balance lacks.
    """
    state, block = np.zeros(len(plant.states)), max(round(0.5 / (cutoff * test.dt)), 1)
    force = actuator_forces(plant.machine, test.channels)
    if force is None or not len(_friction_rows(plant)) or test.samples < 2 * block:
        return state
    if not is_measured(test.record):
        measured = leg_wrenches(plant, plant_motion(plant, test.motion).q, force).sum(axis=1)[:, plant.axes]
        return _without_noise(_Balance(plant, test, 1), np.std(measured, axis=0))
    balance, none = _Balance(plant, test, block), np.zeros(len(plant.axes))
    stays = none
    for nth in range(ROUNDS):
        rest = balance.left(state)
        stays = np.abs(rest.mean) if nth == 0 else stays
        if not rest.varying.any(axis=0).all():  # without any error: nothing is to be explained
            break
        spread = stays + rest.varying.std(axis=0)
        state = balance.fitted(state, rest, none, white=nth == 0, spread=spread)
    return state


def start_of_record(plant: Plant, record: xr.Dataset, sensors: SensorSet | None) -> Array:
    """Friction's states (n_states,) at the start of a record: `estimate_start` up to decompose's cutoff.

    Without sensors the platen's motion is the record's own.

    Raises RecordError for a record without platen motion, or with a channel of it that is not finite.
    """
    if sensors is None:
        require(record, *MOTION)
    cutoff, edge = _number("comparison.cutoff"), _number("comparison.edge")
    policy = AS_RECORDED._replace(band=Band(high=cutoff, order=int(_number("comparison.order"))), edge=edge)
    return estimate_start(plant, prepare_test(plant, record, sensors, policy), cutoff)


def start_note(plant: Plant, start: Array) -> str:
    """What `start` (n_states,) holds, as a sentence; empty if nothing."""
    share = largest_share(plant, start)
    held = f"{100.0 * share:.0f} % of their friction"
    return f"Seals or pads hold up to {held} at the start, by the balance of forces." if share else ""


def _without_noise(balance: "_Balance", measured: Array) -> Array:
    """States (n_states,) at the start that balance forces without noise, of this variation (a,) of their wrench.

    The prior decides between states that the balance does not distinguish.
    """
    zero = state = np.zeros(len(balance.plant.states))
    left = balance.left(zero)
    first = rest = left.varying
    least = BALANCED * np.maximum(measured, SHOWN * measured.max())
    if np.all(np.mean(first**2, axis=0) <= least**2):
        return zero

    def lowered(by: float) -> bool:
        """Whether the states have lowered the squares of the balance by a factor."""
        return bool(by * np.sum((rest / least) ** 2) <= np.sum((first / least) ** 2))

    for nth in range(MOST_ROUNDS):
        last, state = state, balance.fitted(state, left, least, apart=NEAR if nth else APART, white=nth == 0)
        left = balance.left(state)
        rest = left.varying
        if np.abs(state - last).max() < SETTLED or (nth + 1 == ROUNDS and not lowered(2.0)):
            break
    return state if lowered(_number("friction.held_gain")) else zero


class _Left(NamedTuple):
    """What the balance of a test's forces leaves on the free axes."""

    varying: Array  # (n, a) in means over blocks of samples, less their mean
    mean: Array  # (a,)


class _Balance:
    """The balance of a test's forces from states at its start on."""

    def __init__(self, plant: Plant, test: MeasuredTest, block: int) -> None:
        self.plant, self.test, self.block = plant, test, block
        self.path, self.deviation = follow(plant, test), start_deviation()

    def left(self, state: Array) -> _Left:
        """What it leaves from states (n_states,) at the start on."""
        path = follow(self.plant, self.test, (self.plant, self.path), start=state) if state.any() else self.path
        return self._compared(evaluate_residuals(self.plant, self.test, ("wrench",), path=path).wrench)

    def fitted(
        self,
        state: Array,
        rest: _Left,
        least: Array,
        *,
        white: bool,
        apart: float = APART,
        spread: Array | float = np.inf,
    ) -> Array:
        """Most probable states (n_states,), linearised about others that leave `rest`: see `_fitted`.

        spread (a,): deviation of the mean; infinite: it counts for nothing.
        """
        wrenches, places = start_wrenches(self.plant, self.test, self.path, about=state, apart=apart)
        (slopes, levels), out, about = self._compared(wrenches), state.copy(), state[places]
        full = [np.isin(places, np.r_[states_of(row)]) for row in _friction_rows(self.plant)]
        known = np.column_stack([levels, rest.mean + levels @ about]) / np.reshape(spread, (-1, 1))
        prior = np.vstack([np.eye(len(about), len(about) + 1) / self.deviation, known])
        out[places] = _fitted(rest.varying + slopes @ about, slopes, about, prior, least, white, full)
        for row in _friction_rows(self.plant):  # but for rounding they are within full friction
            out[states_of(row)] /= max(float(np.linalg.norm(out[states_of(row)])), 1.0)
        return out

    def _compared(self, x: Array) -> _Left:
        count = len(x) // self.block
        means = x[: count * self.block].reshape(count, self.block, *x.shape[1:]).mean(axis=1)
        mean = means.mean(axis=0)
        return _Left(np.asarray(means - mean)[:, self.plant.axes], np.asarray(mean)[self.plant.axes])


def _fitted(
    rest: Array,
    slopes: Array,
    found: Array,
    prior: Array,
    least: Array,
    white: bool,
    full: Sequence[NDArray[np.bool_]],
) -> Array:
    """Most probable states (k,) by what the balance (n, a) leaves without them, and its slopes (n, a, k).

    prior (p, k + 1): rows of further squares, what they are to be in the last column. The error is at least `least`
    (a,), and first that which the states `found` leave; `white`, without correlation, as long as the states that are to
    explain the balance would be its own. full: the states of each seal and pad, whose norm is at most one.
    """
    count = len(found)
    for nth in range(WEIGHINGS):
        left = rest - slopes @ found
        size = np.maximum(np.sum(left**2, axis=0), np.finfo(float).tiny)
        share = np.zeros(len(size)) if white and nth == 0 else np.sum(left[1:] * left[:-1], axis=0) / size
        error = np.sqrt(np.mean(_new(left, share) ** 2, axis=0)) + least
        rows = (_new(slopes, share[:, None]) / error[:, None]).reshape(-1, count)
        wanted = (_new(rest, share) / error).reshape(-1, 1)
        whole = np.vstack([np.hstack([rows, wanted]), prior])
        small = np.asarray(np.linalg.qr(whole, mode="r"))  # the same in few rows
        found = _within(small[:, :-1], small[:, -1], found, full)
    return found


def _within(slopes: Array, wanted: Array, start: Array, full: Sequence[NDArray[np.bool_]]) -> Array:
    """States (k,) of the least squares of slopes (m, k) times them less `wanted` (m,), each seal and pad within one."""
    from scipy.optimize import minimize

    masks = np.array(full, dtype=float)
    free = np.linalg.lstsq(slopes, wanted)[0]
    if np.all(masks @ free**2 <= 1.0):
        return np.asarray(free)
    size = float(wanted @ wanted)
    found = minimize(
        lambda x: 0.5 * np.sum((slopes @ x - wanted) ** 2) / size,
        start,
        jac=lambda x: slopes.T @ (slopes @ x - wanted) / size,
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda x: 1.0 - masks @ x**2, "jac": lambda x: -2.0 * masks * x},
        options={"maxiter": 300, "ftol": 1e-15},
    )
    return np.asarray(found.x)


def largest_share(plant: Plant, start: Array) -> float:
    """Largest share of its friction that a seal or pad holds with the states `start` (n_states,)."""
    return max((float(np.linalg.norm(start[states_of(row)])) for row in _friction_rows(plant)), default=0.0)


def _number(path: str) -> float:
    """Number of `models/procedures/decompose.toml`."""
    return load_parameters(models_folder() / "procedures" / "decompose.toml").number(path)


def _room(state: Array, own: Sequence[int], members: Sequence[slice]) -> Array:
    """How far each of the states `own` can go with the others of its seal or pad, `members`, at full friction."""
    others = [np.sum(state[all_of] ** 2) - state[one] ** 2 for one, all_of in zip(own, members, strict=True)]
    return np.sqrt(np.maximum(1.0 - np.array(others), LEAST_ROOM))


def _friction_rows(plant: Plant) -> NDArray[np.void]:
    return np.array([row for row in plant.rows if law_of(row).friction_memory], plant.rows.dtype)


def _new(x: Array, share: Array) -> Array:
    """What samples (n, ...) have beyond a share of the one before."""
    return np.asarray(x[1:] - share * x[:-1])
