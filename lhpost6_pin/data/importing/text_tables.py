"""Tables as CSV or other text, and Parquet: a row a sample, a column a channel, units in the header or a row of units.

Text may be separated by commas, semicolons, tabs or blanks, with decimal points or commas. Lines that begin with
`#` or `%` are comments; `# key: value` among them are facts about the test.
"""

import csv
import re
from collections.abc import Sequence
from io import BytesIO, StringIO
from typing import NamedTuple

import numpy as np

from ...core.decimals import cut_at_decimal_commas, has_decimal_comma
from ...core.errors import RecordError
from .channel_units import quantity_unit, si_factor, time_unit, unit_in_name
from .raw import Array, RawTest, make_raw, shown

__all__ = ["read_parquet", "read_table"]

_FACT = re.compile(r"[#%]\s*(?P<key>\w[\w .]{0,60}?)\s*[:=]\s*(?P<value>.*)")
_SEPARATORS = (",", ";", "\t", "|", " ")  # a blank stands for any number of them
_HOLES = frozenset(("", "nan", "na", "n/a", "null", "none", "-", "#n/a"))
_COMMAS = "write decimals with points, as 0.01, or all of them with commas and semicolons between columns"
_SAMPLE = 200  # lines that are looked at to find separator and header


class _Dialect(NamedTuple):
    separator: str
    decimal: str
    first: int  # line of the first sample, from 0
    width: int  # columns

    def split(self, line: str) -> list[str]:
        """Fields of a line."""
        if self.separator == " ":
            return line.split()
        return [field.strip() for field in next(csv.reader([line.strip(" \r\n")], delimiter=self.separator), [])]


_BY_COMMAS = _Dialect(",", ".", 0, 0)


# --------------------------------------------------------------------------------------------- text
def read_table(content: bytes, source: str) -> RawTest:
    """Read a table of numbers in text; raises RecordError naming file, line and column."""
    lines = _decoded(content).splitlines()
    if not any(line.strip() for line in lines):
        raise RecordError(f"{source}: is empty")
    try:
        dialect = _sniff(lines, source)
        names, units = _head(lines, dialect, source)
        values = _numbers(lines, dialect, names, source)
    except csv.Error as error:
        raise RecordError(f"{source}: cannot be read as a table: {error}; save it as plain CSV") from error
    if not names[-1] and np.isnan(values[:, -1]).all():  # each line ends with a separator
        names, units, values = names[:-1], units[:-1], values[:, :-1]
    facts = {m["key"]: m["value"].strip() for line in lines[: dialect.first] if (m := _FACT.fullmatch(line.strip()))}
    return _raw_of_columns(source, "table in text", names, units, values, facts)


def _decoded(content: bytes) -> str:
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")  # as Windows programs write ° and µ


def _is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip()[0] in "#%"


def _sniff(lines: Sequence[str], source: str) -> _Dialect:
    """Find the separator and decimal mark that make the most of the lines into equally long rows of numbers."""
    best: tuple[int, _Dialect] | None = None
    candidates = [(separator, ".") for separator in _SEPARATORS] + [(s, ",") for s in _SEPARATORS[1:]]
    for separator, decimal in candidates:
        dialect = _Dialect(separator, decimal, 0, 0)
        rows: list[tuple[int, int]] = []
        for number, line in enumerate(lines[:_SAMPLE]):
            fields = [] if _is_comment(line) else dialect.split(line)
            if fields and any(map(_digits, fields)) and all(_is_number(field, decimal) for field in fields):
                rows.append((number, len(fields)))
        if not rows:
            continue
        counts = [count for _, count in rows]
        count = max(set(counts), key=counts.count)
        first = next(number for number, n in rows if n == count)
        score = counts.count(count) if count > 1 else 1
        if best is None or score > best[0]:
            best = score, _Dialect(separator, decimal, first, count)
    if best is None:
        quoted = any(has_decimal_comma(field) for line in lines[:_SAMPLE] for field in _BY_COMMAS.split(line))
        remedy = _COMMAS if quoted else "give a header row of names, then one row per sample"
        raise RecordError(f"{source}: no row of numbers found; {remedy}")
    return best[1]


def _digits(field: str) -> bool:
    return any(c.isdigit() for c in field)


def _is_number(field: str, decimal: str) -> bool:
    if field.lower() in _HOLES:
        return True
    if decimal == "," and "." in field:
        return False
    try:
        float(field.replace(",", ".") if decimal == "," else field)
    except ValueError:
        return False
    return True


def _head(lines: Sequence[str], dialect: _Dialect, source: str) -> tuple[list[str], list[str | None]]:
    """Column names, and units from a row of them or from the names."""
    plain = [line for line in lines[: dialect.first] if not _is_comment(line)]
    comments = [line.lstrip(" \t#%") for line in lines[: dialect.first] if line.strip() and _is_comment(line)]
    where = f"{source}, line {dialect.first + 1}"
    above = [dialect.split(line) for line in (plain or comments)[-2:]]
    rows = [row for row in above if len(row) == dialect.width]
    if not rows:
        commas = above and _cut_decimals(lines[dialect.first], dialect, len(above[-1]))
        remedy = _COMMAS if commas else "add one, with units"
        raise RecordError(f"{where}: no header row of {dialect.width} names above the numbers; {remedy}")
    names = rows[-1]
    if len(rows) == 2 and _is_unit_row(names):
        return rows[0], [unit.strip("[]() ") or None for unit in names]
    if _is_unit_row(names):
        raise RecordError(f"{where}: there are units above the numbers, but no names; add a header row of names")
    return names, [unit_in_name(name) for name in names]


