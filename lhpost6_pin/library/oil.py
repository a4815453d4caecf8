"""What oil does beyond the report's equations."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..machine import Machine

__all__ = ["BUILD"]


def _piston_leakage(machine: "Machine", components: Sequence[str], values: Mapping[str, float]) -> Any:
    return "extra_leakage", components, [(values["leakage"],)] * len(components)


BUILD = {"piston_leakage": _piston_leakage}
