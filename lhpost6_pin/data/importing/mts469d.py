"""Data files of the MTS 469D: header records of a key and a value, then all channels sample by sample.

In the binary form a record is 128 bytes, a key of 32 characters and a value of 96, and the samples are float32 to
the end of the file. The text form has a line for each record, and then numbers. EXTENDED_HEADER_RECORDS in a header
is the number of records of any other key that follow it.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array
from ...core.errors import RecordError
from .raw import RawTest, make_raw

__all__ = ["is_469d", "read_469d"]

_RECORD, _KEY_WIDTH = 128, 32
_EXTENDED = "EXTENDED_HEADER_RECORDS"
_KEY = re.compile(r"[A-Z][A-Z0-9_]*(?:\.[A-Z0-9_]+)*")
_LINE = re.compile(rf"\s*(?P<key>{_KEY.pattern})\s*(?:[:=,\t]\s*|\s+|$)(?P<value>.*)")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?|[-+]?(?:nan|inf)", re.I)
_LIKELY = (1e-15, 1e15)  # magnitudes that a measured number has in whatever unit; swapped bytes spread over 76 decades


class _Header(NamedTuple):
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    step: float  # [s]
    facts: Mapping[str, str]


def is_469d(content: bytes) -> bool:
    """Whether a file begins as the 469D's do."""
    return content.startswith(b"FILE_TYPE")


def read_469d(content: bytes, source: str) -> RawTest:
    """Read the content of a 469D file, binary or text; raises RecordError naming file, key, channel or sample.

    The byte order of a binary file is the one in which most numbers have a likely size.
    """
    text = b"\n" in content[: _RECORD + 1] or b"\r" in content[: _RECORD + 1]
    entries, values, form = _read_text(content, source) if text else _read_binary(content, source)
    header = _header(entries, source)
    count = len(header.names)
    if len(values) % count:
        lost = f"{len(values) % count} of {count} channels"
        raise RecordError(
            f"{source}: ends within sample {len(values) // count}, after {lost}: the file is cut short, or CHANNELS "
            "is wrong; fetch it again"
        )
    # what is not finite is refused with its sample: signalling NaN of a binary file, times without end
    with np.errstate(over="ignore", invalid="ignore"):
        table = values.reshape(-1, count).astype(np.float64)
        time = header.step * np.arange(len(table), dtype=np.float64)
    return make_raw(source, form, header.names, header.units, table, time, header.facts)


# --------------------------------------------------------------------------------------------- binary
def _read_binary(content: bytes, source: str) -> tuple[dict[str, str], NDArray[np.floating], str]:
    entries: dict[str, str] = {}
    place, further = 0, None  # records that EXTENDED_HEADER_RECORDS still announces
    while further != 0 and (record := _record(content[place : place + _RECORD])):
        _add(entries, *record, f"{source}, byte {place}")
        place += _RECORD
        further = further - 1 if further else _count(entries, _EXTENDED, source) if record[0] == _EXTENDED else None
    if further:
        raise RecordError(f"{source}: {_EXTENDED} announces {further} more records than there are; the file is damaged")
    _header(entries, source)  # errors of the header before those of misread samples
    data = content[place:]
    if len(data) % 4:
        raise RecordError(
            f"{source}: {len(data)} bytes of samples after {place // _RECORD} header records are no whole number of "
            "float32; the file is cut short: fetch it again"
        )
    orders = [np.frombuffer(data, dtype) for dtype in ("<f4", ">f4")]
    likely = [_share_of_likely(values) for values in orders]
    return entries, orders[likely[1] > likely[0]], "469D binary"


def _record(block: bytes) -> tuple[str, str] | None:
    """Key and value of a header record; None for a block of samples."""
    if len(block) < _RECORD or not all(b in (0, 9) or 32 <= b < 127 or b >= 160 for b in block):
        return None
    key, value = (part.decode("latin-1").strip(" \t\0") for part in (block[:_KEY_WIDTH], block[_KEY_WIDTH:]))
    return (key, value) if _KEY.fullmatch(key) else None


