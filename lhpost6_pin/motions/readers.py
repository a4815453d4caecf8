"""Reading ground-motion files of any known kind, one for all axes or one for each component."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import MotionError, instead_of
from .at2 import is_at2, read_at2
from .columns import begins_with_numbers, read_columns
from .components import Channels, Component, Stated, assemble
from .cosmos import is_cosmos, read_cosmos
from .csv import is_csv, read_csv
from .knet import is_knet, read_knet
from .motion import AXES, GroundMotion
from .text import READABLE, read_text

__all__ = ["MotionFiles", "load_motion", "read_components", "refuse_stated"]

MotionFiles = Path | str | Sequence[Path | str] | Mapping[str, Path | str]
"""One file, or files of the components; a mapping gives the axis of each."""

_OPTIONS: dict[str, tuple[Any, str]] = {
    "name": (str, "a text"),
    "time_step": (Real, "a number of seconds"),
    "units": (str | Mapping, "a unit for all axes, such as g or mm, or from Python one by axis"),
    "channels": (str | Mapping, "a channel or column by axis, as in x=2,y=1"),
    "rotate": (Real, "the azimuth of the table's x in degrees"),
    "rotation_factor": (Real, "a factor of the rotations"),
}
"""Options of `load_motion`: types in Python, and in words."""


def read_components(path: Path, stated: Mapping[str, Any], channels: Channels | None) -> tuple[str, list[Component]]:
    """Format and components of a text file; an incomplete one is refused by the reader of its suffix.

    `stated` has its `time_step` [s] and `units` where given, `channels` those wanted of it.
    """
    text, suffix, where = read_text(path), path.suffix.lower(), str(path)
    columns = Stated(time_step=stated.get("time_step"), units=stated.get("units"), channels=channels)
    if not text.strip():
        raise MotionError(f"{where}: is empty")
    if is_at2(text) or suffix == ".at2":
        form, found = "PEER", [read_at2(_alone(text, where, stated), where)]
    elif is_knet(text):
        form, found = "K-NET", [read_knet(_alone(text, where, stated), where)]
    elif is_cosmos(text) or suffix in (".v1", ".v2", ".raw", ".v1c", ".v2c"):
        form, found = "V2" if "2" in suffix else "V1", read_cosmos(_alone(text, where, stated), where)
    elif begins_with_numbers(text):
        form, found = "text", read_columns(text, where, **columns)
    elif is_csv(text) or suffix == ".csv":
        form, found = "CSV", read_csv(text, where, **columns)
    elif "units" in stated:
        form, found = "text", read_columns(text, where, **columns)
    else:
        raise MotionError(f"{where}: unknown format; known are {READABLE}")
    return form, found


def load_motion(
    paths: MotionFiles,
    *,
    read: Callable[[Path, Mapping[str, Any], Channels | None], tuple[str, list[Component]]] = read_components,
    **options: Any,
) -> GroundMotion:
    """Read a motion from one file of any known format, or from one for each component; formats by their content.

    Formats are those in text; `read` may know others, as `data.motion_files` does.

    Components go where their files say they point: 90 degrees or east to +x, 0 or 360 or north to +y, up to +z; those
    of PEER files and plain columns, unless vertical, to x, then y, in the order given. Options:

    - `name`: of the motion; by default that of the first file.
    - `channels`: axis to channel, as ``{"x": 2, "y": 1}`` or ``"x=2,y=1"``: number of a channel or column, name of a
      column, or number of a file where there are several.
    - `rotate`: azimuth [deg] of the table's x, to which the two horizontal components are turned.
    - `rotation_factor`: multiplies roll, pitch and yaw; the report's test SFU has 1000.
    - `time_step` [s], `units`: for files that do not say.

    Raises MotionError naming the file, line or option and what to do; a format that is not known with those that are.
    """
    _check_options(paths, options)
    name, rotate = options.get("name"), options.get("rotate")
    channels = _channels(options.get("channels"))
    if isinstance(paths, Mapping):
        channels = {axis: number for number, axis in enumerate(paths, 1)}
        paths, together = list(paths.values()), True
    else:
        paths = [paths] if isinstance(paths, str | Path) else list(paths)
        together = len(paths) > 1
    if not paths:
        raise MotionError("no motion file given; give one, or one for each component")
    stated = {key: options[key] for key in ("time_step", "units") if options.get(key) is not None}
    forms, found = zip(*(read(Path(path), stated, None if together else channels) for path in paths), strict=True)
    components = [component for file in found for component in file]
    if together:
        components = [c._replace(labels=(str(k),)) for k, c in enumerate(components, 1)]
    elif any(component.axis for component in components):
        channels = None  # its reader has heeded them
    kind = f"{forms[0]} file{'s' if together else ''} {', '.join(Path(path).name for path in paths)}"
    motion = assemble(components, name or Path(paths[0]).stem, kind, channels=channels, rotate=rotate)
    factor = options.get("rotation_factor")
    return motion if factor is None else _with_rotations(motion, float(factor))


def _with_rotations(motion: GroundMotion, factor: float) -> GroundMotion:
    """Motion with its rotations multiplied; raises MotionError for one without, or a factor that is not finite."""
    if not math.isfinite(factor):
        raise MotionError(f"{motion.name}: rotation factor {factor}; give a finite number")
    if not motion.samples[:, 3:].any():
        raise MotionError(f"{motion.name}: has no rotations to multiply by {factor:g}; leave --rotation-factor out")
    samples = motion.samples * np.repeat([1.0, factor], 3)
    return replace(motion, samples=samples, source=f"{motion.source}; rotations times {factor:g}")


def _alone(text: str, where: str, stated: Mapping[str, Any]) -> str:
    """The text of a file that says time step and unit itself."""
    refuse_stated(where, stated)
    return text


def refuse_stated(where: str, stated: Mapping[str, Any]) -> None:
    """Raise MotionError if a time step or units are stated of a file that says them itself."""
    for key, flag in (("time_step", "--dt"), ("units", "--unit")):
        if key in stated:
            raise MotionError(f"{where}: this kind of file says its {key.replace('_', ' ')} itself; leave {flag} out")


def _channels(given: "str | Channels | None") -> Channels | None:
    """Channels by axis, from a text or mapping."""
    if isinstance(given, str):
        pairs = [item.partition("=") for item in given.split(",")]
        if any(not channel.strip() for _, _, channel in pairs) or len({a for a, *_ in pairs}) < len(pairs):
            raise MotionError(f"--channels {given}: write axis=channel with commas between, each axis once: x=2,y=1")
        given = {axis.strip(): channel.strip() for axis, _, channel in pairs}
    for axis in given or ():
        if axis not in AXES:
            raise MotionError(f"--channels: no axis {axis!r}; {instead_of(axis, AXES)}")
    return given


def _check_options(paths: Any, options: Mapping[str, Any]) -> None:
    """Raise MotionError for options that do not exist, or are of a wrong type."""
    for key, value in options.items():
        if key not in _OPTIONS:
            raise MotionError(f"{paths}: option {key!r} does not exist; {instead_of(key, sorted(_OPTIONS))}")
        kind, wanted = _OPTIONS[key]
        if value is not None and (not isinstance(value, kind) or isinstance(value, bool)):
            raise MotionError(f"{paths}: option {key} is {value!r}; give {wanted}")
