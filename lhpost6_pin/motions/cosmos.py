"""CSMIP and COSMOS accelerograms, uncorrected (V1) and corrected (V2): several channels in one text file.

Each channel has text lines, header numbers, the data in fixed-width columns, and an end line. Three layouts of data:

- CSMIP and COSMOS: a line announces points, rate or spacing, unit and mostly the Fortran format; without one there are
  8 columns. COSMOS (v01.20) gives the interval in the real header (value 62 [ms], else 34 [s]).
- CSMIP V2: the same for acceleration, then velocity and displacement, which are passed over.
- CSMIP V1 of digitised film (until the 1990s): points and unit (G/10) among the text lines, then 100 whole numbers in
  7 lines and 50 real ones in 7, then pairs of time and acceleration, 10F7.3, at steps that differ a little.
"""

import re
from collections.abc import Iterator
from itertools import takewhile

import numpy as np

from ..core.errors import MotionError
from .components import Component, Direction, direction_of
from .motion_units import acceleration_in_si
from .text import Rows, number_rows, parse_fixed_width
from .time_steps import even_out

__all__ = ["is_cosmos", "read_cosmos"]

_WIDEST = 200  # characters of a header line that are looked at
_FORMAT = re.compile(r"\(\s*(?P<per_line>\d{1,3})[FIE](?P<width>\d{1,2})", re.I)
_STANDARD_COLUMNS = 8  # of CSMIP data whose format is not announced
_HEADER = re.compile(r"^\s*\d{1,9}\s+(Integer|Real)-header values follow on\s+(\d{1,9})\s+lines", re.I)
_DATA = re.compile(
    r"^\s*(?P<count>\d{1,9})\s+(?:(?:\w+\s+)?accel\w*\s+(?:points|pts)|points of accel\w* data)\b(?P<about>.*)", re.I
)
_RATE = re.compile(r"at\s+(\d*\.?\d+)\s*pts/sec", re.I)
_SPACING = re.compile(r"spaced at\s+(\d*\.?\d+)\s*sec", re.I)
_UNIT = re.compile(r"(?:units\s*(?:of|=|:)|,\s*in)\s*([^\s,()]+?)\.?(?=[\s,()]|$)", re.I)
_CHANNEL = re.compile(r"Chan\s+(\d{1,9}):\s*(\d{1,4}\s*deg|[^()]*?)\s*(?:\(|Location|from\s*$|$)", re.I)
_SCNL = re.compile(r"\|\s*<SCNL>\s*\w+\.(\w{3})\.", re.I)
_POINTS = re.compile(r"NO\.\s*OF\s*POINTS\s*=\s*(\d{1,9})", re.I)
_FILM = re.compile(r"UNITS\s+OF\s+UNCOR\s+ACCEL\s+ARE\s+SEC\s+AND\s+(G/10|G)\b", re.I)
_FILM_HEADER, _FILM_PAIRS, _FILM_WIDTH = 14, 5, 7  # lines of header numbers; pairs a line; characters of a number


def is_cosmos(text: str) -> bool:
    """Whether the text announces data of an accelerogram."""
    head = [line[:_WIDEST] for line in text[:20000].splitlines()]
    return any(_DATA.match(line) or _FILM.search(line) for line in head)


def read_cosmos(text: str, where: str) -> list[Component]:
    """Channels of a file; raises MotionError naming the file, channel and line of what cannot be understood."""
    channels = list(_channels(number_rows(text), where))
    if not channels:
        raise MotionError(f"{where}: no line announces acceleration data; is this a COSMOS or CSMIP V1 or V2 file?")
    return channels


def _channels(rows: Rows, where: str) -> Iterator[Component]:
    headers: dict[str, np.ndarray] = {}
    label: re.Match[str] | None = None
    seed = ""
    points = found = at = 0
    while at < len(rows):
        line_number, line = rows[at][0], rows[at][1][:_WIDEST]
        at += 1
        data, film = _DATA.match(line), _FILM.search(line)
        if block := _HEADER.match(line):
            end = at + int(block[2])
            headers[block[1].lower()] = parse_fixed_width(rows[at:end], _width(line, where, line_number), where)
            at = min(end, len(rows))
        elif data or (film and points):
            found += 1
            number = label[1] if label else str(found)
            here = f"{where}, channel {number}"
            if data:
                taken, step, si = _announced(rows[at:], data, headers, here, line_number)
            else:
                taken, step, si = _film(rows[at:], points, film[1] if film else "", here, line_number)
            yield Component(here, (number,), _direction(label, seed, headers), step, si)
            at, headers, label, seed, points = at + taken, {}, None, "", 0
        elif channel := _CHANNEL.search(line):
            label = label or channel
        elif code := _SCNL.match(line):
            seed = code[1]
        elif count := _POINTS.search(line):
            points = int(count[1])