def _share_of_likely(values: NDArray[np.float32]) -> float:
    with np.errstate(invalid="ignore"):  # signalling NaN in misread bytes
        size = np.abs(values)
        return float(np.mean((size == 0) | ((size > _LIKELY[0]) & (size < _LIKELY[1])))) if len(values) else 0.0


# --------------------------------------------------------------------------------------------- text
def _read_text(content: bytes, source: str) -> tuple[dict[str, str], Array, str]:
    lines = content.decode("latin-1").splitlines()
    entries: dict[str, str] = {}
    start = len(lines)
    for number, line in enumerate(lines):
        match = _LINE.fullmatch(line.rstrip(" \t\0"))
        if match is None and line.strip():
            start = number
            break
        if match:
            _add(entries, match["key"], match["value"].strip(), f"{source}, line {number + 1}")
    count = len(_header(entries, source).names)
    rows = [re.sub(r"[,;\t]", " ", line).split() for line in lines[start:]]
    try:
        values = np.array([word for row in rows for word in row], dtype=float)
    except ValueError:
        values = np.array([_number(word, row, source, start) for row in enumerate(rows) for word in row[1]])
    odd = next((k for k, row in enumerate(rows) if row and len(row) != count), None)
    if len(values) % count and odd is not None:
        raise RecordError(
            f"{source}, line {start + odd + 1}: {len(rows[odd])} numbers for {count} channels; the file is cut short, "
            "or CHANNELS is wrong"
        )
    return entries, values, "469D text"


def _number(word: str, row: tuple[int, list[str]], source: str, start: int) -> float:
    if not _NUMBER.fullmatch(word):
        where = f"{source}, line {start + row[0] + 1}, number {row[1].index(word) + 1}"
        raise RecordError(f"{where}: {word[:40]!r} is not a number; correct it, or write nan for a missing sample")
    return float(re.sub("[dD]", "e", word))


# --------------------------------------------------------------------------------------------- header
def _add(entries: dict[str, str], key: str, value: str, where: str) -> None:
    if key in entries:
        raise RecordError(f"{where}: {key} is given twice; the header is damaged")
    entries[key] = value


def _header(entries: Mapping[str, str], source: str) -> _Header:
    """Channels and time step; raises RecordError naming the key that is missing or makes no sense."""
    count = _count(entries, "CHANNELS", source)
    described = sum(key.startswith("DESC.CHAN_") for key in entries)
    missing = [f"DESC.CHAN_{k}" for k in range(1, min(count, len(entries)) + 1) if f"DESC.CHAN_{k}" not in entries]
    if not 1 <= count <= len(entries) or missing or f"DESC.CHAN_{count + 1}" in entries:
        lost = f"{missing[0]} is missing" if missing else "the header is damaged"
        raise RecordError(f"{source}: CHANNELS is {count}, described are {described}; {lost}")
    try:
        step = float(entries["DELTA_T"].split()[0])
    except (KeyError, IndexError, ValueError):
        step = -1.0
    if not (np.isfinite(step) and step > 0):
        found = f"is {entries['DELTA_T'][:40]!r}" if "DELTA_T" in entries else "is missing"
        raise RecordError(f"{source}: DELTA_T {found}; it must be the sample interval in seconds")
    channels = range(1, count + 1)
    names = tuple(entries[f"DESC.CHAN_{k}"] or f"channel {k}" for k in channels)
    units = tuple(entries.get(f"UNITS.CHAN_{k}") for k in channels)
    facts = {key: value for key, value in entries.items() if ".CHAN_" not in key}
    return _Header(names, units, step, facts)


def _count(entries: Mapping[str, str], key: str, source: str) -> int:
    text = entries.get(key)
    if text is None or not re.fullmatch(r"\d{1,9}", text):
        found = "is missing" if text is None else f"is {text[:40]!r}"
        raise RecordError(f"{source}: {key} {found}; it must be a whole number")
    return int(text)
