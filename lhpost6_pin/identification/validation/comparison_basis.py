"""What all tests of a campaign are judged with."""

from collections.abc import Sequence
from typing import NamedTuple

from ...control import ControllerSettings
from ...data.sensors import SensorSet
from ...mechanics.linearize import OilColumnMode
from .metrics import Numbers

__all__ = ["ComparisonBasis"]


class ComparisonBasis(NamedTuple):
    """What all tests of a campaign are judged with."""

    sensors: SensorSet
    numbers: Numbers
    modes: Sequence[OilColumnMode]  # oil columns of the linear model
    settings: ControllerSettings | None  # of the controller, in place of those that records name
