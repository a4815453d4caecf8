"""Typed sections of a parameter file: dataclasses whose fields state unit, length and bound."""

from collections.abc import Callable, Mapping
from dataclasses import field, fields
from typing import Any, TypeVar

from ..core.errors import ParameterError
from .parameters import Parameters, Value

__all__ = ["build_section", "quantity_field"]

_T = TypeVar("_T")

_BOUNDS: Mapping[str, tuple[str, Callable[[float], bool]]] = {
    "any": ("a number", lambda value: True),
    "positive": ("positive", lambda value: value > 0.0),
    "nonnegative": ("zero or positive", lambda value: value >= 0.0),
    "fraction": ("between 0 and 1", lambda value: 0.0 <= value <= 1.0),
}
"""Bounds of a quantity: in words, and whether a number is within."""


def quantity_field(unit: str, *, length: int = 0, bound: str = "any", optional: bool = False) -> Any:
    """Dataclass field of a quantity: its unit, vector length (0 for a scalar) and bound.

    bound is "any", "positive", "nonnegative" or "fraction" (0 to 1). An optional field defaults to None.
    """
    meta = {"unit": unit, "length": length, "bound": bound, "optional": optional}
    return field(metadata=meta, default=None) if optional else field(metadata=meta)


def build_section(cls: type[_T], parameters: Parameters, sections: tuple[str, ...], **given: Any) -> _T:
    """Fill a dataclass: `given` fields as they are, the others from the first of `sections` that has the key.

    Raises ParameterError naming file and key for what is missing, has another unit or shape, or is out of bounds.
    """
    values, known = dict(given), parameters.quantities
    for spec in fields(cls):  # type: ignore[arg-type]
        if spec.name in given:
            continue
        path = next((path for s in sections if (path := f"{s}.{spec.name}") in known), None)
        if path is None:
            if spec.metadata["optional"]:
                continue
            raise ParameterError(f"{parameters.origin}: {sections[-1]}.{spec.name} is missing")
        quantity, meta = known[path], spec.metadata
        if quantity.unit != meta["unit"]:
            raise ParameterError(f"{parameters.origin}: {path}: unit {quantity.unit!r} should be {meta['unit']!r}")
        if wrong := _wrong(quantity.value, meta["length"], meta["bound"]):
            raise ParameterError(f"{parameters.origin}: {path}: {wrong}")
        values[spec.name] = quantity.value
    return cls(**values)


def _wrong(value: Value, length: int, bound: str) -> str:
    """What is wrong with a value; empty if nothing is."""
    entries = value if isinstance(value, tuple) else (value,)
    if isinstance(value, tuple) != bool(length) or (length and len(entries) != length):
        return f"{value!r} should be {f'{length} numbers' if length else 'one number'}"
    wanted, possible = _BOUNDS[bound]
    return "" if all(map(possible, entries)) else f"{value!r} is impossible; it should be {wanted}"
