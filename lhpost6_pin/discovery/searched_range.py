"""The range of elongations that a search has seen: beyond it, an effect found is extrapolated.

What a stiffening shows near its start fixes no force far behind it. Held-out tests judge an effect over a leg's
displacement where that leg is no farther out than in the tests searched.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array, Mask
from ..identification.calibration.problem import Problem
from ..identification.prepare import MeasuredTest
from ..mechanics.plant import Plant
from ..mechanics.pose import leg_displacements
from .search_state import Search

__all__ = ["Beyond", "beyond_search", "within_search"]

BLEND = 0.2
"""Time [s] over which the weight of a wrench falls to zero before a leg is out of its range."""

SLACK = 1.05
"""Elongation over the largest one searched up to which a leg is within its range: sensors err, and tests repeat."""


class Beyond(NamedTuple):
    """A leg with an effect over its displacement that a held-out test moves farther than the tests searched."""

    family: str
    component: str
    test: str
    reached: float  # [m] largest elongation, either way
    searched: float  # [m] the same in the tests searched


def beyond_search(found: Search, held: Problem) -> tuple[Beyond, ...]:
    """Legs whose effects are extrapolated in held-out tests."""
    searched, every = _extremes(found), []
    for test in held.tests:
        farthest = np.abs(_elongations(found, test)).max(axis=0)
        for one in found.added:
            for leg in _legs_of(one.candidate.family.over, one.candidate.components, found):
                if farthest[leg] > SLACK * (most := float(np.abs(searched[:, leg]).max())):
                    name = found.problem.machine.components[leg].name
                    every.append(Beyond(one.candidate.family.named, name, test.name, float(farthest[leg]), most))
    return tuple(every)


def within_search(found: Search, held: Problem) -> Problem:
    """Held-out tests whose wrench weighs nothing where a leg is out of its range; the same where all are within."""
    legs = {leg for one in found.added for leg in _legs_of(one.candidate.family.over, one.candidate.components, found)}
    if not legs:
        return held
    low, high = SLACK * _extremes(found)[:, sorted(legs)]
    tests = []
    for test in held.tests:
        out = _elongations(found, test)[:, sorted(legs)]
        inside = ((out >= low) & (out <= high)).all(axis=1)
        weight = np.ones(test.samples) if test.weight is None else test.weight
        tests.append(test if inside.all() else replace(test, weight=weight * _blended(inside, test.dt)))
    return held.with_tests(tests)


def _legs_of(over: str, components: Sequence[str], found: Search) -> list[int]:
    """Legs on which an effect over displacement acts; none for one over another state or of the platen."""
    names = [component.name for component in found.problem.machine.components]
    return [names.index(name) for name in components if name in names] if over == "displacement" else []


def _plant(found: Search) -> Plant:
    return found.problem.plant_at(found.solution.x)


def _elongations(found: Search, test: MeasuredTest) -> Array:
    """Elongations (n, legs) [m] along a test."""
    return leg_displacements(_plant(found), test.motion.displacement)[0]


def _extremes(found: Search) -> Array:
    """Least and largest elongation (2, legs) [m] of the tests searched."""
    each = [_elongations(found, test) for test in found.problem.tests]
    return np.array([np.min([x.min(axis=0) for x in each], axis=0), np.max([x.max(axis=0) for x in each], axis=0)])


def _blended(inside: Mask, dt: float) -> Array:
    """Weight (n,): zero outside, one farther than `BLEND` inside, smooth between."""
    from scipy.ndimage import distance_transform_edt

    if inside.all():
        return np.ones(len(inside))
    into = np.minimum(distance_transform_edt(inside) * dt / BLEND, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * into))
