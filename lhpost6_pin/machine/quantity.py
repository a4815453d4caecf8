"""A number with unit, evidence and source: read from TOML, checked, and converted between units."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

from ..core.errors import ParameterError, instead_of
from ..core.units import parse_unit

__all__ = ["EVIDENCE", "LARGEST", "Quantity", "Value", "read_number", "read_quantity", "to_unit", "unusable"]
__all__ += ["vector_length"]

Value: TypeAlias = float | tuple[float, ...]

EVIDENCE = (
    *("report", "measured", "derived", "drawn", "assumed", "standard"),
    *("numerical", "calibrated", "at_bound", "override"),
)
"""How well a number is known, strongest claim first; `at_bound` is where a fit ended at the bound of a number's range,
which is no estimate; `override` is what a user set by hand."""

LARGEST = 1e30
"""No quantity of a machine or a test in SI is larger, and the powers of this one can still be computed with."""

_QUANTITY_KEYS = {"value", "unit", "evidence", "source", "printed", "rel_sd", "sd"}


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number (or vector) with its unit and where it comes from.

    `sd` is one standard deviation in `unit` (None where no uncertainty is stated).
    """

    value: Value
    unit: str
    evidence: str
    source: str
    sd: Value | None = None
    printed: str | None = None

    @property
    def assumed(self) -> bool:
        """True for a number that is not published."""
        return self.evidence == "assumed"


@cache
def _registry() -> Any:
    """Units by name; one of our own: the application's is set up lazily, which threads cannot share."""
    import pint  # slow to import and needed only where a unit is not the SI one

    return pint.UnitRegistry()


def to_unit(value: Value, unit: str, wanted: str, key: str) -> Value:
    """Convert `value` from `unit` to `wanted`; raises ParameterError naming `key` if the dimensions differ."""
    if unit == wanted:
        return value
    registry = _registry()
    try:
        factor = registry.Quantity(1.0, _pint_spelling(unit)).to(_pint_spelling(wanted)).magnitude
    except Exception as error:  # pint raises a dozen types for a bad unit
        own, target = parse_unit(unit), parse_unit(wanted)  # as files spell them: gpm, kips, g
        if own is None or target is None or own[1:] != target[1:]:
            what = f"unit {unit!r} cannot be converted to {wanted!r}; give it in {wanted}"
            raise ParameterError(f"{key}: {what}") from error
        factor = own.factor / target.factor
    if isinstance(value, tuple):
        return tuple(float(v) * factor for v in value)
    return float(value) * factor


def _pint_spelling(unit: str) -> str:
    """Spell a unit such as ``m3/s/Pa`` or ``kg m2`` the way pint reads it."""
    words = unit.replace("·", " ").replace("/", " / ").split()
    spelled: list[str] = []
    for word in words:
        if spelled and word != "/" and spelled[-1] != "/":
            spelled.append("*")
        stem = word.rstrip("0123456789")
        spelled.append(f"{stem}**{word[len(stem) :]}" if stem and stem != word else word)
    return " ".join(spelled)


def unusable(number: float) -> str:
    """What is wrong with a number that is not within `LARGEST`, in words."""
    return f"beyond {LARGEST:g}" if math.isfinite(number) else "not finite"


def read_number(value: object, key: str) -> Value:
    """A finite number or vector of them from TOML; raises ParameterError naming `key`."""
    value = value.tolist() if hasattr(value, "tolist") else value  # an array, or a number of one
    if isinstance(value, list | tuple):
        if not value:
            raise ParameterError(f"{key}: an empty list is not a value")
        return tuple(_scalar(v, key) for v in value)
    return _scalar(value, key)


def _scalar(value: object, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{key}: value {value!r} is not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not abs(number) <= LARGEST:
        raise ParameterError(f"{key}: value {str(value)[:40]} is {unusable(number)}")
    return number


def read_quantity(entry: Mapping[str, Any], key: str) -> Quantity:
    """A quantity from its TOML table; raises ParameterError naming `key`."""
    for needed in ("value", "unit", "evidence", "source"):
        if needed not in entry:
            raise ParameterError(f"{key}: {needed} is missing")
    if unknown := sorted(set(entry) - _QUANTITY_KEYS):
        raise ParameterError(f"{key}: unknown {unknown[0]}; {instead_of(unknown[0], sorted(_QUANTITY_KEYS))}")
    if entry["evidence"] not in EVIDENCE:
        raise ParameterError(f"{key}: evidence {entry['evidence']!r} is not one of {', '.join(EVIDENCE)}")
    for text in ("unit", "source", "printed"):
        if not isinstance(entry.get(text, ""), str):
            raise ParameterError(f"{key}: {text} must be text")
    value = read_number(entry["value"], key)
    sd = _sd(entry, value, key)
    if sd is not None and vector_length(sd) not in (0, vector_length(value)):
        raise ParameterError(f"{key}: sd {sd!r} does not have the shape of {value!r}")
    return Quantity(value, entry["unit"], entry["evidence"], entry["source"], sd, entry.get("printed"))


def _sd(entry: Mapping[str, Any], value: Value, key: str) -> Value | None:
    if "sd" in entry:
        sd: Value = read_number(entry["sd"], f"{key}.sd")
    elif "rel_sd" in entry:
        fraction = _scalar(entry["rel_sd"], f"{key}.rel_sd")
        sd = tuple(abs(v) * fraction for v in value) if isinstance(value, tuple) else abs(value) * fraction
    else:
        return None
    if min(sd if isinstance(sd, tuple) else (sd,)) < 0.0:
        raise ParameterError(f"{key}: standard deviation {sd!r} is negative")
    return sd


def vector_length(value: Value) -> int:
    """Length of a vector, 0 for a scalar."""
    return len(value) if isinstance(value, tuple) else 0
