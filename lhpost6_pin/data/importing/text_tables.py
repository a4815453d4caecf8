"""Tables as CSV or other text, and Parquet: a row a sample, a column a channel, units in the header or a row of units.

Text may be separated by commas, semicolons, tabs or blanks, with decimal points or commas. Lines that begin with
`#` or `%` are comments; `# key: value` among them are facts about the test. A column of clock times is time.
"""

import re
from collections.abc import Sequence
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np

from ...core.arrays import Array
from ...core.errors import RecordError
from ...core.number_table import (
    HOLES,
    Dialect,
    has_decimal_comma,
    is_number,
    read_rows,
    split_at_commas,
)
from ...core.units import quantity_unit
from .channel_units import si_factor, time_unit, unit_in_name
from .clock_stamps import is_stamp, take_stamps
from .raw import RawTest, make_raw, shown

__all__ = ["is_note", "read_parquet", "read_table"]

_FACT = re.compile(r"[#%]\s*(?P<key>\w[\w .]{0,60}?)\s*[:=]\s*(?P<value>.*)")
_SEPARATORS = (",", ";", "\t", "|", " ")
_DIALECTS = (*(Dialect(s, ".") for s in _SEPARATORS), *(Dialect(s, ",") for s in _SEPARATORS[1:]))
_COMMAS = "write decimals with points, as 0.01, or all of them with commas and semicolons between columns"
_SAMPLE = 200  # lines from which separator and header are found


class _Layout(NamedTuple):
    """Where the numbers of a text begin."""

    dialect: Dialect
    first: int  # line of the first sample, from 0
    width: int  # columns


# --------------------------------------------------------------------------------------------- text
def read_table(content: bytes, source: str) -> RawTest:
    """Read a table of numbers in text; raises RecordError naming file, line and column."""
    lines = _decoded(content).splitlines()
    if not any(line.strip() for line in lines):
        raise RecordError(f"{source}: is empty")
    layout = _sniff(lines, source)
    names, units = _head(lines, layout, source)
    rows = [(k, line) for k, line in enumerate(lines[layout.first :], layout.first + 1) if not _is_comment(line)]
    stamped, rows, seconds = take_stamps(rows, layout.dialect, names, source)
    remedy = "correct it, or leave it empty for a missing sample"
    refused: dict[str, Any] = {"error": RecordError, "commas": _COMMAS, "correct": remedy}
    values = read_rows(rows, names, layout.dialect, source, **refused, holes=True)
    if stamped:
        values[:, stamped[0]], units[stamped[0]] = seconds, "s"
    if not names[-1] and np.isnan(values[:, -1]).all():  # each line ends with a separator
        names, units, values = names[:-1], units[:-1], values[:, :-1]
    facts = {m["key"]: m["value"].strip() for line in lines[: layout.first] if (m := _FACT.fullmatch(line.strip()))}
    return _raw_of_columns(source, "table in text", names, units, values, facts, stamped)


def is_note(content: bytes) -> bool:
    """Whether a text of some words holds no row of numbers, nor one with an odd field: it is no damaged table."""
    lines = _decoded(content).splitlines()[:_SAMPLE]
    table = any(_number_rows(lines, dialect) for dialect in _DIALECTS) or _why_no_row(lines)
    return any(line.strip() for line in lines) and not table


def _decoded(content: bytes) -> str:
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")  # as Windows programs write ° and µ


def _is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip()[0] in "#%"


def _sniff(lines: Sequence[str], source: str) -> _Layout:
    """Separator and decimal mark by which most lines are equally long rows of numbers."""
    best: tuple[int, _Layout] | None = None
    for dialect in _DIALECTS:
        rows = _number_rows(lines[:_SAMPLE], dialect)
        if not rows:
            continue
        counts = [count for _, count in rows]
        count = max(set(counts), key=counts.count)
        first = next(number for number, n in rows if n == count)
        score = counts.count(count) if count > 1 else 1
        if best is None or score > best[0]:
            best = score, _Layout(dialect, first, count)
    if best is None:
        remedy = _why_no_row(lines[:_SAMPLE]) or "give a header row of names, then one row per sample"
        raise RecordError(f"{source}: no row of numbers found; {remedy}")
    return best[1]


def _number_rows(lines: Sequence[str], dialect: Dialect) -> list[tuple[int, int]]:
    """Lines, from 0, that are rows of numbers, and the fields in each."""
    rows = []
    for number, line in enumerate(lines):
        fields = [] if _is_comment(line) else dialect.split(line)
        if any(c.isdigit() for field in fields for c in field) and all(_fits(field, dialect) for field in fields):
            rows.append((number, len(fields)))
    return rows


