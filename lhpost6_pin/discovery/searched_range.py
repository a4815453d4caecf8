"""The range of elongations that a search has seen: beyond it, an effect found is extrapolated.

What a stiffening shows near its start fixes no force far behind it. Held-out tests judge an effect over a leg's
displacement where that leg is no farther out than in the tests searched.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array, Mask
from ..identification.calibration.problem import Problem
from ..identification.prepare import MeasuredTest
from ..mechanics.plant import Plant
from ..mechanics.pose import leg_displacements
from .search_state import AddedEffect, Search

__all__ = ["Beyond", "beyond_search", "within_search"]

BLEND = 0.2
"""Time [s] over which the weight of a wrench falls to zero before a leg is out of its range."""

SLACK = 0.03
"""Share of a leg's range by which it may be farther out: sensors err, and no test repeats another exactly."""


class Beyond(NamedTuple):
    """A leg with an effect over its displacement that a held-out test moves farther than the tests searched."""

    family: str
    component: str
    test: str
    reached: float  # [m] largest elongation, either way
    searched: float  # [m] the same in the tests searched


def beyond_search(found: Search, held: Problem) -> tuple[Beyond, ...]:
    """Legs whose effects are extrapolated in held-out tests."""
    names = [component.name for component in found.problem.machine.components]
    plant, every = found.problem.plant_at(found.solution.x), list[Beyond]()
    extremes = _extremes(found, plant)
    for test in held.tests:
        out = _elongations(plant, test)
        far = ~np.all(_inside(out, extremes), axis=0)
        for one in found.added:
            for leg in (leg for leg in _legs_of(found, one) if far[leg]):
                reached, searched = (float(np.abs(x[:, leg]).max()) for x in (out, extremes))
                every.append(Beyond(one.candidate.family.named, names[leg], test.name, reached, searched))
    return tuple(every)


def within_search(found: Search, held: Problem) -> Problem:
    """Held-out tests whose wrench weighs nothing where a leg is out of its range; the same where all are within."""
    legs = sorted({leg for one in found.added for leg in _legs_of(found, one)})
    if not legs:
        return held
    plant, tests = found.problem.plant_at(found.solution.x), []
    extremes = _extremes(found, plant)[:, legs]
    for test in held.tests:
        inside = np.all(_inside(_elongations(plant, test)[:, legs], extremes), axis=1)
        weight = np.ones(test.samples) if test.weight is None else test.weight
        tests.append(test if inside.all() else replace(test, weight=weight * _blended(inside, test.dt)))
    return held.with_tests(tests)


def _legs_of(found: Search, one: AddedEffect) -> list[int]:
    """Legs on which an effect over displacement acts; none for one over another state or of the platen."""
    legs = [component.name for component in found.problem.machine.components]
    over = one.candidate.family.over == "displacement"
    return [legs.index(name) for name in one.candidate.components if over and name in legs]


def _elongations(plant: Plant, test: MeasuredTest) -> Array:
    """Elongations (n, legs) [m] along a test."""
    return leg_displacements(plant, test.motion.displacement)[0]


def _extremes(found: Search, plant: Plant) -> Array:
    """Least and largest elongation (2, legs) [m] of the tests searched."""
    each = [_elongations(plant, test) for test in found.problem.tests]
    return np.array([np.min([x.min(axis=0) for x in each], axis=0), np.max([x.max(axis=0) for x in each], axis=0)])


def _inside(out: Array, extremes: Array) -> Mask:
    """Which elongations (n, k) are between extremes (2, k), or hardly beyond them."""
    low, high = extremes
    slack = SLACK * (high - low)
    return np.asarray((out >= low - slack) & (out <= high + slack))


def _blended(inside: Mask, dt: float) -> Array:
    """Weight (n,): zero outside, one farther than `BLEND` inside, smooth between; `inside` is not all."""
    from scipy.ndimage import distance_transform_edt

    into = np.minimum(distance_transform_edt(inside) * dt / BLEND, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * into))
