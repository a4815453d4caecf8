"""Work on the parts of large arrays by threads: compiled code and numpy's loops release the interpreter."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

__all__ = ["by_threads"]

_MOST = 4
"""Threads beyond which what the interpreter does between compiled parts takes longer than these."""

_P = TypeVar("_P")
_R = TypeVar("_R")


def by_threads(function: Callable[[_P], _R], parts: Sequence[_P]) -> Iterator[_R]:
    """What a function gives for each part, in their order; the first error that it raises ends the work."""
    count = min(_MOST, len(parts), len(os.sched_getaffinity(0)))
    if count < 2:
        yield from map(function, parts)
        return
    with ThreadPoolExecutor(count) as pool:
        yield from pool.map(function, parts)
