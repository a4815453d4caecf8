"""What a calibration says of each unknown, in a word, and where single groups of residuals contradict all together."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .knobs import knob_changes
from .result import Calibration

__all__ = ["Contradiction", "Verdict", "beyond", "changed_knobs", "contradictions", "cut_strokes", "far", "verdict_on"]

Array = NDArray[np.float64]
Verdict = Literal["at its bound", "changed", "unchanged", "not informed"]


def far(calibration: Calibration) -> Array:
    """Estimates (p,) in predicted deviations from the nominal machine and from sensors without error."""
    return np.asarray(calibration.estimate / calibration.sd)


def beyond(calibration: Calibration) -> NDArray[np.bool_]:
    """Sensor errors that differ from zero by more than the limit; parameters that do so and by a material amount."""
    material = calibration.numbers.number("report.material") * calibration.prior
    material[len(calibration.knobs) :] = 0.0
    return np.asarray((np.abs(far(calibration)) > calibration.limit) & (np.abs(calibration.estimate) > material))


def verdict_on(calibration: Calibration, i: int) -> Verdict:
    """The verdict on unknown i; the first that holds.

    At its bound: as far from nominal as the fit lets it go, by its prior or by what can be built. Changed: `beyond`.
    Unchanged: the campaign has told something of it, and it is nearer than that.
    """
    count, prior, x = len(calibration.knobs), calibration.prior[i], calibration.estimate[i]
    reach = calibration.numbers.number("fit.reach" if i < count else "fit.sensor_reach") * prior
    low, high = -reach, reach
    if i < count:
        low, high = max(low, calibration.knobs[i].lowest), min(high, calibration.knobs[i].highest)
    if not low + 1e-6 * prior < x < high - 1e-6 * prior:
        return "at its bound"
    if beyond(calibration)[i]:
        return "changed"
    return "unchanged" if calibration.informed[i] else "not informed"


def changed_knobs(calibration: Calibration) -> list[int]:
    """Knobs that differ from nominal (`beyond`), the clearest first."""
    distance, changed = np.abs(far(calibration))[: len(calibration.knobs)], beyond(calibration)
    return [int(i) for i in np.argsort(-distance, kind="stable") if changed[i]]


def cut_strokes(calibration: Calibration) -> list[str]:
    """A sentence on every stroke that had to give way to a chamber found shorter."""
    machine, count = calibration.machine, len(calibration.knobs)
    turned = {path for knob in calibration.knobs for path, _ in knob.paths}
    said = []
    for path, value in knob_changes(machine, calibration.knobs, calibration.estimate[:count]).items():
        if path not in turned:
            stated = machine.parameters.number(path)
            said.append(f"{path}, stated as {stated:g} m, is cut to {value:.4g} m: a chamber was found to be shorter.")
    return said


class Contradiction(NamedTuple):
    """A group of residuals that by itself says something else than all together."""

    subset: str
    unknown: int
    deviations: float  # signed distance, in deviations of what it would be if noise were all


def contradictions(calibration: Calibration) -> list[Contradiction]:
    """Estimates of single groups that differ from those of all by more than the limit, farthest first.

    The variance of the difference is that of the group less that of all (Hausman, Econometrica 46, 1978), since the
    group is part of all; no less than what the search leaves open. Of simulation, which is no part, they add up.
    """
    left_open = calibration.numbers.number("fit.converged") * calibration.sd
    found = []
    for subset in calibration.subsets:
        sign = -1.0 if subset.part else 1.0
        variance = np.maximum(subset.sd**2 + sign * calibration.sd**2, left_open**2)  # NaN where it tells nothing
        distance = (subset.estimate - calibration.estimate) / np.sqrt(variance)
        for i in np.flatnonzero(np.abs(distance) > calibration.limit):
            found.append(Contradiction(subset.name, int(i), float(distance[i])))
    return sorted(found, key=lambda one: -abs(one.deviations))
