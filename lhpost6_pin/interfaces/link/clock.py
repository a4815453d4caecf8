"""The clock of a link, and a stretch of time without pauses of Python's own making."""

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["SECOND", "now", "undisturbed"]

SECOND = 1_000_000_000
"""Nanoseconds in a second."""

now = time.perf_counter_ns
"""Monotonic time [ns] of the finest resolution that the system has; where it begins is arbitrary."""


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keep the garbage collector from running; what is held already it need not look at later, either."""
    was = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if was:
            gc.enable()
