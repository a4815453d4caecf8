"""Friction beyond the report's Bouc-Wen and viscous laws."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..machine import Machine

__all__ = ["BUILD"]


def _local_viscous(machine: "Machine", components: Sequence[str], values: Mapping[str, float]) -> Any:
    return "viscous", components, [(values["coefficient"],)] * len(components)


BUILD = {"local_viscous": _local_viscous}
