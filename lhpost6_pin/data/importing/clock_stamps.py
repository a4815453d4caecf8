"""Clock times in tables of text, as loggers write them, read as seconds since the first.

A stamp is a time of day, `12:00:00.25`, with or without a date before it in any usual order of day and month: dates are
compared, not read. A day ends where the clock falls by more than half of it.
"""

import re
from collections.abc import Sequence

import numpy as np

from ...core.arrays import Array
from ...core.errors import RecordError
from ...core.number_table import Dialect

__all__ = ["Lines", "is_stamp", "seconds_of_stamps", "take_stamps"]

Lines = list[tuple[int, str]]
"""Lines of a table, each with its number in the file."""

DAY = 86400.0  # [s]
_STAMP = re.compile(
    r"(?:(?P<date>\d{1,4}(?P<mark>[-/.])\d{1,2}(?P=mark)\d{1,4})[\sT]+)?"
    r"(?P<hour>\d{1,2}):(?P<minute>[0-5]?\d):(?P<second>[0-5]?\d(?:[.,](?P<digits>\d*))?)"
    r"\s*(?P<half>[AaPp][Mm])?\s*(?:Z|[+-]\d{2}:?\d{2})?"
)


def is_stamp(field: str) -> bool:
    """Whether a field is a time of day, with or without a date."""
    return _STAMP.fullmatch(field) is not None


def take_stamps(rows: Lines, dialect: Dialect, names: Sequence[str], source: str) -> tuple[int | None, Lines, Array]:
    """The column whose fields are stamps, the lines with zeros in it, and its seconds (n,) since the first.

    There is none (None) where the first line has no stamp. Raises RecordError naming line and column for a field that
    is no stamp, for two columns of stamps, and as `seconds_of_stamps`.
    """
    first = dialect.split(rows[0][1]) if rows else []
    where = [k for k, field in enumerate(first) if is_stamp(field)]
    if not where or len(first) != len(names):
        return None, rows, np.zeros(0)
    if len(where) > 1:
        both = ", ".join(repr(names[k]) for k in where)
        raise RecordError(f"{source}: {both} are all clock times; leave all but one out")
    stamps, bare = [], []
    for number, line in rows:
        fields = dialect.split(line)
        if len(fields) == len(names):  # lines of other lengths are refused with all others
            stamps.append((number, fields[where[0]]))
            fields[where[0]] = "0"
        bare.append((number, dialect.separator.join(f'"{x}"' if dialect.separator in x else x for x in fields)))
    return where[0], bare, seconds_of_stamps(stamps, f"column {names[where[0]]!r}", source)


def seconds_of_stamps(stamps: Lines, column: str, source: str) -> Array:
    """Seconds (n,) since the first of stamps, each with its line; RecordError for what is none, or is not resolved."""
    days, last, date, digits, found = 0, -1.0, None, 0, []
    for number, text in stamps:
        place = f"{source}, line {number}, {column}"
        stamp = _STAMP.fullmatch(text)
        if stamp is None:
            raise RecordError(f"{place}: {text[:40]!r} is no time as 12:00:00.25; correct it, or cut the table there")
        hour = int(stamp["hour"])
        if stamp["half"]:
            hour = hour % 12 + 12 * (stamp["half"].lower() == "pm")
        clock = 3600.0 * hour + 60.0 * int(stamp["minute"]) + float(stamp["second"].replace(",", "."))
        passed = clock < last - 0.5 * DAY
        if date is not None and (stamp["date"] != date) != passed:
            what = "is earlier on the day of" if passed else "is of another day, without midnight between, than"
            raise RecordError(f"{place}: {text!r} {what} the line before; sort the rows, or cut them there")
        if clock == last:
            raise RecordError(
                f"{place}: {text!r} is the time of the line before, too: stamps are coarser than the samples; leave "
                "the column out, and give file_rate, in Hz, in [test] of the map"
            )
        days += passed
        last, date, digits = clock, stamp["date"], max(digits, len(stamp["digits"] or ""))
        found.append(DAY * days + clock)
    return np.round(np.array(found) - found[0], digits) if found else np.zeros(0)
