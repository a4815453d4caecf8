"""Work in processes forked from this one: each has its data, and only results are sent back.

For parts of which the interpreter takes most of the time: threads would wait for each other.
"""

import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from logging.handlers import QueueHandler
from multiprocessing import get_context
from queue import SimpleQueue
from typing import Any, TypeVar

from .threads import by_threads, processors, work_alone

__all__ = ["by_processes"]

_PORTIONS = 8
"""Portions of the parts for each process, so that all end at about the same time."""

_MANY = 4
"""Parts for each process from which one more is computed before: what it compiles or loads is there for all."""

_P = TypeVar("_P")
_R = TypeVar("_R")

_given: dict[str, Any] = {}
"""In a forked process: the function, the parts, and the queue of what is logged."""

_loaded: set[str] = set()
"""Functions of which this process has computed a part itself."""


def by_processes(function: Callable[[_P], _R], parts: Sequence[_P], jobs: int = -1) -> Iterator[_R]:
    """What a function gives for each part, in their order; the first error that it raises ends the work.

    By `jobs` processes, -1: one a processor, or as many as OMP_NUM_THREADS states. Within each there are no further
    ones and no threads. Results are pickled, the function and its parts need not be. What is logged is logged here. By
    threads where the system or the caller, a thread or another such process, cannot fork safely.
    """
    count = min(processors() if jobs < 1 else jobs, len(parts))
    if count < 2 or "function" in _given or not _may_fork():
        yield from by_threads(function, parts, jobs)
        return
    name = getattr(getattr(function, "func", function), "__qualname__", "")
    if name not in _loaded and len(parts) > _MANY * count:
        yield function(parts[0])
        _loaded.add(name)
        parts = parts[1:]
    portion = max(1, len(parts) // (_PORTIONS * count))
    with ProcessPoolExecutor(count, get_context("fork"), _begin, (function, parts)) as pool:
        for result, logged in pool.map(_part, range(len(parts)), chunksize=portion):
            for record in logged:
                logging.getLogger(record.name).handle(record)
            yield result


def _may_fork() -> bool:
    """Whether this thread is the main one, of a system whose libraries survive a fork."""
    return sys.platform == "linux" and threading.current_thread() is threading.main_thread()


def _begin(function: Callable[[Any], Any], parts: Sequence[Any]) -> None:
    """Set a forked process up: another thread may have held the terminal's lock when it was forked."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller ends the work
    work_alone()
    logged: SimpleQueue[logging.LogRecord] = SimpleQueue()
    for name in (None, *logging.root.manager.loggerDict):
        logging.getLogger(name).handlers.clear()
    logging.getLogger().addHandler(QueueHandler(logged))
    _given.update(function=function, parts=parts, logged=logged)


def _part(place: int) -> tuple[Any, list[logging.LogRecord]]:
    """What the function gives for a part, and what it logs."""
    result, logged = _given["function"](_given["parts"][place]), _given["logged"]
    return result, [logged.get() for _ in range(logged.qsize())]
