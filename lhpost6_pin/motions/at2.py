"""PEER strong-motion files `.AT2`: one acceleration component a file, four header lines, values in g."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..core.errors import MotionError
from .motion import GroundMotion, make_motion
from .motion_units import acceleration_in_si
from .text import parse_numbers, read_text

__all__ = ["is_at2", "load_at2"]

_NUMBER = r"(\d*\.?\d+(?:[eE][-+]?\d+)?)"
_COUNT_AND_STEP = (
    re.compile(rf"NPTS\s*=\s*(\d{{1,9}})\D*?DT\s*=\s*{_NUMBER}", re.IGNORECASE),
    re.compile(rf"^\s*(\d{{1,9}})\s+{_NUMBER}\s+NPTS\s*,\s*DT", re.IGNORECASE),
)
_WIDEST = 200  # characters of a header line that are looked at
_UNITS = re.compile(r"ACCELERATION\b.*\bUNITS\s+OF\s+(\S+)", re.IGNORECASE)


def is_at2(text: str) -> bool:
    """Whether the text has the point count and time step of a PEER file in its first lines."""
    return any(pattern.search(line[:_WIDEST]) for line in text.splitlines()[:6] for pattern in _COUNT_AND_STEP)


def load_at2(
    paths: "Path | str | Sequence[Path | str] | Mapping[str, Path | str]", *, name: str | None = None
) -> GroundMotion:
    """Read one to three PEER files into one motion.

    A sequence of paths goes to x, y, z in that order; a mapping is by axis, as in ``{"y": "NIS090.AT2"}``. Components
    that differ by a few samples are cut to the shortest, with a warning.

    Raises MotionError naming the file and line when a file cannot be understood, or when the time steps of
    the files differ.
    """
    if isinstance(paths, str | Path):
        paths = [paths]
    if not isinstance(paths, Mapping):
        if not 1 <= len(paths) <= 3:
            raise MotionError(f"{len(paths)} PEER files given; give one, two or three, for x, y, z")
        paths = dict(zip("xyz", paths, strict=False))
    if not paths:
        raise MotionError("no PEER file given; give one to three, for x, y, z")
    parsed = {axis: _parse_at2(read_text(path), str(path)) for axis, path in paths.items()}
    steps = {axis: step for axis, (step, _) in parsed.items()}
    if len(set(steps.values())) > 1:
        listed = ", ".join(f"{paths[axis]} {step:g} s" for axis, step in steps.items())
        raise MotionError(f"time steps differ: {listed}; give components of one record")
    files = [Path(path) for path in paths.values()]
    return make_motion(
        name or files[0].stem,
        next(iter(steps.values())),
        {axis: channel for axis, (_, channel) in parsed.items()},
        "acceleration",
        f"PEER files {', '.join(file.name for file in files)}",
    )


def _parse_at2(text: str, where: str) -> tuple[float, np.ndarray]:
    """Time step [s] and accelerations (n,) [m/s^2] of one component."""
    lines = text.splitlines()
    head = [line[:_WIDEST] for line in lines[:6]]
    matches = ((i, pattern.search(line)) for i, line in enumerate(head) for pattern in _COUNT_AND_STEP)
    number, match = next(((i, match) for i, match in matches if match), (0, None))
    if match is None:
        raise MotionError(f"{where}: no 'NPTS= .., DT= .. SEC' in the first lines; is this a PEER .AT2 file?")
    unit = _UNITS.search(" ".join(head[: number + 1]))
    if unit is None:
        raise MotionError(
            f"{where}: header lacks 'ACCELERATION TIME SERIES IN UNITS OF G'; velocity (.VT2) and displacement (.DT2) "
            "files are not read: use the .AT2 file"
        )
    count, step = int(match[1]), float(match[2])
    values = parse_numbers(lines[number + 1 :], where, number + 2)
    if len(values) != count:
        raise MotionError(
            f"{where}: header announces {count} points, the file has {len(values)}; it is truncated or damaged: "
            "download it again"
        )
    return step, acceleration_in_si(values, unit[1], f"{where}, line {number}", "use the .AT2 file in g")
