"""Result of a calibration: the verdict on each unknown, and subset estimates that differ from the joint estimate."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from ...core.arrays import Array, Mask
from ...core.files import models_folder
from ...core.shown import Shown
from ...data.campaign import SkippedTest
from ...machine.machine import Machine
from ...machine.parameters import Parameters, load_parameters
from .curves import Curves
from .free_parameters import FreeParameter, with_parameters
from .friction_forms import FrictionForms
from .scale import Ratio, Scale, ratios
from .sensor_errors import RemovedDelay, SensorUnknown, removed_of

__all__ = [
    "Calibration",
    "Contradiction",
    "Subset",
    "Verdict",
    "beyond",
    "calibration_numbers",
    "changed_parameters",
]
__all__ += ["contradictions", "far", "out_of_range", "stated_range", "verdict_on"]

Verdict = Literal["at its bound", "changed", "unchanged", "not informed"]


class Subset(NamedTuple):
    """Estimate from one group of residuals, or from simulation, alone; NaN where it is not informative."""

    name: str  # such as "gas law", "flow, horizontal", "wrench, x"
    estimate: Array  # (p,)
    sd: Array  # (p,) predicted deviations
    part: bool = True  # of all together; simulation is not


@dataclass(frozen=True, repr=False)
class Calibration(Shown):
    """Result of a calibration; p unknowns: parameters, then sensor errors."""

    machine: Machine
    campaign: str
    tests: tuple[str, ...]
    parameters: tuple[FreeParameter, ...]
    unknowns: tuple[SensorUnknown, ...]
    prior: Array  # (p,) standard deviations
    estimate: Array  # (p,) coordinates; of delays with what was removed before the fit
    covariance: Array  # (p, p) predicted
    alone: Array  # (n_tests, p) predicted deviations if there were only that test
    subsets: tuple[Subset, ...]
    misfit_before: Array  # (n_tests, n_kinds) mean square of the whitened residuals, one where only noise is left
    misfit_after: Array
    rounds: int
    converged: bool
    numbers: Parameters = field(repr=False)
    curves: Curves = field(default_factory=Curves, repr=False)  # as delivered, and calibrated
    skipped: tuple[SkippedTest, ...] = ()  # tests that were not used
    delays: tuple[RemovedDelay, ...] = ()  # that redundant channels show, removed first
    scale: Scale | None = None  # that nothing measured fixes
    friction: FrictionForms | None = None  # forms compared on held-out tests; None where that does not apply

    @property
    def sd(self) -> Array:
        """Predicted standard deviations (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return (*(k.name for k in self.parameters), *(u.name for u in self.unknowns))

    @property
    def limit(self) -> float:
        """Predicted deviations beyond which an estimate counts as different."""
        return self.numbers.number("report.deviations")

    @property
    def noise_alone(self) -> float:
        """Misfit up to which the residual counts as noise."""
        return self.numbers.number("report.misfit")

    @property
    def informed(self) -> Mask:
        """Identifiable unknowns (p,): predicted deviation well below the prior."""
        return np.asarray(self.sd < self.numbers.number("report.informed") * self.prior)

    @property
    def calibrated(self) -> Machine:
        """The machine with its parameters set to the estimates."""
        return with_parameters(self.machine, self.parameters, self.estimate[: len(self.parameters)])

    def interval(self, i: int, probability: float = 0.9) -> tuple[float, float]:
        """Confidence interval of parameter i in its unit; NaN where the fit did not converge."""
        from scipy.stats import norm

        if not self.converged:
            return np.nan, np.nan
        reach = float(norm.ppf(0.5 + 0.5 * probability)) * self.sd[i]
        low, high = (self.parameters[i].at(self.estimate[i] + side * reach) for side in (-1.0, 1.0))
        return min(low, high), max(low, high)

    def ratios(self) -> dict[str, Ratio]:
        """Ratios of identifiable parameters to a number of the machine whose scale nothing measured fixes."""
        informed = [i for i, _ in enumerate(self.parameters) if self.informed[i]]
        each = ((self.parameters[i], self.estimate[i], self.interval(i)) for i in informed)
        return ratios(self.scale, ((p.name, p.unit, p.at(float(x)), *ends) for p, x, ends in each))

    def correlated_pairs(self) -> list[tuple[str, str, float]]:
        """Strongly correlated pairs of unknowns with their correlation, strongest first."""
        sd = self.sd
        correlation = self.covariance / np.outer(sd, sd)
        pairs = np.argwhere(np.triu(np.abs(correlation) >= self.numbers.number("report.alike"), 1))
        found = [(self.names[i], self.names[j], float(correlation[i, j])) for i, j in pairs]
        return sorted(found, key=lambda pair: -abs(pair[2]))


def calibration_numbers() -> Parameters:
    """Numbers of `models/procedures/calibration.toml`."""
    return load_parameters(models_folder() / "procedures" / "calibration.toml")


def far(calibration: Calibration) -> Array:
    """Estimates (p,) in predicted deviations from the nominal machine and perfect sensors."""
    return np.asarray(calibration.estimate / calibration.sd)


def beyond(calibration: Calibration) -> Mask:
    """Sensor errors that differ from zero by more than the limit; identifiable parameters that do so materially.

    A parameter that is not identifiable moves with what others, or errors of the model, make of it: no finding.
    """
    count = len(calibration.parameters)
    material = calibration.numbers.number("report.material") * calibration.prior
    material[count:] = 0.0
    known = calibration.informed | (np.arange(len(material)) >= count)
    return np.asarray(
        (np.abs(far(calibration)) > calibration.limit) & (np.abs(calibration.estimate) > material) & known
    )


def verdict_on(calibration: Calibration, i: int) -> Verdict:
    """The verdict on unknown i; the first that holds.

    At its bound: at the limit set by its prior or by what can be built, but for a lowest value that is an estimate like
    any other. Changed: `beyond`. Unchanged: identifiable and not beyond. Not informed: all others, wherever they moved.
    """
    count, prior, x = len(calibration.parameters), calibration.prior[i], calibration.estimate[i]
    reach = calibration.numbers.number("fit.reach" if i < count else "fit.sensor_reach") * prior
    low, high = -reach, reach
    if i < count:
        one = calibration.parameters[i]
        low = -np.inf if one.natural and one.lowest > low else max(low, one.lowest)
        high = min(high, one.highest)
    else:
        x -= removed_of(calibration.unknowns, calibration.delays)[0][i - count]
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

    def values(self, calibration: "Calibration") -> tuple[float, float, str]:
        """Estimates of the unknown, by the subset and jointly, and their unit."""
        subset = next(one for one in calibration.subsets if one.name == self.subset)
        alone, joint = (float(x[self.unknown]) for x in (subset.estimate, calibration.estimate))
        if self.unknown >= len(calibration.parameters):
            return alone, joint, calibration.unknowns[self.unknown - len(calibration.parameters)].unit
        parameter = calibration.parameters[self.unknown]
        return parameter.at(alone), parameter.at(joint), parameter.unit


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
