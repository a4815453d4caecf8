"""Conversion of results to JSON."""

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["as_json", "jsonable"]


def jsonable(value: Any) -> Any:
    """Mappings, sequences, arrays, records and paths as dicts, lists and text; None for a number that is not finite.

    Raises TypeError for anything else.
    """
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.ndarray | np.generic):
        return jsonable(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): jsonable(inner) for key, inner in value.items()}
    if hasattr(value, "_asdict"):
        return jsonable(value._asdict())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: jsonable(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, list | tuple | set | frozenset):
        return [jsonable(inner) for inner in value]
    raise TypeError(f"{type(value).__name__} has no form in JSON")


def as_json(value: Any) -> str:
    """A value as JSON text, one entry a line."""
    return json.dumps(jsonable(value), indent=1, ensure_ascii=False, allow_nan=False)
