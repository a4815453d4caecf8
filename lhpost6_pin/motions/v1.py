"""COSMOS and CSMIP uncorrected accelerograms (Volume 1): several channels in one text file.

Each channel has text lines, header numbers, a line that announces the data (count, rate or duration, unit,
Fortran format), the data in fixed-width columns, and an end line. The CSMIP form gives the sampling rate in
the announcement; the COSMOS form (v01.20) gives the interval in the real header (value 62 [ms], else 34 [s]).
"""

import re
from collections.abc import Iterator, Mapping
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..core.errors import MotionError
from .motion import GroundMotion, make_motion
from .motion_units import acceleration_in_si
from .text import parse_fixed_width, read_text

__all__ = ["V1Channel", "is_v1", "load_v1", "make_v1_motion", "parse_v1"]

_WIDEST = 200  # characters of a header line that are looked at
_FORMAT = r"Format\s*[:=]?\s*\(\s*(?P<per_line>\d{1,3})[FIEfie](?P<width>\d{1,2})"
_HEADER = re.compile(
    rf"^\s*(\d{{1,9}})\s+(Integer|Real)-header values follow on\s+(\d{{1,9}})\s+lines.*?{_FORMAT}", re.I
)
_DATA = re.compile(rf"^\s*(?P<count>\d{{1,9}})\s+.*?(?:accel\w*).*?(?:points|pts)\b(?P<about>.*?){_FORMAT}", re.I)
_RATE = re.compile(r"at\s+(\d*\.?\d+)\s*pts/sec", re.I)
_UNIT = re.compile(r"units\s*(?:of|=)\s*([^\s,(]+?)\.?(?=[\s,(]|$)", re.I)
_CHANNEL = re.compile(r"Chan\s+(\d{1,9}):\s*(\d{1,4}\s*deg|up|down|[^()]*?)\s*(?:\(|Location|$)", re.I)
_DIRECTIONS = {"90": ("x", 1), "270": ("x", -1), "0": ("y", 1), "360": ("y", 1), "180": ("y", -1)}
_CHOOSE = (
    "write the channels wanted to a CSV file with their axes in its header, or choose from Python, as in "
    'channels={1: "x", 2: "y", 3: "z"}'
)


class V1Channel(NamedTuple):
    """One channel of a Volume 1 file."""

    number: int
    orientation: str  # "90", "360", "up", "down", or as in the file
    time_step: float  # [s]
    acceleration: np.ndarray  # (n,) [m/s^2]


def is_v1(text: str) -> bool:
    """Whether the text announces uncorrected accelerogram data."""
    head = text[:20000]
    return any(_DATA.match(line[:_WIDEST]) for line in head.splitlines())


def load_v1(
    path: "Path | str", *, channels: "Mapping[int, str] | None" = None, name: str | None = None
) -> GroundMotion:
    """Read a COSMOS or CSMIP V1 file into one motion.

    Orientations become axes: 90 degrees (east) is +x, 0 or 360 (north) is +y, up is +z; 270, 180 and down are
    the same axes with the sign turned. `channels` maps channel number to axis where the station stands at
    another angle or has more than three channels, as in ``{1: "x", 2: "y", 3: "z"}``.

    Raises MotionError naming the file, channel and line.
    """
    return make_v1_motion(parse_v1(read_text(path), str(path)), str(path), channels=channels, name=name)


def make_v1_motion(
    found: "list[V1Channel]",
    where: str,
    *,
    channels: "Mapping[int, str] | None" = None,
    name: str | None = None,
) -> GroundMotion:
    """One motion from the channels of a file."""
    by_axis: dict[str, np.ndarray] = {}
    steps = {channel.time_step for channel in found}
    if len(steps) != 1:
        raise MotionError(f"{where}: channels have different time steps {sorted(steps)} s; give channels of one rate")
    numbers = [channel.number for channel in found]
    if missing := sorted(set(channels or ()) - set(numbers)):
        raise MotionError(f"{where}: no channel {missing[0]}; the file has {', '.join(map(str, numbers))}")
    for channel in found:
        if channels and channel.number not in channels:
            continue
        axis, sign = (channels[channel.number], 1) if channels else _axis(channel, where)
        if axis in by_axis:
            raise MotionError(f"{where}, channel {channel.number}: a second channel for axis {axis}; {_CHOOSE}")
        by_axis[axis] = sign * channel.acceleration
    return make_motion(name or Path(where).stem, steps.pop(), by_axis, "acceleration", f"V1 file {Path(where).name}")


