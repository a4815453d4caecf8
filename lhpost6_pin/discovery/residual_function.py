"""What is left when the library has been searched: a free function of a leg's state.

A force along a leg, or alike along all of a kind, that is a piecewise linear function of position or speed, of a fading
memory of positions or of how far the leg is from it, is fitted with everything else, as a candidate is. If it gains, on
tests that it was not fitted on, too, something acts on those legs that has no name here.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..identification.calibration.problem import OperatingPoint, Problem
from ..identification.calibration.whitened_residuals import spectrum_of
from ..identification.inverse_dynamics import leg_wrenches
from ..identification.prepare import MeasuredTest
from ..laws.lines import filter_shares
from ..laws.tabulated import NODES
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.pose import leg_displacements, plant_motion
from .acceptance import Reweighting
from .formula import Formula, sparse_formula
from .scores import make_block, score

__all__ = ["ResidualFunction", "fit_residual_functions", "with_residual_function"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
State = Literal["position", "velocity", "recent travel", "past position"]

_FAMILY: dict[State, str] = {
    "position": "unnamed_by_position",
    "velocity": "unnamed_by_speed",
    "recent travel": "unnamed_by_memory",
    "past position": "unnamed_by_memory",
}


@dataclass(frozen=True)
class ResidualFunction:
    """A free function of the state of legs, alike for all of them, fitted to what is left."""

    components: tuple[str, ...]
    state: State
    memory: float  # time constant [s] of what is remembered; 0 where nothing is
    nodes: Array  # (k,) [m or m/s]
    value: Array  # (k,) [N]
    sd: Array  # (k,)
    gain: float  # of log-likelihood, with what is left weighed anew
    beyond: float  # of log-likelihood, by what even doubtful noise would not have
    held_out: Array  # (t,) linear gain on each test, fitted on the others

    @property
    def unit(self) -> str:
        """Of the state."""
        return "m/s" if self.state == "velocity" else "m"

    @property
    def words(self) -> str:
        """The state in words."""
        return f"{self.state}, memory of {self.memory:g} s" if self.memory else self.state

    @property
    def formula(self) -> Formula:
        """The function in few words."""
        return sparse_formula(self.nodes, self.value, self.sd, self.unit)


def with_residual_function(machine: Machine, left: ResidualFunction) -> Machine:
    """The machine with the free function as an effect that is switched off: share = 1 switches it on."""
    family = _FAMILY[left.state]
    values = {f"force_{k + 1}": -float(v) for k, v in enumerate(left.value)}
    values |= {"first": float(left.nodes[0]), "last": float(left.nodes[-1])}
    if left.memory:
        values |= {"memory": left.memory, "past": float(left.state == "past position")}
    name = f"{family}_{'_'.join(left.components)}"
    return machine.with_effect(family, left.components, name=name, share=0.0, **values)


def fit_residual_functions(
    base: OperatingPoint, weigh: Reweighting, numbers: Parameters
) -> tuple[ResidualFunction, ...]:
    """Free functions of every leg's states and of those of all legs of a kind, by falling gain."""
    problem = weigh.problem
    seen = [_legs(base, t) for t in range(len(base.tests))]
    kinds: dict[str, list[int]] = {}
    for i, component in enumerate(base.plant.machine.components):
        kinds.setdefault(component.kind, []).append(i)
    found = []
    for members in kinds.values():
        for state, memory in _states(numbers):
            along = [_state(state, memory, *legs, test.dt) for (legs, _), test in zip(seen, base.tests, strict=True)]
            low, high = (f([f(x[:, members]) for x in along]) for f in (np.min, np.max))
            if state != "velocity" and high - low < numbers.number("left.travel"):
                continue
            nodes = np.linspace(low, high, NODES)
            each = []
            for i in members:
                wrenches = [
                    -w[:, i, :, None] * _hats(x[:, i], nodes)[:, None, :] for (_, w), x in zip(seen, along, strict=True)
                ]
                each.append([_whitened(problem, t, base.tests[t], w) for t, w in enumerate(wrenches)])
            names = [base.plant.machine.components[i].name for i in members]
            make = partial(_fitted, weigh, numbers, state, memory, nodes)
            found += [make((name,), columns) for name, columns in zip(names, each, strict=True)]
            if len(members) > 1:
                found.append(make(tuple(names), [np.sum(parts, axis=0) for parts in zip(*each, strict=True)]))
    return tuple(sorted(found, key=lambda left: -left.gain))


def _fitted(
    weigh: Reweighting,
    numbers: Parameters,
    state: State,
    memory: float,
    nodes: Array,
    components: tuple[str, ...],
    columns: Sequence[Complex],
) -> ResidualFunction:
    """The function whose values are worth these columns (m, c, k) of each test."""
    background, free = weigh.background, np.full(NODES, np.inf)
    spread = np.full(NODES, numbers.number("left.spread"))
    one = score(background, make_block(background, columns), -free, free, spread)
    less = weigh.lowered(background.explained(columns, one.amplitude), one)
    return ResidualFunction(
        components, state, memory, nodes, one.amplitude, one.sd, less.gain, less.beyond, one.held_out
    )


def _states(numbers: Parameters) -> Iterator[tuple[State, float]]:
    """States of legs, with the time constants of those that remember."""
    yield "position", 0.0
    yield "velocity", 0.0
    for memory in numbers.vector("left.memories"):
        yield "recent travel", float(memory)
        yield "past position", float(memory)


def _state(state: State, memory: float, position: Array, velocity: Array, dt: float) -> Array:
    """A state (n, legs) of legs at these elongations and their rates."""
    if state == "velocity":
        return velocity
    if not memory:
        return position
    from scipy.signal import lfilter

    stay, first, last = filter_shares(dt, memory)
    start = (1.0 - last) * position[0]  # at rest where it begins
    past, _ = lfilter([last, first], [1.0, -stay], position, axis=0, zi=start[None])
    return np.asarray(past if state == "past position" else position - past)


def _legs(base: OperatingPoint, t: int) -> tuple[tuple[Array, Array], Array]:
    """Elongations and their rates (n, legs) and wrenches of unit forces (n, legs, 6) of a test."""
    motion = base.tests[t].motion
    moved = leg_displacements(base.plant, motion.displacement, motion.velocity)
    return moved, leg_wrenches(base.plant, plant_motion(base.plant, motion).q, np.ones_like(moved[0]))


def _hats(x: Array, nodes: Array) -> Array:
    """Values (n, k) of the piecewise linear functions that are one at one node each."""
    step = nodes[1] - nodes[0]
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(x[:, None] - nodes) / step))


def _whitened(problem: Problem, t: int, test: MeasuredTest, wrench: Array) -> Complex:
    """Columns (m, c, k) of wrenches (n, 6, k)."""
    n, axes, count = wrench.shape
    c = problem.comparison
    bins, f = spectrum_of(wrench.reshape(n, -1), test.dt, c.bands[0], c.bands[-1], c.edge)
    out = np.zeros((len(f), sum(problem.widths), count), np.complex128)
    out[:, problem.rows("wrench")] = bins.reshape(len(f), axes, count)
    return problem.whitener.apply(t, out, f)
