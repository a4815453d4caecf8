"""Summary of a link on the command line: counts and times as tables."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from ...core.console import make_console
from .clock import Histogram
from .protocol import COUNTS

__all__ = ["link_entries", "print_link", "too_slow"]

_MEANING = {
    **COUNTS,
    "resent": "commands sent again",
    "sensors_lost": "samples whose sensors were never received",
    "unanswered": "samples that the controller was too slow to answer",
    "ignored": "datagrams of other sessions, or malformed",
}
TOO_SLOW = 0.01  # share of deadlines missed: scattered late samples are bridged, one in a hundred is no accident
_SHARES = {"median": 50.0, "p99": 99.0, "p999": 99.9}


def too_slow(counts: Mapping[str, int]) -> str:
    """That the server's computer did not keep up with real time, and what to do; empty where it did."""
    missed, samples = counts.get("missed_deadlines", 0), counts.get("samples", 0)
    if missed <= TOO_SLOW * samples:
        return ""
    return (
        f"The server's computer is too slow for real time: {100.0 * missed / samples:.3g} % of the samples missed "
        "their deadline. Take lock-step, or a faster or less busy computer."
    )


def link_entries(counts: Mapping[str, int], times: Mapping[str, Histogram]) -> dict[str, Any]:
    """Counts, and times [s] at the median, 99 %, 99.9 % and the largest, as plain entries."""
    taken = {
        name: {"number": t.count, **{k: t.percentile(p) for k, p in _SHARES.items()}, "largest": t.largest}
        for name, t in times.items()
        if t.count
    }
    return {"counts": dict(counts), "times": taken, "too_slow": bool(too_slow(counts))}


def print_link(title: str, counts: Mapping[str, int], times: Mapping[str, Histogram]) -> None:
    """Print counts with their meaning, then times at the median, 99 %, 99.9 % and the largest."""
    console = make_console()
    table = Table("count", "number", "what", title=title)
    for name, number in counts.items():
        table.add_row(name.replace("_", " "), str(number), _MEANING[name])
    console.print(table)
    if slow := too_slow(counts):
        console.print(slow, markup=False)
    if taken := link_entries(counts, times)["times"]:
        table = Table("time \\[us]", "number", "median", "99 %", "99.9 %", "largest")
        for name, found in taken.items():
            table.add_row(name, str(found["number"]), *(f"{1e6 * found[k]:.0f}" for k in (*_SHARES, "largest")))
        console.print(table)
