"""Bins of derivatives, kept in the columns of the residuals in which they are not zero."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array, Complex, Mask

__all__ = ["SparseBins", "sparse_bins"]


class SparseBins(NamedTuple):
    """Bins of one quantity, or of several, in the columns of the residuals in which they are not zero.

    Bins are last in memory, so that bands of them are copied, and parts of them are transformed, as wholes.
    """

    columns: NDArray[np.intp]  # (k,) rising
    bins: Complex  # (k, m), or (k, p, m) of p quantities

    @property
    def each(self) -> Complex:
        """Bins (k, p, m) of every quantity."""
        m = self.bins.shape[-1]
        return self.bins.reshape(len(self.columns), self.bins.shape[1] if self.bins.ndim > 2 else 1, m)

    def per(self, size: float) -> "SparseBins":
        """Bins per unit of what changed by a size."""
        return self._replace(bins=self.bins / size)

    def times(self, scale: Array) -> "SparseBins":
        """Bins (k, m) scaled (m, c)."""
        return self._replace(bins=self.bins * scale.T[self.columns])

    def less(self, other: "SparseBins", count: int) -> "SparseBins":
        """Difference to another one, of `count` columns in all."""
        both = np.zeros((count, *self.bins.shape[1:]), np.complex128)
        both[self.columns] = self.bins
        both[other.columns] -= other.bins
        columns = np.union1d(self.columns, other.columns)
        return SparseBins(columns, both[columns])

    def some(self, columns: Mask) -> "SparseBins":
        """Those in some of the columns (c,)."""
        here = columns[self.columns]
        return SparseBins(self.columns[here], self.bins[here])

    def full(self, count: int) -> Complex:
        """Bins (m, c), or (m, c, p), in all of `count` columns."""
        out = np.zeros((count, *self.bins.shape[1:]), np.complex128)
        out[self.columns] = self.bins
        return np.moveaxis(out, -1, 0)


def sparse_bins(bins: Complex) -> SparseBins:
    """The columns of bins (m, c), or (m, c, p), that are not zero."""
    columns = np.flatnonzero(bins.any(axis=(0, *range(2, bins.ndim))))
    return SparseBins(columns, np.ascontiguousarray(np.moveaxis(bins[:, columns], 0, -1)))
