"""What a link keeps count of: datagrams, holds, and times in a histogram that never grows."""

from dataclasses import astuple, dataclass

import numpy as np

__all__ = ["Counts", "Histogram"]


@dataclass
class Counts:
    """What a server has met, in the order of `protocol.COUNTS`."""

    received: int = 0  # datagrams
    late: int = 0  # commands older than one that came before
    duplicate: int = 0  # commands that came again
    lost: int = 0  # numbers missing from the sequence of commands
    superseded: int = 0  # commands replaced by a newer one before the plant could take them
    short: int = 0  # datagrams that end too early
    malformed: int = 0  # datagrams that are no frame, or none that a client may send
    foreign: int = 0  # frames of another client, or of an earlier session
    missed_frames: int = 0  # samples without a new command
    holds: int = 0  # times that the plant went to its safe hold
    missed_deadlines: int = 0  # samples that ended after the next one was due
    samples: int = 0  # that the plant has moved

    def since(self, before: "Counts") -> "Counts":
        """What came after an earlier reading."""
        return Counts(*(a - b for a, b in zip(astuple(self), astuple(before), strict=True)))


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
