"""Numbers and references by which tests are compared."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ...control import ControllerSettings
from ...core.files import models_folder
from ...data.sensors import SensorSet
from ...data.signals import Band
from ...machine.parameters import Parameters, load_parameters
from ...mechanics.linearize import OilColumnMode

__all__ = ["ComparisonBasis", "Numbers", "validation_numbers"]


@dataclass(frozen=True)
class Numbers:
    """Numbers of `models/procedures/validate.toml`."""

    stated: Parameters

    def number(self, path: str) -> float:
        """Number at a path of the file."""
        return self.stated.number(path)

    @property
    def band(self) -> Band:
        """Filter of all that is compared."""
        return Band(high=self.number("comparison.high"), order=int(self.number("comparison.order")))

    @property
    def edge(self) -> float:
        """Cut off at both ends of a test [s]."""
        return self.number("comparison.edge")

    @property
    def longest_delay(self) -> float:
        """Longest delay between model and measurement that is searched [s]."""
        return self.number("comparison.longest_delay")

    @property
    def bands(self) -> tuple[float, ...]:
        """Edges of the bands of spectra [Hz]."""
        return self.stated.vector("spectra.edges")

    @property
    def shortest(self) -> float:
        """Length of a test that is long enough to be compared [s]: for the longest delay and the edges."""
        return 8 * self.longest_delay + 4 * self.edge


class ComparisonBasis(NamedTuple):
    """What all tests of a campaign are compared with."""

    sensors: SensorSet
    numbers: Numbers
    modes: Sequence[OilColumnMode]  # oil columns of the linear model
    settings: ControllerSettings | None  # in place of those that records name


def validation_numbers() -> Numbers:
    """Read `models/procedures/validate.toml`."""
    return Numbers(load_parameters(models_folder() / "procedures" / "validate.toml"))
