"""Units as data files spell them, `in`, `g`, `psi`, `kips`, `m_s2`, `deg/sec^2`, turned to SI through pint."""

import re
from functools import cache
from typing import NamedTuple

from ...core.errors import RecordError

__all__ = ["SI_UNITS", "quantity_unit", "si_factor", "time_unit", "unit_in_name", "without_unit"]

SI_UNITS = ("m", "m/s", "m/s2", "rad", "rad/s", "rad/s2", "N", "Pa", "1", "s")
"""Units that a record holds."""

_SPELLINGS = {  # by case-folded word; `g` is standard gravity, never gram
    **dict.fromkeys(("g", "gs"), "standard_gravity"),
    **dict.fromkeys(("in", "inch", "inches"), "inch"),
    **dict.fromkeys(("sec", "secs", "second", "seconds", "s"), "s"),
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), "degree"),
    **dict.fromkeys(("kip", "kips"), "kip"),
    **dict.fromkeys(("lb", "lbs", "lbf"), "lbf"),
    **dict.fromkeys(("%", "pct", "percent"), "percent"),
    "fraction": "dimensionless",
    **{word.casefold(): word for word in ("m", "mm", "cm", "rad", "ms", "N", "kN", "Pa", "kPa", "MPa", "psi", "ksi")},
    "gal": "(cm/s**2)",
}
_AS_WRITTEN = ("mPa", "Ms")
"""Words that only differ in case from a spelling and mean something else."""

_FACTOR = r"(?:[^\W\d_]+|[°%])(?:(?:\^|\*\*)?(?:-[1-4]|[2-4]))?"
_UNIT = re.compile(rf"{_FACTOR}(?:[*/]{_FACTOR}){{0,3}}")
_TIME = re.compile(r"(?:(?:elapsed|test|running)[\s_]*)?(?:time|t)(?:[\s_]*(?P<unit>.+))?", re.I)
_BRACKETED = re.compile(r"(?P<name>.*?)(?P<gap>[\s_]*)(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))\s*")


class _Unit(NamedTuple):
    factor: float  # to SI base units
    dimension: str
    angle: bool  # pint counts angles as plain numbers; here a rotation must name its angle


def si_factor(unit: str, wanted: str) -> float:
    """Factor from `unit` to the SI unit `wanted`, one of `SI_UNITS`; raises RecordError saying what is wrong."""
    found, target = _parse(unit), _parse(wanted)
    if found is None:
        raise RecordError(f"unknown unit {unit[:40]!r}; give one that can be turned into {wanted}")
    if target is None or found[1:] != target[1:]:
        raise RecordError(f"unit {unit!r} cannot be turned into {wanted}; map another column or correct the unit")
    return found.factor


def quantity_unit(unit: str | None) -> str | None:
    """SI unit of a record that `unit` can be turned into; None if there is none."""
    found = _parse(unit) if unit else None
    return next((si for si in SI_UNITS if found and (target := _parse(si)) and found[1:] == target[1:]), None)


def unit_in_name(name: str) -> str | None:
    """Unit in a column's name: `x [mm]`, `Ax (g)`, `accel_x_m_s2`; None if there is none.

    What stands in square brackets after a blank is always a unit, known or not; `(A)` or `_b` only if it is one.
    """
    if match := _BRACKETED.fullmatch(name):
        text = (match["square"] if match["round"] is None else match["round"]).strip()
        certain = match["round"] is None and match["gap"]
        return text if text and (certain or quantity_unit(text)) else None
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
    """Unit of a time column by its name, `s` if it does not say; None if the name is not one of time."""
    match = _TIME.fullmatch(name.strip())
    if match is None:
        return None
    stated = unit or unit_in_name(name) or (match["unit"] or "").strip("[]() ") or "s"
    return stated if quantity_unit(stated) == "s" else None


@cache
def _parse(text: str) -> _Unit | None:
    """Unit of a text; None unless it is simply a product of known units of which pint makes a factor."""
    spelled = re.sub(r"\s*([*/^])\s*", r"\1", text.strip().rstrip(".").replace("·", "*"))
    spelled = spelled.translate(str.maketrans("²³µ⁻", "23μ-")).strip()
    if spelled in ("1", "-"):
        return _Unit(1.0, "dimensionless", False)
    if re.fullmatch(r"[^\W\d_]+(_[^\W\d_]+[2-4]?)+", spelled):  # as in a column's name: m_s2
        spelled = spelled.replace("_", "/")
    spelled = re.sub(r"\s+", "*", spelled)
    if not _UNIT.fullmatch(spelled):
        return None
    import pint  # takes 0.2 s

    words = re.sub(r"[^\W\d_]+|[°%]", lambda m: m[0] if m[0] in _AS_WRITTEN else _known(m[0]), spelled)
    expression = re.sub(r"(?<=[^\W\d_)])(?:\^|\*\*)?(-?[1-4])(?![\d)])", r"**\1", words)
    registry = pint.get_application_registry()
    try:
        one, two = (registry.Quantity(n, expression).to_base_units() for n in (1.0, 2.0))
        factor, twice, dimension = float(one.magnitude), float(two.magnitude), str(one.dimensionality)
    except Exception:  # pint raises many kinds on text that it cannot parse
        return None
    angle = bool(re.search(r"rad|degree|°|turn|revolution", words))
    count = dimension == "dimensionless" and not angle and words not in ("percent", "dimensionless")
    if count or twice != 2 * factor:  # bits, counts; decibel, degrees Celsius
        return None
    return _Unit(factor, dimension, angle)


def _known(word: str) -> str:
    return _SPELLINGS.get(word.casefold(), word)
