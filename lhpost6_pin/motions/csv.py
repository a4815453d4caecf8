"""Ground motions in CSV files: comment lines (#), a header row, a time column, a column for each axis."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Unpack

import numpy as np

from ..core.errors import MotionError, meant
from ..core.number_table import Dialect, read_rows
from .columns import COMMAS, without_comments
from .components import Channels, Component, Stated, assemble
from .motion import AXES, GroundMotion
from .motion_units import is_motion_unit, to_si, unit_of_column
from .text import read_text
from .time_steps import uniform_step

__all__ = ["axis_in_name", "header_names", "is_csv", "load_csv", "read_csv"]

_TIME = re.compile(r"(time|t)([\s_]*[\[(]?(?P<unit>s|sec|ms)[\])]?)?", re.I)
_AXIS_NAMES = {"rx": "roll", "ry": "pitch", "rz": "yaw", **{axis: axis for axis in AXES}}
_AXIS_NAMES |= dict.fromkeys(("ew", "e-w", "east"), "x") | dict.fromkeys(("ns", "n-s", "north"), "y")
_AXIS_NAMES |= dict.fromkeys(("ud", "u-d", "up"), "z")
_QUANTITY = r"acc(?:el(?:eration)?)?|disp(?:l(?:acement)?)?"  # of no account: the unit gives it
_COLUMN = re.compile(
    rf"(?:(?:{_QUANTITY})[\s_]*|[ad]_?|_)?(?P<axis>{'|'.join(sorted(_AXIS_NAMES, key=len, reverse=True))})"
    rf"(?:[\s_]+(?:{_QUANTITY}))?"
    r"(?:[\s_]*[\[(](?P<bracketed>[^\])]*)[\])]|[_ ](?P<suffix>.+))?",
    re.I,
)
_IN_BRACKETS = re.compile(r"[\[(](?P<unit>[^\])]+)[\])]\s*$")


def is_csv(text: str) -> bool:
    """Whether the header row names time or an axis, above a row of as many fields."""
    rows = [line for _, line in without_comments(text[:20000])[:2]]
    if len(rows) < 2:
        return False
    names, dialect = header_names(rows[0])
    known = any(_TIME.fullmatch(name) or _COLUMN.fullmatch(name) for name in names)
    return known and dialect.count(rows[1]) == len(names)


def load_csv(path: "Path | str", *, name: str | None = None, **stated: Unpack[Stated]) -> GroundMotion:
    """Read a CSV file into one motion, as `read_csv` says."""
    found = read_csv(read_text(path), str(path), **stated)
    return assemble(found, name or Path(path).stem, f"CSV file {Path(path).name}")


def read_csv(text: str, where: str, **stated: Unpack[Stated]) -> list[Component]:
    """Components of a CSV file.

    The header row names the columns: a time column (`time`, `t`, `time_s`, `time [ms]`) and one for each axis
    with its unit, such as `x_m_s2`, `ax_g`, `roll_rad`, `z [mm]` or `X Accel [g]`; all must be accelerations or all
    displacements. `channels` maps axis to column name (or number) where the names differ, `units` gives one unit for
    all or one for each axis, `time_step` [s] stands in for a missing time column. Columns are separated by
    commas, semicolons, tabs or blanks.

    Raises MotionError naming the file and the line, column or sample: not a number, not finite, uneven time,
    missing or unknown column, unknown unit, wrong number of fields.
    """
    rows = without_comments(text)
    if not rows:
        raise MotionError(f"{where}: no header row; the first line that is no comment must name the columns")
    (start, header), rows = rows[0], rows[1:]
    names, dialect = header_names(header)
    if len(set(names)) != len(names):
        twice = next(column for column in names if names.count(column) > 1)
        raise MotionError(f"{where}, line {start}: two columns named {twice!r}; rename one")
    if len(rows) < 2:
        raise MotionError(f"{where}: {len(rows)} row(s) of numbers; a motion needs at least 2")
    remedy = "fill the gap or cut the record there"
    table = read_rows(rows, names, dialect, where, error=MotionError, commas=COMMAS, correct=remedy)
    clock = next((i for i, column in enumerate(names) if _TIME.fullmatch(column)), None)
    found = []
    step = _time_step(table, clock, names, stated.get("time_step"), where)
    for axis, column in _columns(names, clock, stated.get("channels"), f"{where}, line {start}").items():
        here = f"{where}, column {names[column]!r}"
        unit = unit_of_column(_unit_in_name(names[column]), _stated_unit(stated.get("units"), axis), here)
        if not unit:
            raise MotionError(
                f"{where}, line {start}: column {names[column]!r} has no unit; write it in the name "
                f"({names[column]}_m_s2), or give --unit"
            )
        try:
            values, quantity = to_si(table[:, column], unit, axis)
        except MotionError as error:
            raise MotionError(f"{here}: {error}") from None
        found.append(Component(here, (names[column], str(column + 1)), None, step, values, quantity, axis))
    return found


def header_names(header: str) -> tuple[list[str], Dialect]:
    """Names in a header row, and how its fields are separated."""
    dialect = Dialect(next((mark for mark in ";\t," if mark in header), " "))
    if dialect.separator == " " and _COLUMN.fullmatch(header.strip()):  # one column, a blank before its unit
        dialect = Dialect(",")
    fields = header.strip().split(None if dialect.separator == " " else dialect.separator)
    return [field.strip().strip('"') for field in fields], dialect


def _columns(names: list[str], clock: int | None, channels: Channels | None, where: str) -> dict[str, int]:
    """Column of each axis."""
    if channels is None:
        pairs = [(_axis_of(name, where), name) for k, name in enumerate(names) if k != clock]
    else:
        numbers = {str(k): name for k, name in enumerate(names, 1)}
        pairs = [(axis, numbers.get(str(c), str(c)) if str(c) not in names else str(c)) for axis, c in channels.items()]
    chosen: dict[str, int] = {}
    for axis, column in pairs:
        if column not in names:
            near = meant(column, names)
            raise MotionError(f"{where}: no column {column!r} for axis {axis}; {near}columns are {', '.join(names)}")
        if axis in chosen:
            raise MotionError(f"{where}: two columns for axis {axis}; leave one out")
        chosen[axis] = names.index(column)
    if not chosen:
        raise MotionError(f"{where}: no column for any axis; call them such as x_m_s2, ay_g, z_m, roll_rad")
    return chosen


def axis_in_name(column: str) -> str | None:
    """Axis that a column's name gives, as `x`, `ay_g`, `acc_z [g]` or `roll` do; None if it gives none."""
    match = _COLUMN.fullmatch(column)
    return _AXIS_NAMES[match["axis"].lower()] if match else None


