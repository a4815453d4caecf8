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

__all__ = ["ComparisonBasis", "HardlyMoving", "Numbers", "Resonances", "Spectra", "validation_numbers"]


class HardlyMoving(NamedTuple):
    """A column hardly moves below either of the first two."""

    noise: float  # times the sensor noise
    share: float  # of the column that moves most
    radius: float  # of rotations [m]


class Spectra(NamedTuple):
    """How spectra are estimated and averaged."""

    edges: tuple[float, ...]  # of bands [Hz]
    segment: float  # [s]
    noise: float  # times the sensor noise in a band, below which there is no ratio


class Resonances(NamedTuple):
    """How an oil-column peak is found."""

    search: float  # relative, about the model's frequency
    prominence: float  # power over the median of the searched band
    coherence: float  # of acceleration with spools, from which a peak counts


class ValveTransfer(NamedTuple):
    """How transfer functions of servovalves are estimated."""

    segment: float  # [s]
    coherence: float  # of a spool with its command, below which it is not shown


@dataclass(frozen=True)
class Numbers:
    """Numbers of `models/procedures/validate.toml`."""

    band: Band  # of all that is compared
    edge: float  # left out at both ends [s]
    longest_delay: float  # [s]
    significant_skew: float  # standard errors
    hardly: HardlyMoving
    spectra: Spectra
    resonance: Resonances
    valves: ValveTransfer
    reference_high: float  # [Hz]
    stated: Parameters

    @property
    def shortest(self) -> float:
        """Length of a test that is long enough to be compared [s]: for the longest delay sought, and its edges."""
        return 8 * self.longest_delay + 4 * self.edge


class ComparisonBasis(NamedTuple):
    """What all tests of a campaign are compared with."""

    sensors: SensorSet
    numbers: Numbers
    modes: Sequence[OilColumnMode]  # oil columns of the linear model
    settings: ControllerSettings | None  # in place of those that records name


def validation_numbers() -> Numbers:
    """Read `models/procedures/validate.toml`."""
    stated = load_parameters(models_folder() / "procedures" / "validate.toml")
    n = stated.number
    return Numbers(
        band=Band(high=n("comparison.high"), order=int(n("comparison.order"))),
        edge=n("comparison.edge"),
        longest_delay=n("comparison.longest_delay"),
        significant_skew=n("comparison.significant_skew"),
        hardly=HardlyMoving(*(n(f"hardly_moving.{name}") for name in HardlyMoving._fields)),
        spectra=Spectra(stated.vector("spectra.edges"), n("spectra.segment"), n("spectra.noise")),
        resonance=Resonances(*(n(f"resonance.{name}") for name in Resonances._fields)),
        valves=ValveTransfer(n("valves.segment"), n("valves.coherence")),
        reference_high=n("reference.high"),
        stated=stated,
    )
