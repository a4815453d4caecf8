"""How to break a file: strategies that draw broken copies of a valid one, and a watch for what must not leak.

`damaged_bytes`, `damaged_lines`, `damaged_toml` and `damaged_netcdf` take the content of a valid file and draw that
of a broken one; `trees` draws the named arrays of a MATLAB or HDF5 file. Inside `no_leak` a warning, a complaint from a
destructor and a reader that does not return are failures.
"""

import copy
import io
import json
import math
import re
import signal
import sys
import tomllib
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import h5py
import numpy as np
import xarray as xr
from hypothesis import reject
from hypothesis import strategies as st

Draw = Callable[[st.SearchStrategy[Any]], Any]

PATIENCE = 20
"""Seconds after which a reader counts as hung: the slowest takes some 0.3 s, compiling apart."""

NUMBERS = ("nan", "inf", "-inf", "1e999", "-1", "0", "1e-320", "1e308", "-1e308", "1e30", "1e-30", "0.5", "3")
TOKENS = (*NUMBERS, "", "9" * 30, "9" * 400, "9" * 5000, "word", "1,5", "0x10", "true", "#", '"', "é")
"""What stands where a number or a word was; Python refuses to read integers of more than 4300 digits."""

_WORD = re.compile(r"[^\s,;=:{}\[\]()\"<>/]+")


# ------------------------------------------------------------------------------------------------- what leaks
class Hung(BaseException):
    """A reader does not return; no `except Exception` of the reader's holds it."""


@contextmanager
def no_leak(patience: int = PATIENCE) -> Iterator[None]:
    """Fail if what is done inside warns, complains from a destructor, or takes longer than `patience` [s]."""
    unraisable: list[str] = []
    before_hook, before_alarm = sys.unraisablehook, signal.signal(signal.SIGALRM, _hung)
    sys.unraisablehook = lambda fault: unraisable.append(repr(fault.exc_value))
    signal.alarm(patience)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for category in (DeprecationWarning, ImportWarning, ResourceWarning):  # as Python itself does
                warnings.simplefilter("ignore", category)
            yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before_alarm)
        sys.unraisablehook = before_hook
    leaked = [f"{w.category.__name__} at {w.filename}:{w.lineno}: {w.message}" for w in caught] + unraisable
    assert not leaked, leaked


def _hung(*_: object) -> None:
    raise Hung("no answer")


# ------------------------------------------------------------------------------------------------- bytes and lines
def damaged_bytes(seed: bytes, places: list[int] | None = None) -> st.SearchStrategy[bytes]:
    """A few bytes flipped, put in or taken out, or the end cut off; `places` are those that may change alone."""

    @st.composite
    def damaged(draw: Draw) -> bytes:
        content = bytearray(seed)
        if places is not None:  # the length stays: what follows keeps its place
            for at in draw(st.lists(st.sampled_from(places), min_size=1, max_size=8)):
                content[at] = draw(st.integers(0, 255))
            return bytes(content[: draw(st.none() | st.integers(0, len(content)))])
        for _ in range(draw(st.integers(1, 4))):
            at, cut = draw(st.integers(0, len(content))), draw(st.sampled_from([0, 1, 2, 4, 12, 10**9]))
            content[at : at + cut] = draw(st.binary(max_size=6) | st.sampled_from(TOKENS).map(str.encode))
        return bytes(content)

    return damaged()


def damaged_lines(seed: bytes) -> st.SearchStrategy[bytes]:
    """Lines dropped, doubled, swapped or cut; words and numbers replaced, anywhere in the text."""

    @st.composite
    def damaged(draw: Draw) -> bytes:
        lines = seed.decode().splitlines()
        for _ in range(draw(st.integers(1, 3))):
            if not lines:
                break
            at, other = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
            line, words = lines[at], list(_WORD.finditer(lines[at]))
            action = draw(st.sampled_from(["word", "word", "word", "drop", "double", "swap", "cut"]))
            if action == "drop":
                del lines[at]
            elif action == "double":
                lines.insert(other, line)
            elif action == "swap":
                lines[at], lines[other] = lines[other], line
            elif action == "cut":
                lines[at] = line[: draw(st.integers(0, len(line)))]
            elif words:
                word = draw(st.sampled_from(words))
                new = draw(st.sampled_from(TOKENS) | st.text(max_size=4))
                lines[at] = line[: word.start()] + new + line[word.end() :]
        return "\n".join([*lines, ""]).encode("utf-8", "replace")

    return damaged()


# ------------------------------------------------------------------------------------------------- TOML
_VALUES = st.one_of(
    st.sampled_from([-1, 0, 0.5, 1e308, -1e308, 1e30, 5e-324, math.nan, math.inf, 10**400, 10**5000, True, "", "x"]),
    st.integers(-(10**6), 10**6) | st.floats() | st.text(st.characters(codec="ascii"), max_size=4),
    st.lists(st.floats(-10, 10), max_size=7),
    st.sampled_from([[[1.0], [2.0]], {}, {"value": 1.0, "unit": "m"}]),
)


