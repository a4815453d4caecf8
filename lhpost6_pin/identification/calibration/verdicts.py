"""The verdict of a calibration on each unknown, and subset estimates that differ from the joint estimate."""

from typing import Literal, NamedTuple

import numpy as np

from ...core.arrays import Array, Mask
from .result import Calibration

__all__ = ["Contradiction", "Verdict", "beyond", "changed_parameters", "contradictions", "far", "out_of_range"]
__all__ += ["stated_range", "verdict_on"]

Verdict = Literal["at its bound", "changed", "unchanged", "not informed"]


def far(calibration: Calibration) -> Array:
    """Estimates (p,) in predicted deviations from the nominal machine and perfect sensors."""
    return np.asarray(calibration.estimate / calibration.sd)


def beyond(calibration: Calibration) -> Mask:
    """Sensor errors that differ from zero by more than the limit; parameters that do so and by a material amount."""
    material = calibration.numbers.number("report.material") * calibration.prior
    material[len(calibration.parameters) :] = 0.0
    return np.asarray((np.abs(far(calibration)) > calibration.limit) & (np.abs(calibration.estimate) > material))


def verdict_on(calibration: Calibration, i: int) -> Verdict:
    """The verdict on unknown i; the first that holds.

    At its bound: at the limit set by its prior or by what can be built. Changed: `beyond`. Unchanged: identifiable and
    not beyond.
    """
    count, prior, x = len(calibration.parameters), calibration.prior[i], calibration.estimate[i]
    reach = calibration.numbers.number("fit.reach" if i < count else "fit.sensor_reach") * prior
    low, high = -reach, reach
    if i < count:
        low, high = max(low, calibration.parameters[i].lowest), min(high, calibration.parameters[i].highest)
    if not low + 1e-6 * prior < x < high - 1e-6 * prior:
        return "at its bound"
    if beyond(calibration)[i]:
        return "changed"
    return "unchanged" if calibration.informed[i] else "not informed"


def changed_parameters(calibration: Calibration) -> list[int]:
    """Parameters that differ from nominal (`beyond`), the clearest first."""
    distance, changed = np.abs(far(calibration))[: len(calibration.parameters)], beyond(calibration)
    return [int(i) for i in np.argsort(-distance, kind="stable") if changed[i]]


def out_of_range(calibration: Calibration) -> list[int]:
    """Sensor errors that are larger than the sensors' file allows, by more than the limit; the farthest first."""
    over = (np.abs(calibration.estimate) - stated_range(calibration)) / calibration.sd
    return [int(i) for i in np.argsort(-over, kind="stable") if over[i] > calibration.limit]


def stated_range(calibration: Calibration) -> Array:
    """Largest errors (p,) that the sensors' file allows: sqrt(3) deviations of a uniform one; infinite for parameters.

    A delay is against the platen's motion, which may be as late itself.
    """
    times = [2.0 if unknown.kind == "delay" else 1.0 for unknown in calibration.unknowns]
    return np.append(np.full(len(calibration.parameters), np.inf), np.sqrt(3.0) * np.array(times)) * calibration.prior


class Contradiction(NamedTuple):
    """A subset estimate that differs from the joint estimate."""

    subset: str
    unknown: int
    deviations: float  # signed difference over its standard deviation


def contradictions(calibration: Calibration) -> list[Contradiction]:
    """Subset estimates that differ from the joint ones by more than the limit, largest difference first.

    The variance of the difference is that of the subset less that of the joint estimate (Hausman, Econometrica 46,
    1978), since it is part of it; at least the convergence tolerance. For simulation, which is no part, the variances
    add up; it has a limit of its own.
    """
    tolerance = calibration.numbers.number("fit.converged") * calibration.sd
    simulation = calibration.numbers.number("simulation.deviations")
    found = []
    for subset in calibration.subsets:
        sign = -1.0 if subset.part else 1.0
        variance = np.maximum(subset.sd**2 + sign * calibration.sd**2, tolerance**2)  # NaN where not informative
        distance = (subset.estimate - calibration.estimate) / np.sqrt(variance)
        for i in np.flatnonzero(np.abs(distance) > (calibration.limit if subset.part else simulation)):
            found.append(Contradiction(subset.name, int(i), float(distance[i])))
    return sorted(found, key=lambda one: -abs(one.deviations))