def _announced(
    rows: Rows, data: "re.Match[str]", headers: "dict[str, np.ndarray]", here: str, line: int
) -> tuple[int, float, np.ndarray]:
    """Lines taken, step [s] and accelerations [m/s^2] of data below the line that announces them."""
    count, about = int(data["count"]), data["about"]
    form = _FORMAT.search(about)
    per_line = int(form["per_line"]) if form else min(_STANDARD_COLUMNS, count)
    if not per_line or not count:
        raise MotionError(f"{here}, line {line}: announces no data; leave this channel out")
    taken = _data_rows(rows, -(-count // per_line))
    width = int(form["width"]) if form else len(taken[0][1].rstrip()) // per_line if taken else 0
    if not width:
        raise MotionError(f"{here}, line {line}: format with columns of no width; correct the header")
    values = _complete(parse_fixed_width(taken, width, here), count, here, line)
    unit = _UNIT.search(about)
    if unit is None:
        raise MotionError(f"{here}, line {line}: no unit announced; convert the file to CSV")
    return len(taken), _step(about, headers, here, line), _si(values, unit[1], here, line)


def _film(rows: Rows, points: int, unit: str, here: str, line: int) -> tuple[int, float, np.ndarray]:
    """As `_announced`, of pairs of time and acceleration; values are brought to a uniform step."""
    begin = next((k for k, (_, text) in enumerate(rows) if not re.search("[a-z]", text, re.I)), len(rows))
    begin += _FILM_HEADER
    taken = _data_rows(rows[begin:], -(-points // _FILM_PAIRS))
    numbers = _complete(parse_fixed_width(taken, _FILM_WIDTH, here), 2 * points, here, line)
    if points < 2:
        raise MotionError(f"{here}, line {line}: announces {points} point(s); leave this channel out")
    step, even = even_out(numbers[::2], numbers[1::2], here)
    return begin + len(taken), step, _si(even, unit, here, line)


def _data_rows(rows: Rows, most: int) -> Rows:
    """Rows of data: no more than `most`, and none from the line that ends the channel."""
    return list(takewhile(lambda row: not row[1].lower().lstrip().startswith(("/&", "end")), rows[:most]))


def _complete(values: np.ndarray, count: int, here: str, line: int) -> np.ndarray:
    if len(values) != count:
        raise MotionError(
            f"{here}, line {line}: announces {count} points, {len(values)} follow; "
            "the file is damaged: download it again"
        )
    return values


def _width(line: str, where: str, number: int) -> int:
    form = _FORMAT.search(line)
    if form is None or not int(form["width"]):
        raise MotionError(f"{where}, line {number}: format with columns of no width; correct the header")
    return int(form["width"])


def _step(about: str, headers: "dict[str, np.ndarray]", where: str, line: int) -> float:
    rate, spacing = _RATE.search(about), _SPACING.search(about)
    real = headers.get("real", np.empty(0))
    if rate and float(rate[1]) > 0:
        return 1.0 / float(rate[1])
    if spacing and float(spacing[1]) > 0:
        return float(spacing[1])
    if len(real) > 61 and real[61] > 0:
        return float(real[61]) / 1000  # [ms] in the file
    if len(real) > 33 and real[33] > 0:
        return float(real[33])
    raise MotionError(f"{where}, line {line}: no sampling rate here nor in the real header; convert the file to CSV")


def _si(values: np.ndarray, unit: str, where: str, line: int) -> np.ndarray:
    remedy = "raw counts need a V1 file in g or cm/s^2"
    base = unit.removesuffix("/10")
    return acceleration_in_si(values, base, f"{where}, line {line}", remedy) / (1 if base == unit else 10)


def _direction(label: "re.Match[str] | None", seed: str, headers: "dict[str, np.ndarray]") -> Direction:
    """Direction by the channel's label, else COSMOS's header; a vertical SEED code (BNZ) overrides its azimuth."""
    if label and (found := direction_of(label[2])) is not None:
        return found
    integers = headers.get("integer", np.empty(0))
    azimuth = integers[53] if len(integers) > 53 and np.isfinite(integers[53]) else -1  # or 400 up, 401 down
    stated = direction_of(f"{azimuth:.0f}") if azimuth >= 0 else None
    by_code = direction_of(seed)
    return by_code if isinstance(by_code, str) or stated is None else stated
