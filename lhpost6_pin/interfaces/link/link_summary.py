"""What the command line prints of a link: counts and times as tables."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from ...core.console import make_console
from .statistics import Histogram

__all__ = ["link_entries", "print_link"]

_MEANING = {
    "received": "datagrams that came",
    "late": "commands older than one before",
    "duplicate": "commands that came again",
    "lost": "commands that never came",
    "superseded": "commands that a newer one replaced in time",
    "short": "datagrams that end too early",
    "malformed": "malformed datagrams",
    "foreign": "frames of another client or session",
    "missed_frames": "samples without a new command",
    "holds": "times in safe hold",
    "missed_deadlines": "samples done after the next was due",
    "samples": "samples of the plant",
    "resent": "commands sent again",
    "sensors_lost": "samples whose sensors never came",
    "unanswered": "samples that the controller was too slow to answer",
    "ignored": "datagrams that were not of this session",
}


def link_entries(counts: Mapping[str, int], times: Mapping[str, Histogram]) -> dict[str, Any]:
    """Counts, and times [s] at the median, 99 %, 99.9 % and the largest, as plain entries."""
    shares = {"median": 50.0, "p99": 99.0, "p999": 99.9}
    taken = {
        name: {"number": t.count, **{k: t.percentile(p) for k, p in shares.items()}, "largest": t.largest}
        for name, t in times.items()
        if t.count
    }
    return {"counts": dict(counts), "times": taken}


def print_link(title: str, counts: Mapping[str, int], times: Mapping[str, Histogram]) -> None:
    """Print counts with their meaning, then times at the median, 99 %, 99.9 % and the largest."""
    console = make_console()
    table = Table("count", "number", "what", title=title)
    for name, number in counts.items():
        table.add_row(name.replace("_", " "), str(number), _MEANING[name])
    console.print(table)
    taken = {name: times[name] for name in times if times[name].count}
    if taken:
        table = Table("time \\[us]", "number", "median", "99 %", "99.9 %", "largest")
        for name, found in taken.items():
            shares = [f"{1e6 * found.percentile(p):.0f}" for p in (50.0, 99.0, 99.9)]
            table.add_row(name, str(found.count), *shares, f"{1e6 * found.largest:.0f}")
        console.print(table)
