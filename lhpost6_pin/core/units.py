"""Units as files spell them, `in`, `g`, `psi`, `kips`, `m_s2`, `deg/sec^2`, with their factors to SI by pint."""

import re
from functools import cache
from typing import NamedTuple

__all__ = ["SI_UNITS", "Unit", "parse_unit", "quantity_unit"]

SI_UNITS = ("m", "m/s", "m/s2", "rad", "rad/s", "rad/s2", "N", "Pa", "1", "s")
"""Units of records and motions."""

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
"""Words that differ from a spelling only in case and mean something else."""

_FACTOR = r"(?:[^\W\d_]+|[°%])(?:(?:\^|\*\*)?(?:-[1-4]|[2-4]))?"
_UNIT = re.compile(rf"{_FACTOR}(?:[*/]{_FACTOR}){{0,3}}")


class Unit(NamedTuple):
    """A unit by its factor to SI base units and its dimension."""

    factor: float
    dimension: str
    angle: bool  # pint counts angles as plain numbers; here a rotation must name its angle


def quantity_unit(unit: str | None) -> str | None:
    """SI unit, one of `SI_UNITS`, that `unit` can be converted to; None if there is none."""
    found = parse_unit(unit) if unit else None
    return next((si for si in SI_UNITS if found and (target := parse_unit(si)) and found[1:] == target[1:]), None)


@cache
def parse_unit(text: str) -> Unit | None:
    """Unit of a text from outside; None unless it is a product of powers of known units with a constant factor."""
    spelled = re.sub(r"\s*([*/^])\s*", r"\1", text.strip().rstrip(".").replace("·", "*"))
    spelled = spelled.translate(str.maketrans("²³µ⁻", "23μ-")).strip()
    if spelled in ("1", "-"):
        return Unit(1.0, "dimensionless", False)
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
    return Unit(factor, dimension, angle)


def _known(word: str) -> str:
    return _SPELLINGS.get(word.casefold(), word)
