"""Ground motions in CSV files: comment lines (#), a header row, a time column, a column for each axis."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..core.decimals import cut_at_decimal_commas, has_decimal_comma
from ..core.errors import MotionError, meant
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
    start = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None)
    if start is None:
        raise MotionError(f"{where}: no header row; the first line that is no comment must name the columns")
    separator = next((mark for mark in ";\t" if mark in lines[start]), ",")
    names = [field.strip().strip('"') for field in lines[start].split(separator)]
    if all(_is_number(name) or has_decimal_comma(name) for name in names):
        raise MotionError(f"{where}, line {start + 1}: no header row; the first must name the columns, as time_s,x_g")
    if len(set(names)) != len(names):
        twice = next(column for column in names if names.count(column) > 1)
        raise MotionError(f"{where}, line {start + 1}: two columns named {twice!r}; rename one")
    table = _table(lines, start + 1, separator, names, where)
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


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _channels(
    names: list[str],
    time_column: int | None,
    columns: "Mapping[str, str] | None",
    units: "str | Mapping[str, str] | None",
    where: str,
) -> list[_Channel]:
    """Which column moves which axis, in which unit."""
    chosen = []
    if columns is not None:
        for axis, column in columns.items():
            if axis not in AXES:
                raise MotionError(f"{where}: option columns names axis {axis!r}; axes are {', '.join(AXES)}")
            if column not in names:
                asked = meant(column, names)
                raise MotionError(
                    f"{where}: no column {column!r} for axis {axis}; {asked}columns are {', '.join(names)}"
                )
            match = _COLUMN.fullmatch(column)
            chosen.append(_Channel(axis, names.index(column), _unit(match, axis, units)))
    else:
        for index, column in enumerate(names):
            if index == time_column:
                continue
            match = _COLUMN.fullmatch(column)
            if match is None:
                raise MotionError(
                    f"{where}: column {column[:60]!r} names no axis; call it such as x_m_s2, ay_g, z_m, "
                    "roll_rad (from Python, columns={axis: column} says which to use)"
                )
            axis = _AXIS_NAMES[match["axis"].lower()]
            if axis in (channel.axis for channel in chosen):
                raise MotionError(f"{where}: two columns for axis {axis}; leave one out")
            chosen.append(_Channel(axis, index, _unit(match, axis, units)))
    if not chosen:
        raise MotionError(f"{where}: no column for any axis; call them such as x_m_s2, ay_g, z_m, roll_rad")
    for channel in chosen:
        if not channel.unit:
            raise MotionError(
                f"{where}: column {names[channel.column]!r} has no unit; write it in the name "
                f"({names[channel.column]}_m_s2)"
            )
    return chosen


def _unit(match: "re.Match[str] | None", axis: str, units: "str | Mapping[str, str] | None") -> str:
    if isinstance(units, str):
        return units
    if units is not None and axis in units:
        return units[axis]
    return (match["bracketed"] or match["suffix"] or "") if match else ""


def _table(lines: list[str], start: int, separator: str, names: list[str], where: str) -> np.ndarray:
    """All rows (n, columns); the slow reading of a faulty file only serves to name the place."""
    numbered = [
        (i + 1, line) for i, line in enumerate(lines[start:], start) if line.strip() and line.lstrip()[0] != "#"
    ]
    if len(numbered) < 2:
        raise MotionError(f"{where}: {len(numbered)} row(s) of numbers; a motion needs at least 2")
    try:
        table = np.array([line.split(separator) for _, line in numbered], dtype=float)
    except ValueError:
        table = np.empty((0, 0))
    if table.ndim == 2 and table.shape[1] == len(names) and np.isfinite(table).all():
        return table
    for number, line in numbered:
        fields = line.split(separator)
        if len(fields) != len(names):
            commas = separator == "," and cut_at_decimal_commas(fields, len(names))
            remedy = _COMMAS if commas else "correct it"
            raise MotionError(f"{where}, line {number}: {len(fields)} fields, the header has {len(names)}; {remedy}")
        for column, field in zip(names, fields, strict=True):
            try:
                value = float(field)
            except ValueError:
                remedy = _COMMAS if has_decimal_comma(field) else "fill the gap or cut the record there"
                raise MotionError(
                    f"{where}, line {number}, column {column!r}: {field.strip()[:40]!r} is not a number; {remedy}"
                ) from None
            if not np.isfinite(value):
                raise MotionError(
                    f"{where}, line {number}, column {column!r}: value is {value}; fill the gap or cut the record there"
                )
    raise MotionError(f"{where}: cannot be read as a table of numbers; check the separator")


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
