"""The clock of a link, undisturbed stretches of time, and a histogram of times."""

import gc
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


class Histogram:
    """Times in bins of one microsecond, up to 20 ms.

    Attributes: count; largest [s], exact.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self._bins = np.zeros(20_000, np.int64)
        self.count, self.largest = 0, 0.0

    def add(self, nanoseconds: int) -> None:
        """Take one time [ns]."""
        self._bins[min(max(nanoseconds, 0) // 1000, len(self._bins) - 1)] += 1
        self.count += 1
        self.largest = max(self.largest, nanoseconds * 1e-9)

    def percentile(self, share: float) -> float:
        """Time [s] that `share` [%] of those taken do not exceed, to the bin; 0 if there are none."""
        if not self.count:
            return 0.0
        at = int(np.searchsorted(np.cumsum(self._bins), share / 100.0 * self.count))
        return min((at + 1) * 1e-6, self.largest)