def _is_unit_row(row: Sequence[str]) -> bool:
    texts = [field.strip("[]() ") for field in row]
    known = sum(quantity_unit(text) is not None for text in texts if text)
    return known > 0 and 2 * known >= sum(map(bool, texts))


def _numbers(lines: Sequence[str], dialect: _Dialect, names: Sequence[str], source: str) -> Array:
    """All rows (n, k); only the slow reading of a faulty file looks at one field after the other."""
    import pandas as pd

    numbered = [(k, line) for k, line in enumerate(lines[dialect.first :], dialect.first) if not _is_comment(line)]
    for k, line in numbered:
        count = len(dialect.split(line)) if dialect.separator == " " or '"' in line else _fields(line, dialect)
        if count != dialect.width:
            remedy = _COMMAS if _cut_decimals(line, dialect, dialect.width) else "correct it, or cut the table there"
            raise RecordError(f"{source}, line {k + 1}: {count} fields, the header has {dialect.width}; {remedy}")
    try:
        table = pd.read_csv(
            StringIO("\n".join(line.strip(" \r\n") for _, line in numbered)),
            sep=r"\s+" if dialect.separator == " " else dialect.separator,
            decimal=dialect.decimal,
            header=None,
            names=range(dialect.width),
            index_col=False,
            skipinitialspace=True,
            skip_blank_lines=False,
            float_precision="round_trip",
            na_values=[hole for hole in _HOLES if hole] + ["NAN", "NaN", "NA"],
            dtype=float,
        )
        values = table.to_numpy(float)
    except Exception:  # pandas raises its own, value and overflow errors for what is no number
        values = np.empty((0, 0))
    if len(values) == len(numbered):
        return values
    rows = [
        [_value(field, (k, name), dialect, source) for field, name in zip(dialect.split(line), names, strict=True)]
        for k, line in numbered
    ]
    return np.array(rows, dtype=float)


def _fields(line: str, dialect: _Dialect) -> int:
    return line.strip(" \r\n").count(dialect.separator) + 1


def _cut_decimals(line: str, dialect: _Dialect, columns: int) -> bool:
    return dialect.separator == "," and cut_at_decimal_commas(dialect.split(line), columns)


def _value(field: str, place: tuple[int, str], dialect: _Dialect, source: str) -> float:
    if field.lower() in _HOLES:
        return float("nan")
    try:
        return float(field.replace(",", ".") if dialect.decimal == "," else field)
    except ValueError:
        line, name = place
        remedy = _COMMAS if has_decimal_comma(field) else "correct it, or leave it empty for a missing sample"
        raise RecordError(
            f"{source}, line {line + 1}, column {name!r}: {field[:40]!r} is not a number; {remedy}"
        ) from None


# --------------------------------------------------------------------------------------------- Parquet
def read_parquet(content: bytes, source: str) -> RawTest:
    """Read a Parquet table; columns that hold no numbers are left out. Raises RecordError naming the file."""
    import pandas as pd

    try:
        import pyarrow  # noqa: F401  # what pandas reads Parquet with
    except ModuleNotFoundError as error:
        raise RecordError(f"{source}: reading Parquet needs pyarrow: pip install 'lhpost6-pin[formats]'") from error
    try:
        table = pd.read_parquet(BytesIO(content))
    except Exception as error:  # a damaged file makes Arrow raise nearly anything
        raise RecordError(f"{source}: not a Parquet file, or damaged: {error}; export it again") from error
    if table.index.name is not None:
        table = table.reset_index()
    numeric = table.select_dtypes("number")
    facts = {str(key): str(value) for key, value in table.attrs.items()}
    names = [str(name) for name in numeric.columns]
    return _raw_of_columns(source, "Parquet", names, [unit_in_name(n) for n in names], numeric.to_numpy(float), facts)


# --------------------------------------------------------------------------------------------- both
def _raw_of_columns(
    source: str, form: str, names: Sequence[str], units: Sequence[str | None], values: Array, facts: dict[str, str]
) -> RawTest:
    """Take the column of time out of a table."""
    clocks = [k for k, name in enumerate(names) if time_unit(name, units[k])]
    if len(clocks) > 1:
        raise RecordError(f"{source}: {shown([names[k] for k in clocks])} are all named as time; rename all but one")
    time = None
    if clocks:
        with np.errstate(over="ignore"):  # times without end are refused with their sample
            time = values[:, clocks[0]] * si_factor(time_unit(names[clocks[0]], units[clocks[0]]) or "s", "s")
    rest = [k for k in range(len(names)) if k not in clocks]
    return make_raw(source, form, [names[k] for k in rest], [units[k] for k in rest], values[:, rest], time, facts)
