"""What is left when the library has been searched: a free function of a leg's position or speed.

A force along one leg that is a piecewise linear function of its position (or speed) is fitted with everything else, as
a candidate is. If it gains, on tests that it was not fitted on, too, something acts on that leg that has no name here.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..calibration.problem import Base, Problem
from ..calibration.spectra import spectrum_of
from ..inverse_dynamics import leg_wrenches
from ..law_table import NODES
from ..machine import Machine
from ..parameters import Parameters
from ..pose import leg_displacements
from ..residuals import Measured
from .formula import Formula, sparse_formula
from .screen import Background, make_block, score

__all__ = ["Left", "what_is_left", "with_unnamed"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
State = Literal["position", "velocity"]


@dataclass(frozen=True)
class Left:
    """A free function of one leg's state, fitted to what is left."""

    component: str
    state: State
    nodes: Array  # (k,) [m or m/s]
    value: Array  # (k,) [N]
    sd: Array  # (k,)
    gain: float  # of log-likelihood
    held_out: Array  # (t,) on each test, fitted on the others

    @property
    def unit(self) -> str:
        """Of the state."""
        return "m" if self.state == "position" else "m/s"

    @property
    def formula(self) -> Formula:
        """The function in few words."""
        return sparse_formula(self.nodes, self.value, self.sd, self.unit)


def with_unnamed(machine: Machine, left: Left) -> Machine:
    """The machine with the free function as an effect that is switched off: share = 1 switches it on."""
    family = {"position": "unnamed_by_position", "velocity": "unnamed_by_speed"}[left.state]
    values = {f"force_{k + 1}": -float(v) for k, v in enumerate(left.value)}
    ends = {"first": float(left.nodes[0]), "last": float(left.nodes[-1])}
    return machine.with_effect(
        family, (left.component,), name=f"{family}_{left.component}", share=0.0, **ends, **values
    )


def what_is_left(problem: Problem, base: Base, background: Background, numbers: Parameters) -> tuple[Left, ...]:
    """Free functions of every leg's position and of its speed, by falling gain."""
    seen = [_legs(base, t) for t in range(len(base.tests))]
    found = []
    for i, component in enumerate(base.plant.machine.components):
        states: tuple[State, ...] = ("position", "velocity")
        for s, state in enumerate(states):
            along = [legs[s][:, i] for legs, _ in seen]
            low, high = min(x.min() for x in along), max(x.max() for x in along)
            nodes = np.linspace(low, high, NODES)
            columns = []
            for t, (test, x) in enumerate(zip(base.tests, along, strict=True)):
                force = _hats(x, nodes)
                wrench = -seen[t][1][:, i, :, None] * force[:, None, :]
                columns.append(_whitened(problem, t, test, wrench))
            block = make_block(background, columns)
            free = np.full(NODES, np.inf)
            one = score(background, block, -free, free, np.full(NODES, numbers.number("left.spread")))
            found.append(Left(component.name, state, nodes, one.amplitude, one.sd, one.gain, one.held_out))
    return tuple(sorted(found, key=lambda left: -left.gain))


def _legs(base: Base, t: int) -> tuple[tuple[Array, Array], Array]:
    """Elongations and their rates (n, legs) and wrenches of unit forces (n, legs, 6) of a test."""
    motion = base.tests[t].motion
    moved = leg_displacements(base.plant, motion.displacement, motion.velocity)
    return moved, leg_wrenches(base.plant, base.paths[t].motion.q, np.ones_like(moved[0]))


def _hats(x: Array, nodes: Array) -> Array:
    """Values (n, k) of the piecewise linear functions that are one at one node each."""
    step = nodes[1] - nodes[0]
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(x[:, None] - nodes) / step))


def _whitened(problem: Problem, t: int, test: Measured, wrench: Array) -> Complex:
    """Columns (m, c, k) of wrenches (n, 6, k)."""
    n, axes, count = wrench.shape
    c = problem.comparison
    bins, f = spectrum_of(wrench.reshape(n, -1), test.dt, c.bands[0], c.bands[-1], c.edge)
    out = np.zeros((len(f), sum(problem.widths), count), np.complex128)
    out[:, problem.rows("wrench")] = bins.reshape(len(f), axes, count)
    return problem.whitener.apply(t, out, f)
