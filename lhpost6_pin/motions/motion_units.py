"""Units of ground-motion files, converted to SI."""

import math

import numpy as np

from ..core.errors import MotionError
from ..core.units import Unit, parse_unit, quantity_unit
from .motion import AXES

__all__ = ["acceleration_in_si", "is_motion_unit", "to_si", "unit_of_column"]

_QUANTITIES = {"m/s2": "acceleration", "m": "displacement", "rad/s2": "acceleration", "rad": "displacement"}


def is_motion_unit(text: str) -> bool:
    """Whether a text is a unit of displacement, velocity or acceleration, of a translation or rotation."""
    si = quantity_unit(text) or quantity_unit(text.lower())
    return si in (*_QUANTITIES, "m/s", "rad/s")


def unit_of_column(own: str, stated: str | None, where: str) -> str:
    """Unit of a column of a file that states `own` ("" if it does not), with the unit `stated` of it by an option.

    Text of the file that is no unit of a motion gives way to the option. Raises MotionError if the two differ.
    """
    if stated is None or not is_motion_unit(own):
        return own if stated is None else stated
    given, known = _unit(stated), _unit(own)
    if given and known and not (given[1:] == known[1:] and math.isclose(given.factor, known.factor)):
        raise MotionError(
            f"{where}: states the unit {own}, and --unit is {stated}; leave --unit out, or correct the unit in the file"
        )
    return stated


def _unit(text: str) -> Unit | None:
    return parse_unit(text) or parse_unit(text.lower())


def to_si(values: np.ndarray, text: str, axis: str) -> tuple[np.ndarray, str]:
    """Values (n,) in unit `text` as SI for `axis`, and the quantity of the unit.

    The quantity is "acceleration" [m/s^2, rad/s^2] or "displacement" [m, rad]. `g` is standard gravity (never gram);
    `m_s2`, `m/s2`, `cm/sec^2`, `m/s/s` are all understood. Raises MotionError for a unit that is unknown or cannot
    belong to the axis.
    """
    unit = _unit(text)
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
