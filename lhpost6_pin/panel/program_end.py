"""How a program that ran came to its end: by itself, by an order, by a trip or with the session."""

import numpy as np

from ..core.arrays import Array
from ..core.names import SAMPLE_RATE
from .engine import Status

__all__ = ["ProgramEnd"]


class ProgramEnd:
    """Follows the states of a table from the start of a program to its end, and states that in words."""

    def __init__(self) -> None:
        """Begin while nothing runs."""
        self._name, self._cause, self._ended = "", "", False
        self._samples: tuple[int, int] | None = None  # first and last in which it ran

    @property
    def runs(self) -> bool:
        """Whether a program runs, is held or returns to the setpoint."""
        return bool(self._name) and not self._ended

    def show(self, status: Status | None) -> None:
        """Take the next state; None: the session has ended."""
        if status is not None and status.state != "stopped":
            if not self.runs:
                self._name, self._cause, self._ended = str(status.program), "", False
        elif self.runs:
            self._ended = True
            if status is None:
                self._cause = "the session ended"
            elif status.trip:
                self._cause = "the table tripped"

    def stop(self, who: str) -> None:
        """Take an order to stop; the first of a program is its cause, and one without a program is nothing's."""
        if self.runs and not self._cause:
            self._cause = f"stopped by {who}"

    def pass_samples(self, samples: Array, clock: Array) -> None:
        """Take the next samples' numbers (n,), and the program's clock (n,) [s] in them: zero unless one runs.

        Its start and end move that clock more slowly than time, which is counted from the samples.
        """
        ran = samples[np.asarray(clock) > 0.0]
        if len(ran):
            self._samples = int(ran[0] if self._samples is None else self._samples[0]), int(ran[-1])

    @property
    def _seconds(self) -> float:
        """Time from Run to the end, with its start, holds and return to rest [s]."""
        return 0.0 if self._samples is None else (self._samples[1] - self._samples[0] + 1) / SAMPLE_RATE

    def take(self) -> str | None:
        """The end in words, once, after the samples up to it have been read; None: nothing has ended."""
        if not self._ended:
            return None
        stated = f"{self._name} ended after {self._seconds:.1f} s: {self._cause or 'by itself'}"
        self._name, self._ended, self._samples = "", False, None
        return stated
