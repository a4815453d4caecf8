"""Ground motions in CSV files: comment lines (#), a header row, a time column, a column for each axis."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..core.errors import MotionError, meant
from ..core.number_table import Dialect, has_decimal_comma, is_number, read_rows
from .motion import AXES, GroundMotion, make_motion
from .motion_units import to_si
from .text import read_text

__all__ = ["load_csv"]

_TIME = re.compile(r"(time|t)([\s_]*[\[(]?(?P<unit>s|sec|ms)[\])]?)?", re.I)
_AXIS_NAMES = {"rx": "roll", "ry": "pitch", "rz": "yaw", **{axis: axis for axis in AXES}}
_COLUMN = re.compile(
    rf"[ad]?_?(?P<axis>{'|'.join(sorted(_AXIS_NAMES, key=len, reverse=True))})"
    r"(?:[\s_]*[\[(](?P<bracketed>[^\])]*)[\])]|[_ ](?P<suffix>.+))?",
    re.I,
)
_COMMAS = "decimal commas are not read: write points, as 0.01"
_UNIFORM = 0.01  # a step may differ from the mean by this part of it: room for times printed with few digits


class _Channel(NamedTuple):
    axis: str
    column: int
    unit: str


def load_csv(
    path: "Path | str",
    *,
    columns: "Mapping[str, str] | None" = None,
    units: "str | Mapping[str, str] | None" = None,
    time_step: float | None = None,
    name: str | None = None,
) -> GroundMotion:
    """Read a CSV file into one motion.

    The header row names the columns: a time column (`time`, `t`, `time_s`, `time [ms]`) and one for each axis
    with its unit, such as `x_m_s2`, `ax_g`, `roll_rad` or `z [mm]`; all must be accelerations or all
    displacements. `columns` maps axis to column name where the names differ, `units` gives one unit for all
    or one for each axis, `time_step` [s] stands in for a missing time column. Columns are separated by
    commas, semicolons or tabs.

    Raises MotionError naming the file and the line, column or sample: not a number, not finite, uneven time,
    missing or unknown column, unknown unit, wrong number of fields.
    """
    where = str(path)
    lines = read_text(path).splitlines()
    start = next((i for i, line in enumerate(lines) if line.strip() and not _is_comment(line)), None)
    if start is None:
        raise MotionError(f"{where}: no header row; the first line that is no comment must name the columns")
    dialect = Dialect(next((mark for mark in ";\t" if mark in lines[start]), ","))
    names = [field.strip().strip('"') for field in lines[start].split(dialect.separator)]
    if all(is_number(name, dialect) or has_decimal_comma(name) for name in names):
        raise MotionError(f"{where}, line {start + 1}: no header row; the first must name the columns, as time_s,x_g")
    if len(set(names)) != len(names):
        twice = next(column for column in names if names.count(column) > 1)
        raise MotionError(f"{where}, line {start + 1}: two columns named {twice!r}; rename one")
    rows = [(k, line) for k, line in enumerate(lines[start + 1 :], start + 2) if line.strip() and not _is_comment(line)]
    if len(rows) < 2:
        raise MotionError(f"{where}: {len(rows)} row(s) of numbers; a motion needs at least 2")
    remedy = "fill the gap or cut the record there"
    table = read_rows(rows, names, dialect, where, error=MotionError, commas=_COMMAS, correct=remedy)
    time_column = next((i for i, column in enumerate(names) if _TIME.fullmatch(column)), None)
    chosen = _channels(names, time_column, columns, units, f"{where}, line {start + 1}")
    step = _time_step(table, time_column, names, time_step, where)
    data: dict[str, np.ndarray] = {}
    quantities: dict[str, str] = {}
    for channel in chosen:
        try:
            data[channel.axis], quantities[channel.axis] = to_si(table[:, channel.column], channel.unit, channel.axis)
        except MotionError as error:
            raise MotionError(f"{where}, column {names[channel.column]!r}: {error}") from None
    if len(set(quantities.values())) > 1:
        raise MotionError(f"{where}: accelerations and displacements are mixed: {quantities}; give one kind")
    kind = next(iter(quantities.values()))
    return make_motion(name or Path(path).stem, step, data, kind, f"CSV file {Path(path).name}")


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith("#")


def _channels(
    names: list[str],
    time_column: int | None,
    columns: "Mapping[str, str] | None",
    units: "str | Mapping[str, str] | None",
    where: str,
) -> list[_Channel]:
    """Column and unit of each axis."""
    if columns is None:
        pairs = [(_axis_of(name, where), name) for k, name in enumerate(names) if k != time_column]
    else:
        pairs = list(columns.items())
    chosen: list[_Channel] = []
    for axis, column in pairs:
        if axis not in AXES:
            raise MotionError(f"{where}: option columns names axis {axis!r}; axes are {', '.join(AXES)}")
        if column not in names:
            near = meant(column, names)
            raise MotionError(f"{where}: no column {column!r} for axis {axis}; {near}columns are {', '.join(names)}")
        if axis in (channel.axis for channel in chosen):
            raise MotionError(f"{where}: two columns for axis {axis}; leave one out")
        unit = _unit(_COLUMN.fullmatch(column), axis, units)
        if not unit:
            raise MotionError(f"{where}: column {column!r} has no unit; write it in the name ({column}_m_s2)")
        chosen.append(_Channel(axis, names.index(column), unit))
    if not chosen:
        raise MotionError(f"{where}: no column for any axis; call them such as x_m_s2, ay_g, z_m, roll_rad")
    return chosen


def _axis_of(column: str, where: str) -> str:
    match = _COLUMN.fullmatch(column)
    if match is None:
        raise MotionError(
            f"{where}: column {column[:60]!r} names no axis; call it such as x_m_s2, ay_g, z_m, roll_rad (from Python, "
            "columns={axis: column} selects them)"
        )
    return _AXIS_NAMES[match["axis"].lower()]


def _unit(match: "re.Match[str] | None", axis: str, units: "str | Mapping[str, str] | None") -> str:
    if isinstance(units, str):
        return units
    if units is not None and axis in units:
        return units[axis]
    return (match["bracketed"] or match["suffix"] or "") if match else ""


def _time_step(
    table: np.ndarray, time_column: int | None, names: list[str], time_step: float | None, where: str
) -> float:
    """Uniform time step [s], from the argument or the time column."""
    if time_step is not None:
        return time_step
    if time_column is None:
        raise MotionError(
            f"{where}: no time column (time_s, t) among {', '.join(names)[:200]}; add it, or give the option time_step "
            "in seconds (--set time_step=0.01)"
        )
    match = _TIME.fullmatch(names[time_column])
    time = table[:, time_column] * (1e-3 if match and (match["unit"] or "").lower() == "ms" else 1.0)
    with np.errstate(over="ignore", invalid="ignore"):  # absurd times are caught below
        mean = (time[-1] - time[0]) / (len(time) - 1)
        uneven = ~(np.abs(np.diff(time) - mean) <= _UNIFORM * mean)
    if not (np.isfinite(mean) and mean > 0):
        raise MotionError(f"{where}: time runs from {time[0]:g} s to {time[-1]:g} s; it must increase")
    if uneven.any():
        sample = int(np.argmax(uneven)) + 1
        here, before = float(time[sample]), float(time[sample - 1])
        raise MotionError(
            f"{where}: time step before sample {sample} (t = {here:g} s) is {here - before:g} s, "
            f"the mean is {mean:g} s; resample the record to a uniform step"
        )
    return float(mean)
