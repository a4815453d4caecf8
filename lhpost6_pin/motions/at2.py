"""PEER strong-motion files `.AT2`, old and new: one acceleration component a file below a few header lines."""

import re
from pathlib import Path

from ..core.errors import MotionError
from .components import Component, Direction, direction_of, direction_of_file
from .motion_units import acceleration_in_si
from .text import Rows, number_rows, parse_numbers

__all__ = ["is_at2", "read_at2"]

_NUMBER = r"(\d*\.?\d+(?:[eE][-+]?\d+)?)"
_COUNT_AND_STEP = (
    re.compile(rf"NPTS\s*=\s*(\d{{1,9}})\D*?DT\s*=\s*{_NUMBER}", re.IGNORECASE),
    re.compile(rf"^\s*(\d{{1,9}})\s+{_NUMBER}\s+NPTS\s*,\s*DT", re.IGNORECASE),
)
_WIDEST = 200  # characters of a header line that are looked at
_HEAD = 8  # lines that the header may have
_UNITS = re.compile(r"ACCELERATION\b.*\bUNITS\s+OF\s+(\S+)", re.IGNORECASE)


def is_at2(text: str) -> bool:
    """Whether the text has the point count and time step of a PEER file in its first lines."""
    return any(p.search(line[:_WIDEST]) for _, line in number_rows(text[:4000])[:_HEAD] for p in _COUNT_AND_STEP)


def read_at2(text: str, where: str) -> Component:
    """The component of a PEER file; blank lines, as doubled line ends leave them, are passed over.

    Raises MotionError naming the file and line when it cannot be understood.
    """
    rows = number_rows(text)
    head = [(number, line[:_WIDEST]) for number, line in rows[:_HEAD]]
    matches = ((i, pattern.search(line)) for i, (_, line) in enumerate(head) for pattern in _COUNT_AND_STEP)
    last, match = next(((i, match) for i, match in matches if match), (0, None))
    if match is None:
        raise MotionError(f"{where}: no 'NPTS= .., DT= .. SEC' in the first lines; is this a PEER .AT2 file?")
    unit = _UNITS.search(" ".join(line for _, line in head[: last + 1]))
    if unit is None:
        raise MotionError(
            f"{where}: header lacks 'ACCELERATION TIME SERIES IN UNITS OF G'; velocity (.VT2) and displacement (.DT2) "
            "files are not read: use the .AT2 file"
        )
    count, step = int(match[1]), float(match[2])
    values = parse_numbers(rows[last + 1 :], where)
    if len(values) != count:
        raise MotionError(
            f"{where}: header announces {count} points, the file has {len(values)}; it is truncated or damaged: "
            "download it again"
        )
    si = acceleration_in_si(values, unit[1], f"{where}, line {head[last][0] - 1}", "use the .AT2 file in g")
    return Component(where, ("1",), _direction(head[:last], Path(where).stem), step, si, in_order=True)


def _direction(head: Rows, stem: str) -> Direction:
    """Direction after the last comma of the line of earthquake and station, else by the file's name."""
    for _, line in head:
        _, comma, field = re.sub(r"\([^()]*\)", "", line).rpartition(",")
        if comma and (found := direction_of(field)) is not None:
            return found
    return direction_of_file(stem)
