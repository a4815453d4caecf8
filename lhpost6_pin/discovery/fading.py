"""Fading: whether the force of a spring or an end stop that was found fades while it is held, which theirs does not.

Beside such a force f, what fades of it in a time T, f - y with T dy/dt + y = f (a spring in series with a damper), is
one more column of the background. It explains noise alone where the force is elastic; and much where it is that of a
viscoelastic mount, of which a plain spring leaves little in short tests.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..identification.residual_change import Evaluated, change_of
from ..identification.residuals import follow
from ..mechanics.plant import make_plant
from .acceptance import Reweighting
from .candidate_columns import whitened_rows
from .candidates import Candidate
from .residual_function import remembered
from .scores import make_block, score
from .search_state import AddedEffect, Linearisation, Search

__all__ = ["Fading", "fading_effects"]


class Fading(NamedTuple):
    """An effect whose force fades."""

    candidate: Candidate
    memory: float  # time constant [s] that explains most, of those tried
    gain: float  # of log-likelihood


def fading_effects(found: Search, linear: Linearisation) -> tuple[Fading, ...]:
    """The elastic effects added whose force fades: by `left.fades` of `discovery.toml`, also in cross-validation."""
    elastic = [one for one in found.added if one.candidate.family.elastic]
    if not elastic:
        return ()
    n, weigh = found.numbers.number, Reweighting(found, linear.background)
    free, out = np.full(1, np.inf), list[Fading]()
    for one in elastic:
        wrenches, best = _wrenches(linear, one), Fading(one.candidate, 0.0, 0.0)
        for memory in found.numbers.vector("left.memories"):
            pairs = zip(wrenches, linear.base.tests, strict=True)
            faded = [wrench - remembered(wrench, float(memory), test.dt) for wrench, test in pairs]
            bins = [[weigh.problem.of_wrench(t, x[..., None])] for t, x in enumerate(faded)]
            columns = whitened_rows(weigh.problem, bins)
            own = score(linear.background, make_block(linear.background, columns), -free, free, free)
            less = weigh.lowered(linear.background.explained(columns, own.amplitude), own)
            if less.gain > best.gain and own.held_out.sum() > n("accept.held_out") * own.gain:
                best = Fading(one.candidate, float(memory), less.gain)
        if best.gain > n("left.fades"):
            out.append(best)
    return tuple(out)


def _wrenches(linear: Linearisation, one: AddedEffect) -> Sequence[Array]:
    """Wrench (n, 6) of an effect in every test."""
    base = linear.base
    plant = make_plant(base.plant.machine.without_effect(one.candidate.name))
    found = []
    for test, path, residuals in zip(base.tests, base.paths, base.residuals, strict=True):
        before = Evaluated(base.plant, test, path, residuals)
        found.append(change_of(before, plant, test, follow(plant, test, (base.plant, path)), ("wrench",)).wrench)
    return found
