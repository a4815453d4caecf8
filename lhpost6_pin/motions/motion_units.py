"""Units of ground-motion files, converted to SI."""

import numpy as np

from ..core.errors import MotionError
from ..core.units import parse_unit, quantity_unit
from .motion import AXES

__all__ = ["acceleration_in_si", "to_si"]

_QUANTITIES = {"m/s2": "acceleration", "m": "displacement", "rad/s2": "acceleration", "rad": "displacement"}


def to_si(values: np.ndarray, text: str, axis: str) -> tuple[np.ndarray, str]:
    """Values (n,) in unit `text` as SI for `axis`, and the quantity of the unit.

    The quantity is "acceleration" [m/s^2, rad/s^2] or "displacement" [m, rad]. `g` is standard gravity (never gram);
    `m_s2`, `m/s2`, `cm/sec^2`, `m/s/s` are all understood. Raises MotionError for a unit that is unknown or cannot
    belong to the axis.
    """
    unit = parse_unit(text) or parse_unit(text.lower())
    rotation = AXES.index(axis) >= 3
    si = quantity_unit(text) or quantity_unit(text.lower())
    if unit is None or si not in _QUANTITIES or si.startswith("rad") != rotation:
        wanted = "rad/s^2 (deg/s^2) or rad (deg)" if rotation else "m/s^2 (g, cm/s^2, gal) or m (cm, mm)"
        raise MotionError(f"unit {text!r} does not fit axis {axis}; give {wanted}")
    with np.errstate(over="ignore"):  # infinite values are refused with their sample number
        return values * unit.factor, _QUANTITIES[si]


def acceleration_in_si(values: np.ndarray, text: str, where: str, remedy: str) -> np.ndarray:
    """Accelerations (n,) [m/s^2] from unit `text`; raises MotionError naming `where` for any other unit."""
    try:
        values, quantity = to_si(values, text, "x")
    except MotionError as error:
        raise MotionError(f"{where}: {error}; {remedy}") from None
    if quantity != "acceleration":
        raise MotionError(f"{where}: unit {text} is not an acceleration; {remedy}")
    return values
