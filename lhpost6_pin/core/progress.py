"""Progress of a long computation: functions that take the completed fraction, 0 to 1."""

from collections.abc import Callable
from typing import TypeAlias

__all__ = ["Progress", "between", "split"]

Progress: TypeAlias = Callable[[float], None]


def between(report: Progress, first: float, last: float) -> Progress:
    """Progress of a part of the work, which covers the fractions `first` to `last` of the whole."""
    return lambda fraction: report(first + (last - first) * fraction)


def split(report: Progress, count: int) -> list[Progress]:
    """Progress of each of `count` equal parts of the work."""
    return [between(report, i / count, (i + 1) / count) for i in range(count)]
