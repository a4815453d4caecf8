"""Rows of numbers from one process to another, without waiting: a ring in a file that both map into memory.

The writer overwrites the oldest rows; a reader that falls behind by more than the ring holds loses them, and can tell.
"""

from pathlib import Path

import numpy as np

from ..core.arrays import Array

__all__ = ["Ring", "RingReader"]

ROWS = 1 << 16
"""Rows that a ring holds: 32 s at the controller's rate."""


class Ring:
    """The writer's end."""

    def __init__(self, path: Path, width: int) -> None:
        """Map a new file for rows of `width` numbers."""
        rows = np.memmap(path, np.float64, "w+", shape=(ROWS + 1, width))  # row 0 holds the count
        self._rows = np.asarray(rows)  # a plain array is written to in a tenth of the time
        self._count = 0

    def write(self, row: Array) -> None:
        """Append a row (width,)."""
        self._rows[1 + self._count % ROWS] = row
        self._count += 1
        self._rows[0, 0] = self._count  # after the row, which is whole by then


class RingReader:
    """The reader's end; attribute `lost` counts rows that were overwritten unread."""

    def __init__(self, path: Path, width: int) -> None:
        """Map the file of a ring."""
        self._rows = np.memmap(path, np.float64, "r", shape=(ROWS + 1, width))
        self._taken = self.lost = 0

    def read(self) -> Array:
        """New rows (n, width), copied."""
        count = int(self._rows[0, 0])
        first = max(self._taken, count - ROWS // 2)  # the older half may be overwritten while it is copied
        self.lost += first - self._taken
        self._taken = count
        return np.array(self._rows[1 + np.arange(first, count) % ROWS])
