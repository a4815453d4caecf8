"""Rows of numbers in text: their fields, and errors that name line and column."""

import csv
import re
from collections.abc import Sequence
from io import StringIO
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
    import pandas as pd

    for k, line in lines:
        if (count := dialect.count(line)) != len(names):
            remedy = commas if split_at_commas(line, dialect, len(names)) else "correct it, or cut the table there"
            raise error(f"{where}, line {k}: {count} fields, the header has {len(names)}; {remedy}")
    try:
        values = pd.read_csv(
            StringIO("\n".join(line.strip(" \r\n") for _, line in lines)),
            sep=r"\s+" if dialect.separator == " " else dialect.separator,
            decimal=dialect.decimal,
            header=None,
            names=range(len(names)),
            index_col=False,
            skipinitialspace=True,
            skip_blank_lines=False,
            float_precision="round_trip",
            na_values=[hole for hole in HOLES if hole] + ["NAN", "NaN", "NA"],
            dtype=float,
        ).to_numpy(float)
    except Exception:  # pandas raises its own, value and overflow errors for what is no number
        values = np.empty((0, 0))
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
