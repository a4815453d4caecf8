"""Units of the page: every message, trip and entry of the journal states values in the units of its fields."""

import math

from ..core.names import AXES
from ..core.units import parse_unit
from ..motions.limits import Units

__all__ = ["PAGE_UNITS", "in_page_units", "place_unit"]

_GRAVITY = parse_unit("g")
assert _GRAVITY is not None
_DEGREES = math.degrees(1.0)

PAGE_UNITS: Units = {
    "m": ("mm", 1e3),
    "rad": ("deg", _DEGREES),
    "rad/s": ("deg/s", _DEGREES),
    "m/s^2": ("g", 1.0 / _GRAVITY.factor),
    "rad/s^2": ("deg/s^2", _DEGREES),
    "N": ("kN", 1e-3),
    "N m": ("kN m", 1e-3),
}
"""From SI; velocities along axes stay in m/s."""


def place_unit(axis: str) -> str:
    """SI unit of the displacement of an axis."""
    return "m" if axis in AXES[:3] else "rad"


def in_page_units(value: float, unit: str, digits: int = 6) -> str:
    """A value in SI as text of so many significant digits with the page's unit."""
    name, factor = PAGE_UNITS.get(unit, (unit, 1.0))
    return f"{factor * value:.{digits}g} {name}"