def _why_no_row(lines: Sequence[str]) -> str:
    """What keeps lines that nearly are rows of numbers from being any; empty if none nearly is."""
    quoted = any(has_decimal_comma(field) for line in lines for field in Dialect(",").split(line))
    return _COMMAS if quoted else _odd_field(lines)


def _odd_field(lines: Sequence[str]) -> str:
    """The first field that is no number in the first line of which most are; empty if there is none."""
    for number, line in enumerate(lines, start=1):
        for dialect in () if _is_comment(line) else _DIALECTS:
            fields = dialect.split(line)
            odd = [k for k, field in enumerate(fields) if not _fits(field, dialect)]
            if 0 < len(odd) < 0.5 * len(fields):
                what = f"line {number}, column {odd[0] + 1}: {fields[odd[0]][:40]!r}"
                return f"{what} is neither a number nor a time as 12:00:00.25; correct that column, or leave it out"
    return ""


def _fits(field: str, dialect: Dialect) -> bool:
    """Whether a field may stand in a row of numbers."""
    whole = is_number(field, dialect) and not (dialect.decimal == "," and "." in field)
    return whole or field.lower() in HOLES or is_stamp(field)


def _head(lines: Sequence[str], layout: _Layout, source: str) -> tuple[list[str], list[str | None]]:
    """Column names, and units from a row of them or from the names."""
    dialect, first, width = layout
    plain = [line for line in lines[:first] if not _is_comment(line)]
    comments = [line.lstrip(" \t#%") for line in lines[:first] if line.strip() and _is_comment(line)]
    where = f"{source}, line {first + 1}"
    above = [dialect.split(line) for line in (plain or comments)[-2:]]
    rows = [row for row in above if len(row) == width]
    if not rows:
        commas = above and split_at_commas(lines[first], dialect, len(above[-1]))
        remedy = _COMMAS if commas else "add one, with units"
        if not commas and above and len(above[-1]) > 1:
            remedy = (
                f"the last line above has {len(above[-1])} ({', '.join(above[-1])[:80]}); add or remove what differs"
            )
        raise RecordError(f"{where}: no header row of {width} names above the numbers; {remedy}")
    names = rows[-1]
    if len(rows) == 2 and _is_unit_row(names):
        return rows[0], [unit.strip("[]() ") or None for unit in names]
    if _is_unit_row(names):
        raise RecordError(f"{where}: units above the numbers, but no names; add a header row of names")
    return names, [unit_in_name(name) for name in names]


def _is_unit_row(row: Sequence[str]) -> bool:
    texts = [field.strip("[]() ") for field in row]
    known = sum(quantity_unit(text) is not None for text in texts if text)
    return known > 0 and 2 * known >= sum(map(bool, texts))


# --------------------------------------------------------------------------------------------- Parquet
def read_parquet(content: bytes, source: str, form: str) -> RawTest:
    """Read a Parquet table; columns that hold no numbers are omitted."""
    import pandas as pd

    table = pd.read_parquet(BytesIO(content))
    if table.index.name is not None:
        table = table.reset_index()
    numeric = table.select_dtypes("number")
    facts = {str(key): str(value) for key, value in table.attrs.items()}
    names = [str(name) for name in numeric.columns]
    return _raw_of_columns(source, form, names, [unit_in_name(n) for n in names], numeric.to_numpy(float), facts)


# --------------------------------------------------------------------------------------------- both
def _raw_of_columns(
    source: str,
    form: str,
    names: Sequence[str],
    units: Sequence[str | None],
    values: Array,
    facts: dict[str, str],
    stamped: Sequence[int] = (),
) -> RawTest:
    """Take the column of time out of a table: one named so, else that of clock times, `stamped`, and its dates."""
    clocks = [k for k, name in enumerate(names) if time_unit(name, units[k]) and k not in stamped[1:]]
    if len(clocks) > 1:
        raise RecordError(f"{source}: {shown([names[k] for k in clocks])} are all named as time; rename all but one")
    if not clocks:
        clocks = [*stamped[:1]]
    if not clocks:  # named in a language of its own
        own = [k for k, unit in enumerate(units) if unit and quantity_unit(unit) == "s"]
        clocks = [k for k in own[:1] if len(values) > 1 and np.all(np.diff(values[:, k]) > 0)]
    time = None
    if clocks:
        with np.errstate(over="ignore"):  # times without end are refused with their sample
            unit = time_unit(names[clocks[0]], units[clocks[0]]) or units[clocks[0]] or "s"
            time = values[:, clocks[0]] * si_factor(unit, "s")
    rest = [k for k in range(len(names)) if k not in (*clocks, *stamped)]
    channels = [names[k] for k in rest], [units[k] for k in rest]
    return make_raw(source, form, *channels, values[:, rest], time, facts, numbers=[k + 1 for k in rest])
