"""The reference of a driven table in blocks of samples, of which the next may be computed before its first sample.

A block takes far longer than the other samples' answers. Computed between two samples, it delays none.
"""

from collections.abc import Callable
from copy import copy
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from .drive import Drive
from .moves import Moved

__all__ = ["BLOCK", "Reference"]

BLOCK = 32
"""Samples whose reference is computed together: an order acts within 16 ms, a trip at once."""


class _Block(NamedTuple):
    first: int  # sample
    moved: Moved  # (n, 6) each
    inputs: Array  # (n, 6) of the reference generators
    after: Drive  # as it is after the block


class Reference:
    """Blocks of a drive; attribute `drive`, whose state is that after the current block."""

    def __init__(self, drive: Drive, inputs_of: Callable[[Array, Array, Array], Array]) -> None:
        """Begin without a block; inputs_of: input (n, 6) of the reference generators for a motion, (n, 6) each."""
        self.drive, self._inputs_of = drive, inputs_of
        self._ahead: _Block | None = None
        self.clear()

    def clear(self) -> None:
        """Forget the current block: the next sample begins another."""
        self._block = _Block(0, Moved(*np.zeros((3, 0, 6))), np.zeros((0, 6)), self.drive)

    @property
    def end(self) -> int:
        """First sample behind the current block."""
        return self._block.first + len(self._block.inputs)

    def changed(self) -> None:
        """Forget a block that has been prepared: the drive changes before its first sample."""
        self._ahead = None

    def prepare(self, sample: int) -> None:
        """Compute the block that begins at a sample, unless the current one has it."""
        if self._ahead is None and not self._has(sample):
            after = copy(self.drive)  # its parts are replaced, never changed in place
            moved = after.advance(sample, BLOCK)
            self._ahead = _Block(sample, moved, self._inputs_of(*moved), after)

    def at(self, sample: int) -> tuple[Moved, int, Array]:
        """Reference (6,) each of a sample; its number in the block, and the block's inputs (n, 6)."""
        if not self._has(sample):
            if self._ahead is None or self._ahead.first != sample:
                self._ahead = None
                self.prepare(sample)
            assert self._ahead is not None
            self._block, self._ahead = self._ahead, None
            self.drive = self._block.after
        k, block = sample - self._block.first, self._block
        value, rate, acceleration = block.moved
        return Moved(value[k], rate[k], acceleration[k]), k, block.inputs

    def _has(self, sample: int) -> bool:
        return 0 <= sample - self._block.first < len(self._block.inputs)
