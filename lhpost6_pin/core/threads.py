"""Work on the parts of large arrays by threads: compiled code and numpy's loops release the interpreter."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from typing import TypeVar

__all__ = ["by_threads", "fill_by_threads", "processors", "row_blocks", "work_alone"]

_MOST = 4
"""Threads beyond which what the interpreter does between compiled parts takes longer than these."""

_ROWS = 8192
"""Rows of a block: what is made of them stays in the processor's cache."""

_P = TypeVar("_P")
_R = TypeVar("_R")

_limit: list[int] = []
"""Largest number of threads, if it was set."""


def by_threads(function: Callable[[_P], _R], parts: Sequence[_P], jobs: int = -1) -> Iterator[_R]:
    """What a function gives for each part, in their order; the first error that it raises ends the work.

    It runs in the caller's context: numpy's handling of floating-point errors is as there. `jobs` is the largest number
    of threads, -1 that of this process.
    """
    if (count := min(*_limit, min(_MOST, processors()) if jobs < 1 else jobs, len(parts))) < 2:
        yield from map(function, parts)
        return
    each = [(copy_context(), part) for part in parts]
    with ThreadPoolExecutor(count) as pool:
        yield from pool.map(lambda one: one[0].run(function, one[1]), each)


def processors() -> int:
    """Processors of this process, or as many as OMP_NUM_THREADS states, which joblib and Dask set for workers."""
    stated, count = os.environ.get("OMP_NUM_THREADS", ""), len(os.sched_getaffinity(0))
    return min(count, int(stated)) if stated.isdecimal() else count


def work_alone() -> None:
    """Use no threads from now on: this process is one of as many as there are processors."""
    _limit.append(1)


def row_blocks(rows: int) -> list[slice]:
    """Consecutive parts of an array of so many rows, each with its start and stop."""
    return [slice(at, min(at + _ROWS, rows)) for at in range(0, rows, _ROWS)]


def fill_by_threads(fill: Callable[[slice], object], rows: int) -> None:
    """Call a function that fills a block of rows of its arrays for all blocks of so many rows."""
    for _ in by_threads(fill, row_blocks(rows)):
        pass
