"""Residual function: a nonparametric function of a leg's state, fitted to the residual when the library is exhausted.

A force along a leg, or common to all legs of a kind, that is a piecewise linear function of position or velocity, of a
fading memory of positions or of the travel since, is fitted jointly like a candidate. If it gains, also in
cross-validation, an effect acts on those legs that the library does not contain.

The function is also stated as a sparse formula, a sum of a few simple forms of x over its largest value, so that every
coefficient has the function's own unit. Forms are added one by one while Schwarz's criterion falls.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..core.arrays import Array
from ..identification.calibration.sparse_bins import SparseBins
from ..identification.inverse_dynamics import leg_wrenches
from ..laws.lines import filter_shares
from ..laws.tabulated import NODES
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.pose import leg_displacements, plant_motion
from .acceptance import Reweighting
from .candidate_columns import whitened_rows
from .scores import make_block, score
from .search_state import Linearisation, Search

__all__ = [
    "Formula",
    "ResidualFunction",
    "fit_residual_functions",
    "remembered",
    "sparse_formula",
    "with_residual_function",
]

State = Literal["position", "velocity", "recent travel", "past position"]
Form = tuple[Array, tuple[str, ...]]

_MOST = 3  # forms of a formula
_SHORTEST = 4.0  # values in a wave, at least
_FAMILY: dict[State, str] = {
    "position": "unnamed_by_position",
    "velocity": "unnamed_by_speed",
    "recent travel": "unnamed_by_memory",
    "past position": "unnamed_by_memory",
}


@dataclass(frozen=True)
class Formula:
    """Sum of coefficient times form, and the share of the values' variance that it explains."""

    terms: tuple[tuple[float, str], ...]
    share: float

    def text(self, unit: str) -> str:
        """As one line, such as ``1.2e+04 N sin(2 pi x / 0.08 m)``."""
        return " + ".join(f"{size:.3g} {unit} {form}".rstrip() for size, form in self.terms)


@dataclass(frozen=True)
class ResidualFunction:
    """A function of the state of legs, common to all of them, fitted to the residual."""

    components: tuple[str, ...]
    state: State
    memory: float  # time constant [s] of the state; 0 where it has none
    nodes: Array  # (k,) [m or m/s]
    value: Array  # (k,) [N]
    sd: Array  # (k,)
    gain: float  # of log-likelihood, the residual reweighted
    beyond: float  # of log-likelihood, beyond `doubt` times the stated noise
    held_out: Array  # (t,) linear gain on each test, fitted on the others

    @property
    def unit(self) -> str:
        """Of the state."""
        return "m/s" if self.state == "velocity" else "m"

    @property
    def description(self) -> str:
        """The state in words."""
        return f"{self.state}, memory of {self.memory:g} s" if self.memory else self.state

    @property
    def formula(self) -> Formula:
        """A sparse formula of the function."""
        return sparse_formula(self.nodes, self.value, self.sd, self.unit)


def with_residual_function(machine: Machine, function: ResidualFunction) -> Machine:
    """The machine with the function as an effect that is switched off: share = 1 switches it on."""
    family = _FAMILY[function.state]
    values = {f"force_{k + 1}": -float(v) for k, v in enumerate(function.value)}
    values |= {"first": float(function.nodes[0]), "last": float(function.nodes[-1])}
    if function.memory:
        values |= {"memory": function.memory, "past": float(function.state == "past position")}
    name = f"{family}_{'_'.join(function.components)}"
    return machine.with_effect(family, function.components, name=name, share=0.0, **values)


def fit_residual_functions(found: Search, linear: Linearisation) -> tuple[ResidualFunction, ...]:
    """Functions of every leg's states and of those of all legs of a kind, by falling gain."""
    numbers, base, weigh = found.numbers, linear.base, Reweighting(found, linear.background)
    problem, background, components = weigh.problem, linear.background, base.plant.machine.components
    free, spread = np.full(NODES, np.inf), np.full(NODES, numbers.number("left.spread"))
    motions = []
    for test in base.tests:
        moved = leg_displacements(base.plant, test.motion.displacement, test.motion.velocity)
        unit = leg_wrenches(base.plant, plant_motion(base.plant, test.motion).q, np.ones_like(moved[0]))
        motions.append((test, moved, unit))  # elongations and rates (n, legs), wrenches (n, legs, 6) of unit forces

    def fitted(names: tuple[str, ...], bins: Sequence[SparseBins]) -> ResidualFunction:
        """The function whose values have these bins (k, p, m) of each test."""
        columns = whitened_rows(problem, [[one] for one in bins])
        one = score(background, make_block(background, columns), -free, free, spread)
        less = weigh.lowered(background.explained(columns, one.amplitude), one)
        return ResidualFunction(names, state, memory, nodes, one.amplitude, one.sd, *less[:2], one.held_out)

    functions = []
    for kind in dict.fromkeys(c.kind for c in components):
        members = [i for i, c in enumerate(components) if c.kind == kind]
        names = tuple(components[i].name for i in members)
        for state, memory in _states(numbers):
            along = [_state(state, memory, *moved, test.dt) for test, moved, _ in motions]
            low, high = (f([f(x[:, members]) for x in along]) for f in (np.min, np.max))
            if state != "velocity" and high - low < numbers.number("left.travel"):
                continue
            nodes = np.linspace(low, high, NODES)
            each = [
                [
                    problem.of_wrench(t, -unit[:, i, :, None] * _hats(x[:, i], nodes)[:, None, :])
                    for t, ((_, _, unit), x) in enumerate(zip(motions, along, strict=True))
                ]
                for i in members
            ]
            functions += [fitted((name,), columns) for name, columns in zip(names, each, strict=True)]
            if len(members) > 1:
                functions.append(fitted(names, [_sum(parts) for parts in zip(*each, strict=True)]))
    return tuple(sorted(functions, key=lambda one: -one.gain))


