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


def read_stated(text: str, unit: str, key: str, source: str) -> Quantity:
    """Quantity of evidence `measured` in `unit`, with the standard deviation if one is stated (``+- 5 %``).

    Several numbers, apart by spaces or commas, make a vector. Raises ParameterError naming `key` for what has no unit,
    another unit's dimension, or cannot be read.
    """
    found = _STATED.fullmatch(text.strip())
    if found is None:
        raise ParameterError(f"{key}: {text!r} cannot be read; write a number with its unit, as in '{_example(unit)}'")
    numbers = [float(number) for number in re.findall(_NUMBER, found["values"])]
    written = (found["unit"] or "").strip()
    if not written and unit != "1":
        raise ParameterError(f"{key}: {text!r} has no unit; write it, as in '{_example(unit)}'")
    value = _converted(numbers, written or "1", unit, key)
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


def _example(unit: str) -> str:
    return _EXAMPLES.get(unit, f"1.0 {unit}")


_EXAMPLES = {"m2": "24 cm2", "m": "125 mm", "Pa": "21 MPa", "kg": "310 kg +- 20 %", "m3/s": "40 l/min", "s": "4 ms"}
