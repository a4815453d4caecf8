"""Clock times in tables of text, as loggers write them, read as seconds since the first.

A stamp is a time of day, `12:00:00.25`, with or without a date before it, or in a column of its own, in any usual order
of day and month: dates are compared, not read. A day ends where the clock falls by more than half of it.
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
_DATE = r"(?P<date>\d{1,4}(?P<mark>[-/.])\d{1,2}(?P=mark)\d{1,4})"
_STAMP = re.compile(
    rf"(?:{_DATE}[\sT]+)?"
    r"(?P<hour>\d{1,2}):(?P<minute>[0-5]?\d):(?P<second>[0-5]?\d(?:[.,](?P<digits>\d*))?)"
    r"\s*(?P<half>[AaPp][Mm])?\s*(?:Z|[+-]\d{2}:?\d{2})?"
)


def is_stamp(field: str) -> bool:
    """Whether a field is a time of day, with or without a date, or a date."""
    return _STAMP.fullmatch(field) is not None or _is_date(field)


def _is_date(field: str) -> bool:
    return re.fullmatch(_DATE, field) is not None


def take_stamps(rows: Lines, dialect: Dialect, names: Sequence[str], source: str) -> tuple[list[int], Lines, Array]:
    """The columns of stamps and of their dates, if any, the lines with zeros in them, and seconds (n,) since the first.

    There are none where the first line has no stamp. Raises RecordError naming line and column for a field that
    is no stamp, for two columns of stamps, dates without times of day, and as `seconds_of_stamps`.
    """
    first = dialect.split(rows[0][1]) if rows else []
    dates = [k for k, field in enumerate(first) if _is_date(field)]
    clocks = [k for k, field in enumerate(first) if _STAMP.fullmatch(field)]
    if not (dates or clocks) or len(first) != len(names):
        return [], rows, np.zeros(0)
    for columns, what in ((dates, "dates"), (clocks, "clock times")):
        if len(columns) > 1:
            both = ", ".join(repr(names[k]) for k in columns)
            raise RecordError(f"{source}: {both} are all {what}; leave all but one out")
    if not clocks:
        raise RecordError(f"{source}: {names[dates[0]]!r} has dates, and no column has times of day; leave it out")
    taken = clocks + dates
    stamps, bare = [], []
    for number, line in rows:
        fields = dialect.split(line)
        if len(fields) == len(names):  # lines of other lengths are refused with all others
            stamps.append((number, " ".join(fields[k] for k in (*dates, *clocks))))
            for k in taken:
                fields[k] = "0"
        bare.append((number, dialect.separator.join(f'"{x}"' if dialect.separator in x else x for x in fields)))
    where = "column " + " and ".join(repr(names[k]) for k in (*dates, *clocks))
    return taken, bare, seconds_of_stamps(stamps, where, source)


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