def _sum(parts: Sequence[SparseBins]) -> SparseBins:
    """Sum of bins in the same columns."""
    return parts[0]._replace(bins=np.sum([one.bins for one in parts], axis=0))


def _states(numbers: Parameters) -> Iterator[tuple[State, float]]:
    """States of legs, with the time constants of those with memory."""
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
    past = remembered(position, memory, dt)
    return past if state == "past position" else position - past


def remembered(x: Array, memory: float, dt: float) -> Array:
    """The fading memory y of a signal x (n, k), T dy/dt + y = x with T = `memory` [s]; at rest where it begins."""
    from scipy.signal import lfilter

    stay, first, last = filter_shares(dt, memory)
    start = (1.0 - last) * x[0]
    return np.asarray(lfilter([last, first], [1.0, -stay], x, axis=0, zi=start[None])[0])


def _hats(x: Array, nodes: Array) -> Array:
    """Values (n, k) of the piecewise linear functions that are one at one node each."""
    step = nodes[1] - nodes[0]
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(x[:, None] - nodes) / step))


def sparse_formula(x: Array, value: Array, sd: Array, unit: str) -> Formula:
    """Formula of values (n,) with deviations sd (n,) at x (n,), which has a unit."""
    weight = 1.0 / np.maximum(sd, 1e-12 * np.abs(value).max() + 1e-300)
    forms = _forms(x, unit)
    chosen: list[Form] = []
    best, squares, size = _fit(chosen, value, weight)
    while len(chosen) < _MOST:
        i = min(range(len(forms)), key=lambda i: _fit([*chosen, forms[i]], value, weight)[0])
        trial = _fit([*chosen, forms[i]], value, weight)
        if trial[0] >= best:
            break
        best, squares, size = trial
        chosen.append(forms.pop(i))
    labels = [label for _, names in chosen for label in names]
    middle = np.average(value, weights=weight**2)
    whole = float(np.sum((weight * (value - middle)) ** 2))
    share = 1.0 - squares / whole if whole > 0.0 else 0.0
    return Formula(tuple(zip(map(float, size), labels, strict=True)), max(0.0, share))


def _forms(x: Array, unit: str) -> list[Form]:
    """Columns (n, 1 or 2) and their names."""
    most = float(np.abs(x).max())
    z, at = x / most, f"(x / {most:.3g} {unit})"
    found: list[Form] = [
        (np.ones((len(x), 1)), ("",)),
        (z[:, None], (at,)),
        ((z * np.abs(z))[:, None], (f"{at} |{at[1:-1]}|",)),
        ((z**3)[:, None], (f"{at}^3",)),
        (np.abs(z)[:, None], (f"|{at[1:-1]}|",)),
        (np.sign(z)[:, None], ("sgn x",)),
        (np.tanh(10.0 * z)[:, None], (f"tanh(10 x / {most:.3g} {unit})",)),
    ]
    span = float(np.ptp(x))
    for length in span / np.arange(1.0, (len(x) - 1) / _SHORTEST + 0.01, 0.25):
        turn = 2.0 * np.pi * x / length
        names = tuple(f"{wave}(2 pi x / {length:.3g} {unit})" for wave in ("sin", "cos"))
        found.append((np.column_stack([np.sin(turn), np.cos(turn)]), names))
    return found


def _fit(forms: Sequence[Form], value: Array, weight: Array) -> tuple[float, float, Array]:
    """Schwarz's criterion (deviations known up to a common factor), weighted sum of squared residuals, coefficients."""
    squares = float(np.sum((weight * value) ** 2))
    size: Array = np.zeros(0)
    if forms:
        a = np.hstack([columns for columns, _ in forms])
        size = np.asarray(np.linalg.lstsq(a * weight[:, None], value * weight, rcond=None)[0], float)
        squares = float(np.sum((weight * (value - a @ size)) ** 2))
    count = len(value)
    return count * np.log(max(squares, 1e-300) / count) + len(size) * np.log(count), squares, size
