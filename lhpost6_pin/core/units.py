"""Units as files spell them, `in`, `g`, `psi`, `kips`, `m_s2`, `deg/sec^2`, with their factors to SI by pint."""

import re
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

__all__ = ["SI_UNITS", "Unit", "numbers_in", "parse_unit", "quantity_unit", "units_of"]

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
    "gpm": "(gallon/minute)",
    **dict.fromkeys(("lbm", "lbms"), "pound"),
}
_AS_WRITTEN = ("mPa", "Ms")
"""Words that differ from a spelling only in case and mean something else."""

_FACTOR = r"(?:[^\W\d_]+|[°%])(?:(?:\^|\*\*)?(?:-[1-4]|[2-4]))?"
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_UNIT = re.compile(rf"{_FACTOR}(?:[*/]{_FACTOR}){{0,3}}")


class Unit(NamedTuple):
    """A unit by its factor to SI base units and its dimension."""

    factor: float
    dimension: str  # powers of base dimensions, in the order of their names; empty: none
    angle: bool  # pint counts angles as plain numbers; here a rotation must name its angle


_SI = {
    "m": Unit(1.0, "length", False),
    "m/s": Unit(1.0, "length time^-1", False),
    "m/s2": Unit(1.0, "length time^-2", False),
    "rad": Unit(1.0, "", True),
    "rad/s": Unit(1.0, "time^-1", True),
    "rad/s2": Unit(1.0, "time^-2", True),
    "N": Unit(1.0, "length mass time^-2", False),
    "Pa": Unit(1.0, "length^-1 mass time^-2", False),
    "1": Unit(1.0, "", False),
    "s": Unit(1.0, "time", False),
}

SI_UNITS = tuple(_SI)
"""Units of records and motions."""

_PLAIN = {**_SI, "g": Unit(9.80665, "length time^-2", False)}
"""Units of most motions: a file with these need not wait for pint, which takes half a second."""


def quantity_unit(unit: str | None) -> str | None:
    """SI unit, one of `SI_UNITS`, that `unit` can be converted to; None if there is none."""
    found = parse_unit(unit) if unit else None
    return next((si for si in SI_UNITS if found and (target := parse_unit(si)) and found[1:] == target[1:]), None)


def units_of(si: str) -> tuple[str, ...]:
    """Units with a spelling of their own that can be converted to an SI unit, which comes first."""
    return (si, *sorted(unit for unit in {*_SPELLINGS.values()} - {si} if quantity_unit(unit) == si))


@cache
def parse_unit(text: str) -> Unit | None:
    """Unit of a text from outside; None unless it is a product of powers of known units with a constant factor."""
    spelled = re.sub(r"\s*([*/^])\s*", r"\1", text.strip().rstrip(".").replace("·", "*"))
    spelled = spelled.translate(str.maketrans("²³µ⁻", "23μ-")).strip()
    spelled = "1" if spelled == "-" else spelled
    if re.fullmatch(r"[^\W\d_]+3?(_[^\W\d_]+[2-4]?)+", spelled):  # as in a column's name: m_s2
        spelled = spelled.replace("_", "/")
    spelled = re.sub(r"\s+", "*", spelled)
    if spelled in _PLAIN:
        return _PLAIN[spelled]
    return _by_pint(spelled) if _UNIT.fullmatch(spelled) else None


def numbers_in(text: str, unit: str) -> list[float] | None:
    """Numbers of a text in the SI `unit`, apart by commas, as in "50 mm" or "0.5, 0.6 g"; None for any other text.

    Each has a unit of its own, or the last one is of all, or none has one: they are in SI then.
    """
    found = [_QUANTITY.fullmatch(item) for item in text.split(",")]
    stated = [match[2] if match else "" for match in found]
    if not any(stated[:-1]):  # the last one is of all
        stated = [stated[-1] or unit] * len(stated)
    wanted = parse_unit(unit)
    known = [parse_unit(word) if word else None for word in stated]
    numbers = [
        float(match[1]) * own.factor / wanted.factor
        for match, own in zip(found, known, strict=True)
        if match and own and wanted and own[1:] == wanted[1:]
    ]
    return numbers if len(numbers) == len(found) else None


def _by_pint(spelled: str) -> Unit | None:
    """Unit of a product of powers of units."""
    import pint

    words = re.sub(r"[^\W\d_]+|[°%]", lambda m: m[0] if m[0] in _AS_WRITTEN else _known(m[0]), spelled)
    expression = re.sub(r"(?<=[^\W\d_)])(?:\^|\*\*)?(-?[1-4])(?![\d)])", r"**\1", words)
    registry = pint.get_application_registry()
    try:
        one, two = (registry.Quantity(n, expression).to_base_units() for n in (1.0, 2.0))
        factor, twice, dimension = float(one.magnitude), float(two.magnitude), _dimension(one.dimensionality)
    except Exception:  # pint raises many kinds on text that it cannot parse
        return None
    angle = bool(re.search(r"rad|degree|°|turn|revolution", words))
    count = not dimension and not angle and words not in ("percent", "dimensionless")
    if count or twice != 2 * factor:  # bits, counts; decibel, degrees Celsius
        return None
    return Unit(factor, dimension, angle)


def _dimension(powers: Mapping[str, float]) -> str:
    """Powers of base dimensions by name, as text."""
    return " ".join(name.strip("[]") + (f"^{power:g}" if power != 1 else "") for name, power in sorted(powers.items()))


def _known(word: str) -> str:
    return _SPELLINGS.get(word.casefold(), word)
