"""Typed sections of a parameter file: dataclasses whose fields state unit, length and bound."""

from dataclasses import field, fields
from typing import Any, TypeVar

from ..core.errors import ParameterError
from .parameters import Parameters, Value

__all__ = ["build_section", "quantity_field"]

_T = TypeVar("_T")


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
    values = dict(given)
    for spec in fields(cls):  # type: ignore[arg-type]
        if spec.name in given:
            continue
        path = next((f"{s}.{spec.name}" for s in sections if f"{s}.{spec.name}" in parameters), None)
        if path is None:
            if spec.metadata["optional"]:
                continue
            raise ParameterError(f"{parameters.origin}: {sections[-1]}.{spec.name} is missing")
        quantity = parameters[path]
        key = f"{parameters.origin}: {path}"
        if quantity.unit != spec.metadata["unit"]:
            raise ParameterError(f"{key}: unit {quantity.unit!r} should be {spec.metadata['unit']!r}")
        values[spec.name] = _bounded(quantity.value, spec.metadata["length"], spec.metadata["bound"], key)
    return cls(**values)


def _bounded(value: Value, length: int, bound: str, key: str) -> Value:
    entries = value if isinstance(value, tuple) else (value,)
    if isinstance(value, tuple) != bool(length) or (length and len(entries) != length):
        wanted = f"{length} numbers" if length else "one number"
        raise ParameterError(f"{key}: {value!r} should be {wanted}")
    impossible = {
        "any": False,
        "positive": min(entries) <= 0.0,
        "nonnegative": min(entries) < 0.0,
        "fraction": min(entries) < 0.0 or max(entries) > 1.0,
    }
    if impossible[bound]:
        wanted = {"positive": "positive", "nonnegative": "zero or positive", "fraction": "between 0 and 1"}[bound]
        raise ParameterError(f"{key}: {value!r} is impossible; it should be {wanted}")
    return value
