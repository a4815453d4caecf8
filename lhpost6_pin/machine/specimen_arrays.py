"""Arrays of a specimen's file: nested lists in TOML, or variables of a .npz or .mat file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..core.arrays import Array
from ..core.errors import ParameterError, instead_of
from .quantity import EVIDENCE, LARGEST, to_unit

__all__ = ["read_arrays", "read_entry"]

_KEYS = ("value", "variable", "unit", "evidence", "source")


def read_arrays(path: Path) -> dict[str, Array]:
    """Numeric variables of a .npz or .mat file, at most two-dimensional; raises ParameterError for any other file."""
    if not path.is_file():
        raise ParameterError(f"{path}: no such file of arrays")
    try:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as file:
                found = {name: file[name] for name in file.files}
        elif path.suffix == ".mat":
            from scipy.io import loadmat

            found = {k: _dense(v) for k, v in loadmat(path).items() if not k.startswith("__")}
        else:
            raise ParameterError(f"{path}: arrays are read from .npz and .mat files")
    except NotImplementedError:
        raise ParameterError(f"{path}: a .mat file of version 7.3; write it with -v7 (save -v7), or as .npz") from None
    except ParameterError:
        raise
    except Exception as error:  # both readers raise a dozen types for what is no file of theirs
        raise ParameterError(f"{path}: cannot be read: {error}") from None
    return {
        name: np.asarray(value, float)
        for name, value in found.items()
        if getattr(value, "dtype", None) is not None and value.dtype.kind in "fiu" and value.ndim <= 2
    }


def _dense(value: Any) -> Any:
    return value.toarray() if hasattr(value, "toarray") else value


def read_entry(
    entries: Mapping[str, Any], key: str, unit: str, dims: int, arrays: Mapping[str, Array], where: str
) -> Array:
    """Array of one or two dimensions from { value or variable, unit }, in a unit; raises ParameterError."""
    where = f"{where}.{key}" if key in entries else where
    if key not in entries:
        raise ParameterError(f"{where}: {key} is missing")
    entry = entries[key]
    if not isinstance(entry, dict) or "unit" not in entry or ("value" in entry) == ("variable" in entry):
        raise ParameterError(
            f"{where}: write {{ value = ..., unit = '{unit}' }}, or variable = a name in place of value"
        )
    if unknown := [k for k in entry if k not in _KEYS]:
        raise ParameterError(f"{where}: unknown {unknown[0]}; {instead_of(unknown[0], _KEYS)}")
    if entry.get("evidence", "override") not in EVIDENCE:
        raise ParameterError(f"{where}: evidence {entry['evidence']!r} is not one of {', '.join(EVIDENCE)}")
    if "variable" in entry:
        name = entry["variable"]
        if name not in arrays:
            raise ParameterError(
                f"{where}: no variable {name!r} in the file of arrays; it has {', '.join(arrays) or 'none'}"
            )
        array = arrays[name]
    else:
        try:
            array = np.array(entry["value"], float)
        except (TypeError, ValueError):
            raise ParameterError(f"{where}: its rows should be numbers, as many in each") from None
    if dims == 1 and array.ndim == 2 and 1 in array.shape:  # a vector of a .mat file
        array = array.ravel()
    array = np.atleast_1d(array) if dims == 1 else array
    if array.ndim != dims or array.size == 0:
        raise ParameterError(
            f"{where}: an array of {dims} dimension{'s' * (dims > 1)} is needed; got shape {array.shape}"
        )
    if not (np.abs(array) <= LARGEST).all():
        raise ParameterError(f"{where}: a number is not finite, or beyond {LARGEST:g}")
    if not isinstance(entry["unit"], str):
        raise ParameterError(f"{where}: unit must be text")
    return array * float(to_unit(1.0, entry["unit"], unit, where))  # type: ignore[arg-type]
