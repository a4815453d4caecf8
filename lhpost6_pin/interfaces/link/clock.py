"""The clock of a link, undisturbed stretches of time, and a histogram of times."""

import gc
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

__all__ = ["SECOND", "Histogram", "now", "undisturbed"]

SECOND = 1_000_000_000
"""Nanoseconds in a second."""

now = time.perf_counter_ns
"""Monotonic time [ns] of the finest resolution of the system; its origin is arbitrary."""


@contextmanager
def undisturbed() -> Iterator[None]:
    """Suspend the garbage collector; objects that exist already are exempt from it meanwhile."""
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


FINE = 20_000  # us: bins of one microsecond below it
GROWTH = math.log(1.01)  # bins of one per cent above it
WIDE = math.ceil(math.log(86_400e6 / FINE) / GROWTH)  # of them: up to a day


class Histogram:
    """Times in bins of one microsecond up to 20 ms, of 1 % above.

    Attributes: count; largest [s], exact.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self._bins = np.zeros(FINE + WIDE, np.int64)
        self.count, self.largest = 0, 0.0

    def add(self, nanoseconds: int) -> None:
        """Take one time [ns]."""
        at = max(nanoseconds, 0) // 1000
        if at >= FINE:
            at = min(FINE + int(math.log(at / FINE) / GROWTH), len(self._bins) - 1)
        self._bins[at] += 1
        self.count += 1
        self.largest = max(self.largest, nanoseconds * 1e-9)

    def percentile(self, share: float) -> float:
        """Time [s] that `share` [%] of those taken do not exceed, to the bin; 0 if there are none."""
        if not self.count:
            return 0.0
        at = int(np.searchsorted(np.cumsum(self._bins), share / 100.0 * self.count))
        edge = at + 1 if at < FINE else FINE * math.exp((at - FINE + 1) * GROWTH)
        return min(edge * 1e-6, self.largest)
