"""How well a panel keeps the time of its plant's clock, counted from rows."""

import numpy as np

from ..core.arrays import Array
from ..core.names import SAMPLE_RATE
from ..interfaces.link import PlantState
from .rows import Rows

__all__ = ["Timekeeping"]


class Timekeeping:
    """Samples and safe holds of all sessions of a panel.

    Attributes: answered, samples that the controller saw; missed, those that it did not; late, those of the former that
    the plant took more than one sample after they were due by the least delay of the second before; holds.
    """

    def __init__(self, layout: Rows, pace: float) -> None:
        """Begin with nothing; `pace` is the speed of the plant's clock."""
        self._layout, self._rate = layout, SAMPLE_RATE * pace
        self.answered = self.missed = self.late = self.holds = 0
        self._newest, self._held, self._delays = -1, False, np.empty(0)

    @property
    def share(self) -> float:
        """Share of the samples that were missed or late."""
        return (self.missed + self.late) / max(self.answered + self.missed, 1)

    def add(self, rows: Array) -> None:
        """Take the next rows (n, width); those of a plant that waits for its first command are of no clock yet."""
        rows = rows[rows[:, 1] != PlantState.WAITING]
        if not len(rows):
            return
        samples = rows[:, 0].astype(int)
        goes_on = samples[0] > self._newest >= 0
        steps = np.diff(samples, prepend=self._newest if goes_on else samples[0])
        self.answered += int(np.count_nonzero(steps > 0))
        self.missed += int((steps[steps > 1] - 1).sum())
        self._newest = int(samples[-1])
        held = rows[:, 1] == PlantState.HOLD
        self.holds += int(np.count_nonzero(held[1:] & ~held[:-1])) + int(held[0] and not self._held)
        self._held = bool(held[-1])
        delays = self._layout.of(rows, "stamp")[:, 0] - samples / self._rate
        before = self._delays if goes_on else delays[:1]
        least = np.minimum(np.minimum.accumulate(delays), before.min())
        self.late += int(np.count_nonzero((delays - least > 1.0 / self._rate) & (steps > 0)))
        self._delays = np.concatenate([before, delays])[-SAMPLE_RATE:]