def _axis_of(column: str, where: str) -> str:
    axis = axis_in_name(column)
    if axis is None:
        raise MotionError(
            f"{where}: column {column[:60]!r} names no axis; call it such as x_m_s2, ay_g, z_m, roll_rad, or choose "
            "columns, as in --channels x=2,y=3 (by number or name)"
        )
    return axis


def _unit_in_name(column: str) -> str:
    """Unit in the name of a column; of one that names no axis, in brackets or, if it is one, behind a `_`; or ""."""
    if match := _COLUMN.fullmatch(column):
        return match["bracketed"] or match["suffix"] or ""
    bracketed = _IN_BRACKETS.search(column)
    ends = [bracketed["unit"]] if bracketed else [column[mark.end() :] for mark in re.finditer("_", column)]
    return next((end for end in ends if is_motion_unit(end)), "")


def _stated_unit(units: "str | Mapping[str, str] | None", axis: str) -> str | None:
    return units.get(axis) if isinstance(units, Mapping) else units


def _time_step(table: np.ndarray, clock: int | None, names: list[str], stated: float | None, where: str) -> float:
    """Uniform time step [s], from the time column or as stated."""
    if clock is not None:
        match = _TIME.fullmatch(names[clock])
        return uniform_step(
            table[:, clock] * (1e-3 if match and (match["unit"] or "").lower() == "ms" else 1.0), where, stated
        )
    if stated is None:
        raise MotionError(
            f"{where}: no time column (time_s, t) among {', '.join(names)[:200]}; add it, or give the step in "
            "seconds, as --dt 0.01"
        )
    return stated