def parse_v1(text: str, where: str) -> "list[V1Channel]":
    """Channels of a Volume 1 text; raises MotionError naming `where`, channel and line."""
    channels = list(_channels(text.splitlines(), where))
    if not channels:
        raise MotionError(f"{where}: no line announces accelerogram data; is this a COSMOS or CSMIP V1 file?")
    return channels


def _channels(lines: "list[str]", where: str) -> Iterator[V1Channel]:
    headers: dict[str, np.ndarray] = {}
    label: re.Match[str] | None = None
    found = 0
    at = 0
    while at < len(lines):
        line = lines[at][:_WIDEST]
        at += 1
        if block := _HEADER.match(line):
            end = at + int(block[3])
            headers[block[2].lower()] = parse_fixed_width(lines[at:end], _width(block, where, at), where, at + 1)
            at = min(end, len(lines))
        elif data := _DATA.match(line):
            found += 1
            number = int(label[1]) if label else found
            here = f"{where}, channel {number}"
            per_line, count = int(data["per_line"]), int(data["count"])
            if not per_line or not count:
                raise MotionError(f"{here}, line {at}: announces no data; leave this channel out")
            rows = list(takewhile(_is_data, lines[at : at + -(-count // per_line)]))
            values = parse_fixed_width(rows, _width(data, here, at), here, at + 1)
            if len(values) != count:
                raise MotionError(
                    f"{here}, line {at}: announces {count} points, {len(values)} follow; "
                    "the file is damaged: download it again"
                )
            step = _step(data, headers, here, at)
            yield V1Channel(number, _orientation(label, headers), step, _si(values, data, here, at))
            at, headers, label = at + len(rows), {}, None
        elif channel := _CHANNEL.search(line):
            label = label or channel


def _is_data(line: str) -> bool:
    """Whether the line is not yet the one that ends the channel."""
    return not line.lower().startswith(("/&", "end"))


def _width(match: "re.Match[str]", where: str, line: int) -> int:
    width = int(match["width"])
    if not width:
        raise MotionError(f"{where}, line {line}: format with columns of no width; correct the header")
    return width


def _step(data: "re.Match[str]", headers: "dict[str, np.ndarray]", where: str, line: int) -> float:
    rate = _RATE.search(data["about"])
    real = headers.get("real", np.empty(0))
    if rate and float(rate[1]) > 0:
        return 1.0 / float(rate[1])
    if len(real) > 61 and real[61] > 0:
        return float(real[61]) / 1000  # [ms] in the file
    if len(real) > 33 and real[33] > 0:
        return float(real[33])
    raise MotionError(f"{where}, line {line}: no sampling rate here nor in the real header; convert the file to CSV")


def _si(values: np.ndarray, data: "re.Match[str]", where: str, line: int) -> np.ndarray:
    unit = _UNIT.search(data["about"])
    if unit is None:
        raise MotionError(f"{where}, line {line}: no unit announced; convert the file to CSV")
    return acceleration_in_si(values, unit[1], f"{where}, line {line}", "raw counts need a V1 file in g or cm/s^2")


def _orientation(label: "re.Match[str] | None", headers: "dict[str, np.ndarray]") -> str:
    if label and (text := label[2].lower().replace("deg", "").strip()):
        return str(int(text)) if re.fullmatch(r"\d{1,4}", text) else text
    integers = headers.get("integer", np.empty(0))
    if len(integers) > 53 and np.isfinite(integers[53]):  # COSMOS: azimuth, or 400 up and 401 down
        return {400: "up", 401: "down"}.get(int(integers[53]), str(int(integers[53])))
    return "unknown"


def _axis(channel: V1Channel, where: str) -> tuple[str, int]:
    vertical = {"up": 1, "down": -1}
    if channel.orientation in vertical:
        return "z", vertical[channel.orientation]
    if channel.orientation in _DIRECTIONS:
        return _DIRECTIONS[channel.orientation]
    raise MotionError(
        f"{where}, channel {channel.number}: orientation {channel.orientation[:40]!r} is not along an axis "
        f"(90, 360, up); {_CHOOSE}"
    )
