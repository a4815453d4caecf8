"""Units of channels: in the names of columns, and their factors to the units of a record."""

import re

from ...core.errors import RecordError
from ...core.units import parse_unit, quantity_unit

__all__ = ["si_factor", "time_unit", "unit_in_name", "without_unit"]

_TIME = re.compile(
    r"(?:(?:elapsed|test|running)[\s_]*)?(?:time|zeit|temps|t)(?:[\s_]*(?P<unit>.+))?|secs?|seconds", re.I
)
_FLOW = re.compile(r"(?<=_)(?:[cm]?m3|l|L)_(?:s|min)$")
"""Units of oil flow at the end of a name, whose last word alone would be one of time."""
_VOLTAGE = ("V", "mV", "mA")
"""Units of what a converter measures: known in brackets, converted only by a gain of the map."""
_BRACKETED = re.compile(r"(?P<name>.*?)(?P<gap>[\s_]*)(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))\s*")


def si_factor(unit: str, wanted: str) -> float:
    """Factor from `unit` to the SI unit `wanted`; raises RecordError for an unknown unit or another dimension."""
    found, target = parse_unit(unit), parse_unit(wanted)
    if found is None:
        raise RecordError(f"unknown unit {unit[:40]!r}; give one that can be converted to {wanted}")
    if target is None or found[1:] != target[1:]:
        raise RecordError(f"unit {unit!r} cannot be converted to {wanted}; map another column or correct the unit")
    return found.factor


def unit_in_name(name: str) -> str | None:
    """Unit in a column's name: `x [mm]`, `Ax (g)`, `accel_x_m_s2`; None if there is none.

    Text in square brackets after a blank is always a unit, known or not; `(A)` or `_b` only if it is one, as `(V)` is.
    """
    if match := _BRACKETED.fullmatch(name):
        text = (match["square"] if match["round"] is None else match["round"]).strip()
        certain = match["round"] is None and match["gap"]
        return text if text and (certain or text in _VOLTAGE or quantity_unit(text)) else None
    if match := _FLOW.search(name):
        return match[0]
    words = name.split("_")
    ends = ("_".join(words[k:]) for k in range(1, len(words)))
    return next((end for end in ends if not end.isdigit() and quantity_unit(end)), None)


def without_unit(name: str) -> str:
    """Column name without the unit in it."""
    unit = unit_in_name(name)
    if unit is None:
        return name.strip()
    match = _BRACKETED.fullmatch(name)
    return (match["name"] if match else name.removesuffix(unit)).rstrip(" _")


def time_unit(name: str, unit: str | None = None) -> str | None:
    """Unit of a time column by its name, by default `s`; None if the name is not one of time."""
    match = _TIME.fullmatch(name.strip())
    if match is None:
        return None
    stated = unit or unit_in_name(name) or (match["unit"] or "").strip("[]() ") or "s"
    return stated if quantity_unit(stated) == "s" else None