def damaged_toml(seed: bytes) -> st.SearchStrategy[bytes]:
    """Values of another size, sign or type, tables nested deeper or not at all, keys changed or gone."""
    sound = tomllib.loads(seed.decode())

    @st.composite
    def damaged(draw: Draw) -> bytes:
        tree = copy.deepcopy(sound)
        for _ in range(draw(st.integers(1, 3))):
            table, key = draw(st.sampled_from(list(_entries(tree))))
            action = draw(st.sampled_from(["value", "value", "value", "drop", "rename", "nest", "copy"]))
            if action == "value":
                table[key] = copy.deepcopy(draw(_VALUES))
            elif action == "drop":
                del table[key]
            elif action == "rename":
                table[draw(st.sampled_from(["odd", "", "a.b", "kind", "value", "effect", "9"]))] = table.pop(key)
            elif action == "nest":
                table[key] = draw(st.sampled_from([{"in": table[key]}, [table[key]], "text"]))
            else:
                other, into = draw(st.sampled_from(list(_entries(tree))))
                other[into] = copy.deepcopy(table[key])
        return toml_text(tree).encode()

    return damaged()


def _entries(tree: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Every key of a tree with the table that it stands in; one more at the end, so that there always is one."""
    for key, value in tree.items():
        yield tree, key
        if isinstance(value, dict):
            yield from ((table, k) for table, k in _entries(value) if k != "more")
    tree.setdefault("more", {})
    yield tree, "more"


def toml_text(tree: dict[str, Any]) -> str:
    """A tree in TOML, one line a key of the top, all that lies deeper in inline tables."""
    return "".join(
        f"{json.dumps(key)} = {_toml(value)}\n" for key, value in tree.items() if value != {} or key != "more"
    )


def _toml(value: object) -> str:
    if isinstance(value, dict):
        inside = (f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items() if v != {} or k != "more")
        return f"{{ {', '.join(inside)} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, int) and not isinstance(value, bool):
        return hex(value) if value > 10**4000 else str(value)  # Python writes no longer decimal
    if isinstance(value, float):
        return str(value) if not math.isfinite(value) else repr(value)
    return json.dumps(value, default=str).replace("\x7f", "\\u007f")


# ------------------------------------------------------------------------------------------------- netCDF and HDF5
_ATTRIBUTES = st.one_of(
    st.sampled_from(["", "nan", "m", "mm, rad", "x" * 300, "a\0b", "../up", "é", "m, rad", -1, 0, 3, 0.5, 1e308]),
    st.integers(-(2**31), 2**31) | st.floats(),
    st.lists(st.integers(-9, 9), max_size=3).map(np.array),
)
_KEYS = ("units", "sample_rate_hz", "layout_version", "valves_per_horizontal_actuator", "kind", "test", "specimen")
_CODING = ("scale_factor", "add_offset", "missing_value", "_FillValue", "_Unsigned", "coordinates", "dtype", "calendar")
_TYPES = ("i1", "i8", "u1", "u8", "f2", "f4", "c16", "?", "U", "S")
_SIZES = (math.nan, math.inf, 1e308, -1e308, 1e200, 1e30, 1e-320, -1.0, 0.0)


def damaged_netcdf(sound: xr.Dataset) -> st.SearchStrategy[bytes]:
    """Variables gone, renamed, of another type or shape; attributes likewise; values that are none; no samples."""

    @st.composite
    def damaged(draw: Draw) -> bytes:
        data = sound.copy(deep=True)
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                for _ in range(draw(st.integers(1, 3))):
                    name = draw(st.sampled_from(sorted(map(str, data.variables))))
                    data = draw(st.sampled_from(_NETCDF))(draw, data, name)
                return bytes(data.to_netcdf(engine="h5netcdf", invalid_netcdf=True))
        except Exception:  # of xarray, h5netcdf, h5py and pandas
            reject()  # not even they can write that

    return damaged()


def _gone(draw: Draw, data: xr.Dataset, name: str) -> xr.Dataset:
    return data.drop_vars(name)


def _renamed(draw: Draw, data: xr.Dataset, name: str) -> xr.Dataset:
    names = sorted({*map(str, data.variables), *map(str, data.dims)})
    return data.rename({name: draw(st.sampled_from(["odd", *names]))})


def _retyped(draw: Draw, data: xr.Dataset, name: str) -> xr.Dataset:
    return _put(data, name, data[name].dims, data[name].values.astype(draw(st.sampled_from(_TYPES))))


def _revalued(draw: Draw, data: xr.Dataset, name: str) -> xr.Dataset:
    values = data[name].values.astype(float)
    if draw(st.booleans()):
        values = values * draw(st.sampled_from(_SIZES))
    elif values.size:
        values.flat[draw(st.integers(0, values.size - 1))] = draw(st.sampled_from(_SIZES))
    return _put(data, name, data[name].dims, values)


def _reshaped(draw: Draw, data: xr.Dataset, name: str) -> xr.Dataset:
    item = data[name]
    if draw(st.booleans()) or not item.dims:
        item = item.expand_dims(draw(st.sampled_from(["odd", "axis", "actuator"])))
    elif item.ndim > 1 and draw(st.booleans()):
        item = item.transpose(*item.dims[::-1])
    else:
        item = item.isel({draw(st.sampled_from(item.dims)): 0})
    return _put(data, name, item.dims, item.values)


def _resized(draw: Draw, data: xr.Dataset, name: str) -> xr.Dataset:
    if not data.sizes:
        return data
    dim = draw(st.sampled_from(sorted(map(str, data.sizes))))
    return data.isel({dim: draw(st.lists(st.integers(0, max(data.sizes[dim] - 1, 0)), max_size=4))})


def _described(draw: Draw, data: xr.Dataset, name: str) -> xr.Dataset:
    data = data.copy()
    attrs = draw(st.sampled_from([data.attrs, data[name].attrs]))
    key = draw(st.sampled_from([*map(str, attrs), *_KEYS, *_CODING]))
    if key in attrs and draw(st.booleans()):
        del attrs[key]
    else:
        attrs[key] = draw(_ATTRIBUTES)
    return data


def _put(data: xr.Dataset, name: str, dims: Any, values: Any) -> xr.Dataset:
    return data.drop_vars(name).assign({name: (dims, values, dict(data[name].attrs))})


_NETCDF = (_gone, _renamed, _retyped, _revalued, _revalued, _reshaped, _resized, _described, _described)


def outside_heaps(content: bytes) -> list[int]:
    """Places outside HDF5's global heap: with a damaged heap the HDF5 library itself may never return."""
    heaps = [m.start() for m in re.finditer(b"GCOL", content)]
    spans = [range(k, k + int.from_bytes(content[k + 8 : k + 16], "little")) for k in heaps]
    return [k for k in range(len(content)) if not any(k in span for span in spans)]


_NAMES = st.sampled_from(["Long Displ fbk [in]", *"time t dt fs rate x_m a b names columns units unit desc".split()])


def _array(shape: list[int], kind: str, scale: float) -> np.ndarray:
    """Numbers that rise, or are all zero, infinite or none."""
    with np.errstate(all="ignore"):
        return (scale * np.arange(1, 1 + math.prod(shape)).reshape(shape)).astype(kind)


_ARRAYS = st.builds(
    _array,
    st.lists(st.sampled_from([0, 1, 2, 3, 4, 9]), min_size=1, max_size=3),
    st.sampled_from(["f8", "f4", "i2", "u1", "c16"]),
    st.sampled_from([1.0, 0.0, -1.0, 1e308, math.nan, math.inf, 5e-324, 0.01]),
)
_LEAVES = st.one_of(
    _ARRAYS,
    _ARRAYS,
    st.just(np.arange(9) * 0.1),
    st.sampled_from([0.0, -1.0, 0.01, 5e-324, math.inf, math.nan, 100, 1e308]),
    st.sampled_from(["s", "in", "", "é", "ms", "a\0b", "min"]),
    st.sampled_from([["a", "b"], ["s", "m", "m"], ["x"], []]).map(lambda texts: np.array(texts, dtype=object)),
)
trees = st.recursive(
    st.dictionaries(_NAMES, _LEAVES, max_size=5), lambda inner: st.dictionaries(_NAMES, _LEAVES | inner, max_size=4)
)
"""Named arrays, numbers and texts, in groups."""


def mat_file(tree: dict[str, Any], version: str = "5") -> bytes:
    """A MATLAB file of a tree."""
    from scipy.io import savemat

    content = io.BytesIO()
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            savemat(content, {re.sub(r"\W", "_", k): v for k, v in tree.items()}, format=version)
        except (TypeError, ValueError):
            reject()
    return content.getvalue()


def hdf5_file(tree: dict[str, Any], matlab: bool = False) -> bytes:
    """An HDF5 file of a tree, texts and numbers as attributes; or all as datasets behind MATLAB's header."""
    content = io.BytesIO()
    with h5py.File(content, "w", userblock_size=512 if matlab else 0) as file:
        _fill(file, tree, matlab)
    head = b"MATLAB 7.3 MAT-file".ljust(512) if matlab else b""
    return head + content.getvalue()[len(head) :]


def _fill(group: Any, tree: dict[str, Any], matlab: bool) -> None:
    for name, value in tree.items():
        try:
            if isinstance(value, dict):
                _fill(group.create_group(name), value, matlab)
            elif isinstance(value, np.ndarray) or (matlab and not isinstance(value, str)):
                group[name] = value
            else:
                group.attrs[name] = value
        except (TypeError, ValueError):
            reject()  # not even h5py can write that
