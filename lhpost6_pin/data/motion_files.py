"""Motions by name or from files of any readable format: those of `motions`, data files, and records of one's own.

A record, or an export of one, moves the table as its test was commanded (`reference_displacement`); one without target
as the platen moved (`platen_acceleration`, else `platen_displacement`). Of any other file with arrays (.mat, HDF5,
netCDF, TDMS, Parquet, 469D) the columns are those named after axes, or the only one.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..core.arrays import Array
from ..core.errors import MotionError, instead_of
from ..core.files import reason_of
from ..core.names import AXES
from ..motions import GroundMotion, find_motion, load_motion
from ..motions.components import Channels, Component, direction_of_file
from ..motions.csv import axis_in_name
from ..motions.motion_units import to_si, unit_of_column
from ..motions.readers import MotionFiles, read_components, refuse_stated
from ..motions.time_steps import uniform_step
from .importing import RawTest, is_export, load_raw
from .importing.channel_units import without_unit
from .importing.raw import shown

__all__ = ["MOVED_BY", "load_any_motion", "motion_of", "read_any_components"]

MOVED_BY = ("reference_displacement", "platen_acceleration", "platen_displacement")
"""Channels of a record by which the table is moved: the first that it has."""

_EXPORT = re.compile(rb"\A(?:\xef\xbb\xbf)?#\s*layout_version:")


class _Column(NamedTuple):
    """A column of a data file: its names, and what is known of it."""

    labels: tuple[str, ...]  # number in the file, name as written, name without unit, channel such as variable[x]
    variable: str  # channel without its label
    axis: str | None
    unit: str | None
    values: Array
    time: Array | None


def motion_of(name: str | None, files: Sequence[str | Path] = (), /, **options: Any) -> GroundMotion:
    """Motion by name, from files (without a name), or by name from files; options as of `find_motion`, `load_motion`.

    Raises MotionError or UnknownNameError as these do, RecordError for a data file that cannot be read.
    """
    if name is None:
        return load_any_motion(files, **options)
    return find_motion(name, files, **options, **({"read": read_any_components} if files else {}))


def load_any_motion(paths: MotionFiles, **options: Any) -> GroundMotion:
    """Read a motion as `load_motion` does, from data files and records, too."""
    return load_motion(paths, read=read_any_components, **options)


def read_any_components(
    path: Path, stated: Mapping[str, Any], channels: Channels | None
) -> tuple[str, list[Component]]:
    """Format and components of a text, a data file or a record.

    `channels` of a data file are, by axis, number, name or channel of a column, or a channel that the axes share, as in
    x=platen_acceleration. Raises MotionError or RecordError naming the file and what is missing.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(4096)
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        raise MotionError(f"cannot read ground motion {path}: {reason_of(error)}") from error
    if not (b"\0" in begin or path.suffix.lower() == ".mat" or _EXPORT.match(begin)):
        return read_components(path, stated, channels)
    raws, where = load_raw(path), str(path)
    if any(raw.facts.get("kind") == "drive" for raw in raws):
        raise MotionError(f"{path}: this is a drive, which `lhpost6 replay {path}` runs")
    own = is_export(raws)
    columns = list(_columns(raws))
    if own:
        refuse_stated(where, stated)
    chosen = _recorded(columns, where) if own and channels is None else _chosen(columns, channels, where)
    alone = len(chosen) == 1
    found = [_component(axis, column, stated, where, alone) for axis, column in chosen]
    return ("record" if own else raws[0].form.removesuffix(" file")), found


def _columns(raws: Sequence[RawTest]) -> Iterator[_Column]:
    count = 0
    for raw in raws:
        for k, (name, unit) in enumerate(zip(raw.names, raw.units, strict=True)):
            count += 1
            plain = without_unit(name)
            variable, _, label = plain.rpartition("_")
            axis = label if variable and label in AXES else axis_in_name(plain.rpartition(".")[2])
            labels = (str(count), name, plain, f"{variable}[{label}]")
            yield _Column(labels, variable, axis, unit, raw.values[:, k], raw.time)


def _recorded(columns: Sequence[_Column], where: str) -> list[tuple[str | None, _Column]]:
    """Columns of a record by which the table is moved."""
    for variable in MOVED_BY:
        if chosen := [column for column in columns if column.axis and column.variable == variable]:
            return [(column.axis, column) for column in chosen]
    raise MotionError(
        f"{where}: a record with none of {', '.join(MOVED_BY)}; choose channels, as in "
        "--channels x=actuator_displacement[H1]"
    )


def _chosen(columns: Sequence[_Column], channels: Channels | None, where: str) -> list[tuple[str | None, _Column]]:
    """Columns of a data file by axis: those named after axes or the only one, or those stated."""
    if channels is not None:
        return [(axis, _find(columns, str(channel), axis, where)) for axis, channel in channels.items()]
    named = [(c.axis, c) for c in columns if c.axis]
    if len({axis for axis, _ in named}) == len(named) == len(columns):
        return [*named]
    if len(columns) == 1:
        return [(None, columns[0])]
    raise MotionError(
        f"{where}: {len(columns)} columns of which not each names an axis of its own; choose them by number or name, "
        f"as in --channels x=1,y=2, from {shown([column.labels[1] for column in columns])}"
    )


def _find(columns: Sequence[_Column], wanted: str, axis: str, where: str) -> _Column:
    for column in columns:
        if wanted in column.labels or (wanted == column.variable and column.axis == axis):
            return column
    names = [column.labels[2] for column in columns]
    listed = instead_of(wanted, names, f"columns are {shown(names)}")
    raise MotionError(f"{where}: no column {wanted!r} for axis {axis}; {listed}")


def _component(axis: str | None, column: _Column, stated: Mapping[str, Any], where: str, alone: bool) -> Component:
    here = f"{where}, {column.labels[1]!r}"
    units, step = stated.get("units"), stated.get("time_step")
    given = units.get(axis or "x") if isinstance(units, Mapping) else units
    unit = unit_of_column(column.unit or "", given, here)
    if not unit:
        raise MotionError(f"{here}: no unit in the file; give it, as --unit g")
    if column.time is None and step is None:
        raise MotionError(f"{here}: no time in the file; give the step in seconds, as --dt 0.01")
    try:
        values, quantity = to_si(column.values, unit, axis or "x")
    except MotionError as error:
        raise MotionError(f"{here}: {error}") from None
    step = uniform_step(column.time, where, step) if column.time is not None else float(step or 0.0)
    direction = direction_of_file(Path(where).stem) if alone and axis is None else None
    return Component(here, column.labels[:2], direction, step, values, quantity, axis, in_order=True)
