"""Units of ground-motion files: their spellings in headers and column names, converted with pint."""

import re

import numpy as np

from ..core.errors import MotionError
from .motion import AXES

__all__ = ["to_si"]

# A header is input from outside: only plain products of powers reach the unit parser.
_UNIT = re.compile(r"[a-zµμ%°]+((\^|\*\*)?-?[1-4])?([/*][a-z]+((\^|\*\*)?-?[1-4])?){0,3}")
_SPELLINGS = {"g": "standard_gravity", "gal": "cm/s**2", "sec": "s", "secs": "s", "°": "degree"}
_TARGETS = {  # (axis is a rotation, quantity): unit of this package
    (False, "acceleration"): "m/s**2",
    (False, "displacement"): "m",
    (True, "acceleration"): "rad/s**2",
    (True, "displacement"): "rad",
}


def to_si(values: np.ndarray, text: str, axis: str) -> tuple[np.ndarray, str]:
    """Values (n,) in unit `text` as SI for `axis`, and the quantity the unit means.

    The quantity is "acceleration" [m/s^2, rad/s^2] or "displacement" [m, rad].

    `g` is standard gravity (never gram); `m_s2`, `m/s2`, `cm/sec^2`, `m/s/s` are all understood.
    Raises MotionError for a unit that is unknown or cannot belong to the axis.
    """
    import pint

    rotation = AXES.index(axis) >= 3
    spelled = text.strip().lower().replace(" ", "")
    if re.fullmatch(r"[a-z]+(_[a-z]+\d?)+", spelled):  # column-name spelling: m_s2
        spelled = spelled.replace("_", "/")
    wanted = "rad/s^2 (deg/s^2) or rad (deg)" if rotation else "m/s^2 (g, cm/s^2, gal) or m (cm, mm)"
    problem = MotionError(f"unit {text!r} does not fit axis {axis}; give {wanted}")
    # pint counts angles as plain numbers, so a rotation must name its angle
    if not _UNIT.fullmatch(spelled) or (rotation and not re.search("rad|deg|°", spelled)):
        raise problem
    tokens = re.sub(r"[a-zµμ%°]+", lambda match: _SPELLINGS.get(match[0], match[0]), spelled)
    tokens = re.sub(r"(?<=[a-zµμ])(-?\d)", r"**\1", tokens)
    registry = pint.get_application_registry()
    for (is_rotation, quantity), target in _TARGETS.items():
        if is_rotation != rotation:
            continue
        try:
            unit = registry.Unit(tokens)
            if unit.dimensionality == registry.Unit(target).dimensionality:
                factor = float(registry.Quantity(1.0, unit).to(target).magnitude)
                with np.errstate(over="ignore"):  # what becomes infinite is refused with its sample number
                    return values * factor, quantity
        except Exception as error:  # pint raises many kinds on text it cannot parse; the user needs one
            raise problem from error
    raise problem
