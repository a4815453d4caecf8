"""Result of a calibration."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array, Mask
from ...core.files import models_folder
from ...machine.machine import Machine
from ...machine.parameters import Parameters, load_parameters
from .free_parameters import FreeParameter, with_parameters
from .sensor_errors import SensorUnknown

__all__ = ["Calibration", "Subset", "calibration_numbers"]


class Subset(NamedTuple):
    """Estimate from one group of residuals, or from simulation, alone; NaN where it is not informative."""

    name: str  # such as "gas law", "flow, horizontal", "wrench, x"
    estimate: Array  # (p,)
    sd: Array  # (p,) predicted deviations
    part: bool = True  # of all together; simulation is not


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration; p unknowns: parameters, then sensor errors."""

    machine: Machine
    campaign: str
    tests: tuple[str, ...]
    parameters: tuple[FreeParameter, ...]
    unknowns: tuple[SensorUnknown, ...]
    prior: Array  # (p,) standard deviations
    estimate: Array  # (p,) coordinates
    covariance: Array  # (p, p) predicted
    alone: Array  # (n_tests, p) predicted deviations if there were only that test
    subsets: tuple[Subset, ...]
    misfit_before: Array  # (n_tests, n_kinds) mean square of the whitened residuals, one where only noise is left
    misfit_after: Array
    rounds: int
    converged: bool
    numbers: Parameters = field(repr=False)

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

    def alike(self) -> list[tuple[str, str, float]]:
        """Strongly correlated pairs of unknowns with their correlation, strongest first."""
        sd = self.sd
        correlation = self.covariance / np.outer(sd, sd)
        pairs = np.argwhere(np.triu(np.abs(correlation) >= self.numbers.number("report.alike"), 1))
        found = [(self.names[i], self.names[j], float(correlation[i, j])) for i, j in pairs]
        return sorted(found, key=lambda pair: -abs(pair[2]))


def calibration_numbers() -> Parameters:
    """Numbers of `models/procedures/calibration.toml`."""
    return load_parameters(models_folder() / "procedures" / "calibration.toml")
