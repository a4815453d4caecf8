"""Columns of numbers in text without names: one series, written down or along the rows, or several side by side."""

from pathlib import Path
from typing import Unpack

import numpy as np

from ..core.errors import MotionError
from ..core.number_table import Dialect, has_decimal_comma, is_number, read_rows
from .components import Component, Stated, direction_of_file
from .motion_units import to_si
from .text import READABLE, Rows, number_rows
from .time_steps import uniform_step

__all__ = ["COMMAS", "begins_with_numbers", "read_columns", "without_comments"]

COMMAS = "decimal commas are not read: write points, as 0.01"
_ALONG_ROWS = "all"  # as a channel: the series that is written along the rows
_BOTH = f"choose columns, as in --channels x=1,y=2, or --channels x={_ALONG_ROWS} for one series along the rows"


def without_comments(text: str) -> Rows:
    """Lines that are neither blank nor comments (#, %), with their numbers."""
    return [(number, line) for number, line in number_rows(text) if line.lstrip()[0] not in "#%"]


def begins_with_numbers(text: str) -> bool:
    """Whether the first line that is no comment holds numbers alone."""
    return any(_is_numeric(line) for _, line in without_comments(text[:4000])[:1])


def read_columns(text: str, where: str, **stated: Unpack[Stated]) -> list[Component]:
    """Components of a file of numbers, below any lines of text.

    A first column that increases throughout is time [s]; without one, `time_step` [s] is needed. `units` is one for all
    values, or one for each axis. `channels` gives the column (from 1, time included) of each axis, or `all` for one
    series written along the rows; a single column needs none. Raises MotionError naming the file, line or what is
    missing.
    """
    time_step, units = stated.get("time_step"), stated.get("units")
    rows = without_comments(text)
    rows = rows[next((k for k, (_, line) in enumerate(rows) if _is_numeric(line)), len(rows)) :]
    if len(rows) < 2 and not (rows and len(_fields(rows[0][1])) > 1):
        raise MotionError(
            f"{where}: no rows of numbers; a motion needs at least 2 values. Known formats are {READABLE}"
        )
    if units is None:
        raise MotionError(
            f"{where}, line {rows[0][0]}: no header row names axes and units (as time_s,x_g); add one, or give the "
            "unit, as --unit g, and unless the first column is time the step, as --dt 0.01"
        )
    counts = [len(_fields(line)) for _, line in rows]
    wanted = {axis: str(column) for axis, column in (stated.get("channels") or {}).items()}
    ragged = counts[0] > 1 and counts[-1] < counts[0] and len(set(counts[:-1])) == 1
    if _ALONG_ROWS in wanted.values() or (ragged and not wanted):
        if len(wanted) > 1:
            raise MotionError(f"{where}: one series along the rows goes to one axis, as in --channels x={_ALONG_ROWS}")
        axes, table, clock = [next(iter(wanted), None)], _series(rows, where)[:, None], None
        places = [0]
    else:
        table = _table(rows, counts[0], where)
        clock = table[:, 0] if counts[0] > 1 and (np.diff(table[:, 0]) > 0).all() else None
        axes, places = _selected(wanted, counts[0], clock is not None, where)
    if clock is None and time_step is None:
        raise MotionError(f"{where}: no time among the columns; give the step in seconds, as --dt 0.01")
    step = uniform_step(clock, where, time_step) if clock is not None else float(time_step or 0)
    direction = direction_of_file(Path(where).stem) if len(places) == 1 and axes[0] is None else None
    found = []
    for axis, place in zip(axes, places, strict=True):
        here = where if len(places) == 1 else f"{where}, column {place + 1}"
        try:
            unit = units if isinstance(units, str) else units.get(axis or "x", "")
            values, quantity = to_si(table[:, place], unit, axis or "x")
        except MotionError as error:
            raise MotionError(f"{here}: {error}") from None
        found.append(Component(here, (str(place + 1),), direction, step, values, quantity, axis, in_order=True))
    return found


def _fields(line: str) -> list[str]:
    return Dialect(_separator(line)).split(line)


def _separator(line: str) -> str:
    return next((mark for mark in ";\t," if mark in line.strip(" \r\n")), " ")


def _is_numeric(line: str) -> bool:
    """Whether all fields of a line are numbers, be it with decimal commas; one at the end may be empty."""
    dialect, fields = Dialect(_separator(line)), _fields(line.rstrip(" ,;\t"))
    return bool(fields) and all(is_number(field, dialect) or has_decimal_comma(field) for field in fields)


def _table(rows: Rows, width: int, where: str) -> np.ndarray:
    """Numbers (n, width) of rows of one width."""
    names = [f"{k}" for k in range(1, width + 1)]
    return read_rows(
        rows,
        names,
        Dialect(_separator(rows[0][1])),
        where,
        error=MotionError,
        commas=COMMAS,
        correct="correct it, or cut the file there",
    )


def _series(rows: Rows, where: str) -> np.ndarray:
    """Numbers (n,) along the rows."""
    cells = [(number, field) for number, line in rows for field in _fields(line.rstrip(" ,;\t"))]
    return _table([(number, field) for number, field in cells], 1, where)[:, 0]


def _selected(wanted: dict[str, str], width: int, timed: bool, where: str) -> tuple[list[str | None], list[int]]:
    """Axes, and their columns from 0."""
    first = 1 if timed else 0
    if not wanted:
        if width - first > 1:
            remedy = f"choose them, as in --channels x={first + 1},y={first + 2}" if timed else _BOTH
            raise MotionError(f"{where}: {width - first} columns without names; {remedy}")
        return [None], [first]
    for axis, column in wanted.items():
        if not column.isdecimal() or not first < int(column) <= width:
            raise MotionError(f"{where}: no column {column!r} of values for axis {axis}; {first + 1} to {width} are")
    return list(wanted), [int(column) - 1 for column in wanted.values()]
