"""Curves of friction and valves of all tests of a problem, by one model and by another."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from ..curves import FrictionCurve, ValveCurve, friction_curves, valve_curves
from .operating_point import OperatingPoint

__all__ = ["Curves", "measured_curves"]

_Curve = TypeVar("_Curve", FrictionCurve, ValveCurve)


@dataclass(frozen=True)
class Curves:
    """Friction by direction and valves by actuator, each by the name of the model; the last explains most."""

    tests: tuple[str, ...] = ()
    friction: Mapping[str, Mapping[str, FrictionCurve]] = field(default_factory=dict)
    valves: Mapping[str, Mapping[str, ValveCurve]] = field(default_factory=dict)


def measured_curves(models: Mapping[str, OperatingPoint]) -> Curves:
    """Curves of the tests of operating points, the tests one after the other."""
    tests = tuple(test.name for test in next(iter(models.values())).tests)
    return Curves(tests, _by_place(models, _friction), _by_place(models, _valves))


def _friction(base: OperatingPoint, t: int) -> dict[str, FrictionCurve]:
    return friction_curves(base.plant, base.tests[t], base.paths[t], base.residuals[t])


def _valves(base: OperatingPoint, t: int) -> dict[str, ValveCurve]:
    return valve_curves(base.plant, base.tests[t], base.paths[t])


def _by_place(
    models: Mapping[str, OperatingPoint], curves: Callable[[OperatingPoint, int], dict[str, _Curve]]
) -> dict[str, dict[str, _Curve]]:
    """Curves by direction or actuator, then by model, samples of all tests joined."""
    found: dict[str, dict[str, list[_Curve]]] = {}
    for name, base in models.items():
        for t in range(len(base.tests)):
            for place, curve in curves(base, t).items():
                found.setdefault(place, {}).setdefault(name, []).append(curve)
    return {
        place: {
            name: type(some[0])(*(np.concatenate(columns) for columns in zip(*some, strict=True)))
            for name, some in by_model.items()
        }
        for place, by_model in found.items()
    }
