"""From named arrays, as MATLAB, HDF5 and TDMS files hold them, to channels: one `RawTest` for each sampling."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array
from ...core.errors import RecordError
from .channel_units import si_factor, time_unit, unit_in_name
from .raw import RawTest, make_raw

__all__ = ["Leaf", "leaves_of", "raws_of_leaves"]

_STEPS = ("dt", "deltat", "timestep", "sampleinterval", "samplinginterval", "ts")
_RATES = ("fs", "rate", "samplerate", "sampleratehz", "samplingrate", "samplingfrequency")
_NAMES, _UNITS = ("columns", "names", "channels", "labels", "label", "desc", "name"), ("units", "unit")
_OF_CHANNELS = re.compile(
    r"(?:chan(?:nel)?|ch|col(?:umn)?|signal|sensor|var(?:iable)?)s?(?=names?$|labels?$|desc$|units?$)"
)
"""What may stand before the word: `chanNames`, `channel_units`."""


class Leaf(NamedTuple):
    """An array (n,) or (n, k) of a file: its place, attributes, and names of its columns."""

    group: tuple[str, ...]
    name: str
    values: NDArray[Any]
    unit: str | None = None
    step: float | None = None  # [s], where the array has its own
    columns: tuple[str, ...] = ()


def leaves_of(tree: Mapping[str, Any], group: tuple[str, ...] = ()) -> tuple[list[Leaf], dict[str, str]]:
    """Arrays in a tree of named values, with the step, names and units beside them; and its texts."""
    leaves: list[Leaf] = []
    facts: dict[str, str] = {}
    step, names, units = _step(tree), _texts(tree, _NAMES), _texts(tree, _UNITS)
    arrays = {name: value for name, value in tree.items() if _is_array(value) and time_unit(name) is None}
    named = [name for name, value in arrays.items() if value.size // max(value.shape) == len(names)]
    for name, value in tree.items():
        if isinstance(value, list | tuple) and value and all(isinstance(item, Mapping) for item in value):
            value = {f"{k + 1}": item for k, item in enumerate(value)}
        if isinstance(value, Mapping):
            found, texts = leaves_of(value, (*group, name))
            leaves += [leaf._replace(step=leaf.step or step) for leaf in found]
            facts |= texts
        elif isinstance(value, str):
            facts[name] = value
        elif _is_array(value):
            own = names if named == [name] else []  # names beside several arrays could be those of any
            each = units if len(units) == len(own) > 1 else [""] * len(own)
            unit = units[0] if len(units) == 1 and [*arrays] == [name] else None
            leaves += _with_own_time(Leaf(group, name, value, unit, step, tuple(own)), each)
    return leaves, facts


def _with_own_time(leaf: Leaf, units: Sequence[str]) -> list[Leaf]:
    """An array with the units (k,) of its named columns in their names, and its column of time, if any, as another."""
    named = [*zip(leaf.columns, units, strict=True)]
    columns = tuple(f"{name} [{unit}]" if unit else name for name, unit in named)
    clocks = [time_unit(name, unit or None) for name, unit in named] if leaf.values.ndim == 2 else []
    k = next((k for k, unit in enumerate(clocks) if unit), None)
    if k is None or len(columns) < 2:
        return [leaf._replace(columns=columns)]
    along = leaf.values.shape.index(len(columns))
    time = Leaf(leaf.group, "time", np.take(leaf.values, k, along), clocks[k])
    return [time, leaf._replace(values=np.delete(leaf.values, k, along), columns=columns[:k] + columns[k + 1 :])]


def raws_of_leaves(leaves: Sequence[Leaf], facts: Mapping[str, str], source: str, form: str) -> tuple[RawTest, ...]:
    """One `RawTest` for all arrays of the same length and time.

    Time is an array named so, in the array's own group or the nearest above, or else its step. Raises RecordError if
    there are no channels.
    """
    times = [leaf for leaf in leaves if time_unit(leaf.name, leaf.unit) and np.squeeze(leaf.values).ndim == 1]
    together: dict[tuple[Any, int], list[tuple[str, str | None, Array]]] = {}
    clocks: dict[Any, Array | None] = {}
    for leaf in (leaf for leaf in leaves if not any(leaf is time for time in times)):
        clock, shape = _clock(leaf, times), np.squeeze(leaf.values).shape
        if len(shape) not in (1, 2):
            continue
        length = clock.values.size if clock is not None else max(shape)
        key = (clock.group if clock is not None else leaf.step, length)
        if key not in clocks:
            with np.errstate(over="ignore", invalid="ignore"):  # infinite times are refused with their sample
                steps = None if leaf.step is None else leaf.step * np.arange(length)
            clocks[key] = steps if clock is None else _seconds(clock, source)
        together.setdefault(key, []).extend(_columns(leaf, length))
    if not together:
        raise RecordError(f"{source}: holds no array of samples; a test is one or more arrays along time")
    found = []
    for key, columns in together.items():
        names, units, values = zip(*columns, strict=True)
        found.append(make_raw(source, form, names, units, np.column_stack(values), clocks[key], facts))
    return tuple(found)


def _columns(leaf: Leaf, length: int) -> list[tuple[str, str | None, Array]]:
    values = np.squeeze(leaf.values).astype(float)
    path = ".".join((*leaf.group, leaf.name))
    if values.ndim == 1:
        name = leaf.columns[0] if leaf.columns else path
        return [(name, leaf.unit or unit_in_name(name), values)]
    table = values if values.shape[0] == length else values.T
    numbered = tuple(f"{path}_{k + 1}" for k in range(table.shape[1]))
    names = leaf.columns if len(leaf.columns) == len(numbered) else numbered
    units = (leaf.unit or "").split(",")  # "m, rad" are two units for equal shares of the columns
    each = [units[k * len(units) // len(names)] or unit_in_name(name) for k, name in enumerate(names)]
    return [(name, each[k], table[:, k]) for k, name in enumerate(names)]


def _clock(leaf: Leaf, times: Sequence[Leaf]) -> Leaf | None:
    """Time of an array: the time vector in the nearest group around it that has as many samples."""
    shape = np.squeeze(leaf.values).shape
    fitting = [t for t in times if t.values.size in shape and leaf.group[: len(t.group)] == t.group]
    return max(fitting, key=lambda t: len(t.group), default=None)


def _seconds(clock: Leaf, source: str) -> Array:
    unit = time_unit(clock.name, clock.unit) or "s"
    try:
        with np.errstate(over="ignore"):
            return np.squeeze(clock.values).astype(float) * si_factor(unit, "s")
    except RecordError as error:
        raise RecordError(f"{source}, {clock.name}: {error}") from None


def _is_array(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size > 1


def _step(tree: Mapping[str, Any]) -> float | None:
    """Sample interval [s] that stands as a single number among other values: dt, or a rate [Hz]."""
    for name, value in tree.items():
        number = np.asarray(value) if isinstance(value, int | float | np.generic | np.ndarray) else np.zeros(0)
        if number.size != 1 or number.dtype.kind not in "fiu" or not float(number.item()) > 0:
            continue
        word = _word(name)
        if word in _STEPS:
            return float(number.item())
        if word in _RATES:
            return 1.0 / float(number.item())
    return None


def _word(name: str) -> str:
    """A name of a value without case, blanks and underscores."""
    return re.sub(r"[\s_]+", "", name.lower())


def _texts(tree: Mapping[str, Any], keys: Sequence[str]) -> list[str]:
    """Texts under the first of `keys` that holds any: one, or a list or array of them."""
    for value in (v for wanted in keys for k, v in tree.items() if _OF_CHANNELS.sub("", _word(k)) == wanted):
        cells = [value] if isinstance(value, str) else value if isinstance(value, list | tuple) else np.ravel(value)
        texts = ["" if not isinstance(cell, str) and np.size(cell) == 0 else cell for cell in cells]
        if all(isinstance(cell, str) for cell in texts) and any(texts):
            return [cell.strip() for cell in texts]
    return []
