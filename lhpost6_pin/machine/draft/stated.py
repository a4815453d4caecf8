"""A number as one writes it down: `24 cm2`, `310 kg +- 20 %`, `3.0 2.0 m`."""

import re

from ...core.errors import ParameterError
from ..quantity import Quantity, Value, read_number, to_unit

__all__ = ["read_stated"]

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_STATED = re.compile(
    rf"(?:\+-|\+/-|±)?\s*(?P<values>{_NUMBER}(?:\s*[,;x ]\s*{_NUMBER})*)\s*(?P<unit>[^\d\s+±-][^+±]*?)?\s*"
    rf"(?:(?:\+-|\+/-|±)\s*(?P<sd>{_NUMBER})\s*(?P<of>%|[^\d\s%].*)?)?"
)


_UNIT_AGAIN = re.compile(
    rf"({_NUMBER})\s*(?P<unit>[^\d\s+±,;x-][^\s+±,;]*)\s*[,;x]\s*(?={_NUMBER}\s*(?P=unit)\s*(?:[,;x+±]|$))"
)
"""A number whose unit is that of the next one, too: `2 m, 3 m`."""
_BRACKETS = re.compile(r"^\s*[\[(]([^\[\]()]*)[\])]")


def read_stated(text: str, unit: str, key: str, source: str, example: str = "") -> Quantity:
    """Quantity of evidence `measured` in `unit`, with the standard deviation if one is stated (``+- 5 %``).

    Several numbers, apart by spaces, commas or an x, make a vector: `2 3 m`, `2 x 3 m`, `[2, 3] m`, `2 m, 3 m`. Raises
    ParameterError naming `key`, with an `example`, for what has no unit, another unit's dimension, or cannot be read.
    """
    example = example or _EXAMPLES.get(unit, f"1.0 {unit}")
    found = _STATED.fullmatch(_UNIT_AGAIN.sub(r"\1, ", _BRACKETS.sub(r"\1", text)).strip())
    if found is None:
        raise ParameterError(f"{key}: {text!r} cannot be read; write a number with its unit, as in '{example}'")
    numbers = [float(number) for number in re.findall(_NUMBER, found["values"])]
    written = (found["unit"] or "").strip()
    if not written and unit != "1":
        raise ParameterError(f"{key}: {text!r} has no unit; write it, as in '{example}'")
    if re.search(r"[,;]|\d\s", written):
        raise ParameterError(f"{key}: {text!r} has more than one unit; write one for all numbers, as in '{example}'")
    try:
        value = _converted(numbers, written or "1", unit, key)
    except ParameterError as error:
        raise ParameterError(f"{error}, as in '{example}'") from error
    sd: Value | None = None
    if found["sd"] is not None:
        given, of = float(found["sd"]), (found["of"] or written or "1").strip()
        if of == "%":
            sd = (
                tuple(abs(v) * given / 100.0 for v in value) if isinstance(value, tuple) else abs(value) * given / 100.0
            )
        else:
            sd = _converted([given] * len(numbers), of, unit, key)
    return Quantity(value, unit, "measured", source, sd)


def _converted(numbers: list[float], written: str, unit: str, key: str) -> Value:
    values = [to_unit(read_number(number, key), written, unit, key) for number in numbers]
    single = [v for v in values if not isinstance(v, tuple)]
    return single[0] if len(single) == 1 else tuple(single)


_EXAMPLES = {"m2": "24 cm2", "m": "125 mm", "Pa": "21 MPa", "kg": "310 kg +- 20 %", "m3/s": "40 l/min", "s": "4 ms"}
