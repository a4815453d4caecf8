"""Progress of long work: functions that are told the share done, 0 to 1."""

from collections.abc import Callable
from typing import TypeAlias

__all__ = ["Progress", "between"]

Progress: TypeAlias = Callable[[float], None]


def between(report: Progress, first: float, last: float) -> Progress:
    """Progress of a part of the work, which runs from the share `first` to `last` of the whole."""
    return lambda share: report(first + (last - first) * share)
