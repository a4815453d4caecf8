"""Options of the motions made by name, and checks of their values."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import MotionError
from ..core.units import numbers_in
from .motion import AXES
from .toml import si_unit, values_of

__all__ = ["MotionOption", "checked_options", "options_of", "refuse_without_unit"]

_MAY_BE_ZERO = ("height_ratio", "seed")
_WHOLE = ("seed",)


class MotionOption(NamedTuple):
    """A number, text or switch that can be chosen for a motion made by name."""

    name: str
    default: str  # in SI
    unit: str  # SI; "1" for plain numbers, "" for texts and switches
    source: str


def options_of(tests: dict[str, Any], section: str) -> tuple[MotionOption, ...]:
    """Options of the motion `section` of the tests' table, with their defaults in SI."""
    values = values_of(tests, section)
    return tuple(
        MotionOption(key, _text(values[key]), si_unit(entry["unit"]), entry["source"])
        for key, entry in tests[section].items()
        if isinstance(entry, dict)
    )


def refuse_without_unit(name: str, section: Mapping[str, Any], options: Mapping[str, Any]) -> None:
    """Raise MotionError for an acceleration as text without its unit, where the `section` of the tests states it in g.

    Codes and laboratories state it so, all else here is in SI: a factor of ten between them would go unseen.
    """
    for key, value in options.items():
        of_g = isinstance(section[key], dict) and section[key]["unit"] == "standard_gravity"
        if of_g and isinstance(value, str) and all(0.0 < _number(item) < math.inf for item in value.split(",")):
            raise MotionError(f"{name}: option {key} is {value!r}, in no unit; give {value}g, or {value}m/s2")


def checked_options(
    name: str, defaults: Mapping[str, Any], units: Mapping[str, str], options: Mapping[str, Any]
) -> dict[str, Any]:
    """Options of motion `name` in SI, each of the type of its default and possible by itself.

    `units` are those of SI, by option. Numbers may be given as text with another unit of the same dimension, "50 mm",
    lists as text, "0.5, 0.5, 0.9", with a unit of each or at the end, switches as "true" or "false". Raises MotionError
    naming the option, with its unit, whose value is not a finite positive number (zero where that makes sense), axis
    or switch.
    """
    return {
        key: _checked(f"{name}: option {key} is {value!r}; give", key, defaults[key], units[key], value)
        for key, value in options.items()
    }


def _checked(problem: str, key: str, default: Any, unit: str, value: Any) -> Any:
    if isinstance(default, bool):
        if str(value).lower() not in ("true", "false"):
            raise MotionError(f"{problem} true or false")
        return str(value).lower() == "true"
    if isinstance(default, str):
        if value not in AXES:
            raise MotionError(f"{problem} one of {', '.join(AXES)}")
        return value
    known = f", in {unit} or followed by a unit of the same kind" if unit != "1" else ""
    if isinstance(value, str) and key not in _WHOLE and (numbers := numbers_in(value, unit)) is not None:
        value = numbers if len(numbers) > 1 else numbers[0]
    if isinstance(default, list):
        items = np.ravel(np.asarray(value, dtype=object))
        numbers = [_number(item) for item in items]
        if len(numbers) not in (1, len(default)) or not all(0 < number < math.inf for number in numbers):
            raise MotionError(f"{problem} {len(default)} finite positive numbers, or one for all{known}")
        return numbers * len(default) if len(numbers) == 1 else numbers
    least = "zero or more" if key in _MAY_BE_ZERO else "above zero"
    number = math.nan if isinstance(value, str) else _number(value)
    possible = 0 < number < math.inf or (number == 0 and key in _MAY_BE_ZERO)
    if not possible or (key in _WHOLE and not number.is_integer()):
        raise MotionError(f"{problem} a {'whole' if key in _WHOLE else 'finite'} number, {least}{known}")
    return int(number) if key in _WHOLE else value


def _number(value: Any) -> float:
    """Value as a number; NaN where it is none."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return ", ".join(map(_text, value))
    return value if isinstance(value, str) else f"{value:.6g}"
