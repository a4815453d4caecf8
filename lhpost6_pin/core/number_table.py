"""Rows of numbers in text: their fields, and errors that name line and column."""

import csv
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .arrays import Array
from .errors import LhpostError

__all__ = ["HOLES", "Dialect", "has_decimal_comma", "is_number", "read_rows", "split_at_commas"]

HOLES = frozenset(("", "nan", "na", "n/a", "null", "none", "-", "#n/a"))
"""Fields, in lower case, of a missing sample."""

_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_WHOLE = re.compile(r"[+-]?\d+([eE][+-]?\d+)?")


class Dialect(NamedTuple):
    """Separator of fields (a blank stands for any number of them) and decimal mark."""

    separator: str
    decimal: str = "."

    def split(self, line: str) -> list[str]:
        """Fields of a line."""
        if self.separator == " ":
            return line.split()
        bare = line.strip(" \r\n")
        try:
            fields = next(csv.reader([bare], delimiter=self.separator, skipinitialspace=True), [])
        except csv.Error:  # a field longer than any number
            fields = bare.split(self.separator)
        return [field.strip() for field in fields]

    def count(self, line: str) -> int:
        """Number of fields of a line."""
        quick = self.separator != " " and '"' not in line
        return line.strip(" \r\n").count(self.separator) + 1 if quick else len(self.split(line))

    def number(self, field: str) -> float:
        """Value of a field; raises ValueError if it is not a number."""
        return float(field.replace(",", ".") if self.decimal == "," else field)


def is_number(field: str, dialect: Dialect) -> bool:
    """Whether a field is a number."""
    try:
        dialect.number(field)
    except ValueError:
        return False
    return True


def has_decimal_comma(field: str) -> bool:
    """Whether a field is a number with a comma for its point."""
    return bool(_COMMA.fullmatch(field.strip(' "')))


def split_at_commas(line: str, dialect: Dialect, columns: int) -> bool:
    """Whether a line has more fields than `columns` because its decimal commas were taken for separators.

    All fields are whole numbers then, and twice as many; where fewer are split, one begins with a zero (0,05).
    """
    bare = [field.strip(' "') for field in dialect.split(line)]
    whole = dialect.separator == "," and len(bare) > columns and all(map(_WHOLE.fullmatch, bare))
    return whole and (len(bare) == 2 * columns or any(re.match(r"0\d", field) for field in bare))


def read_rows(
    lines: Sequence[tuple[int, str]],
    names: Sequence[str],
    dialect: Dialect,
    where: str,
    *,
    error: type[LhpostError],
    commas: str,
    correct: str,
    holes: bool = False,
) -> Array:
    """Numbers (n, columns) of lines, each with its number in the file; with `holes` NaN for missing samples.

    Raises `error` naming line and column, with the remedy for decimal `commas` or how to `correct` any other field.
    """
    for k, line in lines:
        if (count := dialect.count(line)) != len(names):
            remedy = commas if split_at_commas(line, dialect, len(names)) else "correct it, or cut the table there"
            raise error(f"{where}, line {k}: {count} fields, the header has {len(names)}; {remedy}")
    values = _numbers(lines, len(names), dialect, holes)
    if len(values) == len(lines) and (holes or np.isfinite(values).all()):
        return values

    def value(field: str, place: str) -> float:
        if holes and field.lower() in HOLES:
            return float("nan")
        if not is_number(field, dialect):
            remedy = commas if has_decimal_comma(field) else correct
            raise error(f"{place}: {field[:40]!r} is not a number; {remedy}")
        if not (holes or np.isfinite(dialect.number(field))):
            raise error(f"{place}: value is {dialect.number(field)}; {correct}")
        return dialect.number(field)

    fields = ((k, zip(dialect.split(line), names, strict=True)) for k, line in lines)
    return np.array([[value(x, f"{where}, line {k}, column {name!r}") for x, name in row] for k, row in fields], float)


def _numbers(lines: Sequence[tuple[int, str]], columns: int, dialect: Dialect, holes: bool) -> Array:
    """Numbers (n, columns) of lines, with `holes` NaN for missing samples; (0, columns) if a field is no number."""
    bare = [line.strip(" \r\n") for _, line in lines]
    if dialect.decimal == ",":
        bare = [line.replace(",", ".") for line in bare]
    separator = None if dialect.separator == " " else dialect.separator
    for missing in (None, _missing(dialect)) if holes else (None,):
        rows = bare if missing is None else [missing.sub("nan", row) for row in bare]
        if not any(rows):  # loadtxt warns of nothing to read
            continue
        try:
            values = np.loadtxt(rows, delimiter=separator, comments=None, quotechar='"', ndmin=2)
        except ValueError:
            continue
        if values.shape == (len(lines), columns):  # empty lines are passed over
            return np.asarray(values)
    return np.empty((0, columns))


def _missing(dialect: Dialect) -> re.Pattern[str]:
    """Pattern of a field, with the quotes around it, that is a missing sample."""
    words = "|".join(sorted(map(re.escape, HOLES), key=len, reverse=True))  # the empty one last
    if dialect.separator == " ":
        return re.compile(rf"(?<!\S)(?:{words.removesuffix('|')})(?!\S)", re.IGNORECASE)
    mark = re.escape(dialect.separator)
    return re.compile(rf'(?:^|(?<={mark})) *"?(?:{words})"? *(?={mark}|$)', re.IGNORECASE)
