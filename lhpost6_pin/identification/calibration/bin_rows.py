"""Real rows of derivatives over the bins of a test, kept by column of the residuals.

Most unknowns show in few columns: those of a valve in its own flows, those of friction in the wrench. Products of rows
are summed column by column over the unknowns that show there, at a part of the work of full matrices.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array, Complex, Mask
from ...core.compiled import compiled
from .sparse_bins import SparseBins

__all__ = ["BandSquares", "BinRows", "bin_rows", "over", "row_by_column", "squares_of"]


@dataclass(frozen=True)
class BinRows:
    """Rows of p quantities, in each of c columns those of the quantities that are not zero there.

    Values of a column are real (2 m,): real and imaginary parts of its m bins in turn, times the root of two.
    """

    count: int  # p
    parts: Sequence[tuple[NDArray[np.intp], Array]]  # by column: quantities (a,), and their rows (a, 2 m)

    def weighed(self, root: Array) -> "BinRows":
        """The same over the roots of a power (m, c)."""
        return BinRows(self.count, [(own, rows * w) for (own, rows), w in zip(self.parts, over(root), strict=True)])

    def scaled(self, scale: Array) -> "BinRows":
        """The same with every quantity scaled (p,)."""
        return BinRows(self.count, [(own, rows * scale[own, None]) for own, rows in self.parts])

    def squares(self) -> Array:
        """Products (p, p) of all rows with each other."""
        out = np.zeros((self.count, self.count))
        for own, rows in self.parts:
            if len(own):
                _add_at(out, own, rows @ rows.T)
        return out

    def squares_by_band(self, starts: NDArray[np.intp]) -> "BandSquares":
        """The same by column and band of bins, each from one of `starts` (b,) to the next."""
        return BandSquares(self.count, [(own, _products_by_band(rows, starts)) for own, rows in self.parts])

    def products(self, other: "BinRows") -> Array:
        """Products (p, q) with other rows of the same columns."""
        out = np.zeros((self.count, other.count))
        for (own, rows), (others, more) in zip(self.parts, other.parts, strict=True):
            if len(own) and len(others):
                out[np.ix_(own, others)] += rows @ more.T
        return out

    def dot(self, rest: Array) -> Array:
        """Products (p,) with one row, by column (c, n)."""
        out = np.zeros(self.count)
        for (own, rows), values in zip(self.parts, rest, strict=True):
            out[own] += rows @ values
        return out

    def times(self, x: Array) -> Array:
        """Sum (c, n) of all rows times x (p,), by column."""
        return np.array([x[own] @ rows for own, rows in self.parts])

    def only(self, places: NDArray[np.intp]) -> "BinRows":
        """Rows of some of the quantities, places (q,) rising."""
        place = np.full(self.count, -1)
        place[places] = np.arange(len(places))
        here = [place[own] >= 0 for own, _ in self.parts]
        pairs = zip(self.parts, here, strict=True)
        return BinRows(len(places), [(place[own[some]], rows[some]) for (own, rows), some in pairs])

    def select(self, parts: Array) -> "BinRows":
        """Rows of quantities that are sums of these, parts (p, q)."""
        return BinRows(parts.shape[1], [_combined(own, rows, parts) for own, rows in self.parts])

    def less(self, other: "BinRows") -> "BinRows":
        """Differences to as many other rows."""
        return BinRows(self.count, [_less(*both) for both in zip(self.parts, other.parts, strict=True)])


@dataclass(frozen=True)
class BandSquares:
    """Products of p rows with each other, by column and band: summed over any power that is constant in a band."""

    count: int  # p
    parts: Sequence[tuple[NDArray[np.intp], Array]]  # by column: quantities (a,), and their products (b, a, a)

    def over(self, power: Array, columns: Mask | None = None) -> Array:
        """Sums (p, p) over a power (b, c), of some columns (c,) or all."""
        out, weight = np.zeros((self.count, self.count)), 1.0 / power
        for c, (own, products) in enumerate(self.parts):
            if len(own) and (columns is None or columns[c]):
                _add_at(out, own, np.tensordot(weight[:, c], products, axes=1))
        return out


def _products_by_band(rows: Array, starts: NDArray[np.intp]) -> Array:
    """Products (b, a, a) of rows (a, 2 m) with each other in every band of bins."""
    out = np.empty((len(starts), len(rows), len(rows)))
    for b, (low, high) in enumerate(pairwise((*(2 * starts), rows.shape[1]))):
        np.matmul(rows[:, low:high], rows[:, low:high].T, out=out[b])
    return out


@compiled
def _add_at(out: Array, own: NDArray[np.intp], products: Array) -> None:
    """Add products (a, a) to the rows and columns `own` (a,) of a matrix (p, p)."""
    for i in range(len(own)):
        for j in range(len(own)):
            out[own[i], own[j]] += products[i, j]


def _combined(own: NDArray[np.intp], rows: Array, parts: Array) -> tuple[NDArray[np.intp], Array]:
    used = np.flatnonzero(parts[own].any(axis=0))
    return used, parts[np.ix_(own, used)].T @ rows


def _less(one: tuple[NDArray[np.intp], Array], other: tuple[NDArray[np.intp], Array]) -> tuple[NDArray[np.intp], Array]:
    (own, rows), (others, less) = one, other
    both = np.union1d(own, others)
    out = np.zeros((len(both), rows.shape[1]))
    out[np.searchsorted(both, own)] = rows
    out[np.searchsorted(both, others)] -= less
    return both, out


def bin_rows(quantities: Sequence[SparseBins], columns: int) -> BinRows:
    """Rows of quantities, each of which may be several."""
    members: list[list[int]] = [[] for _ in range(columns)]
    values: list[list[Complex]] = [[] for _ in range(columns)]
    count, width = 0, quantities[0].bins.shape[-1] if quantities else 0
    for one in quantities:
        last = count + one.each.shape[1]
        for column, bins in zip(one.columns.tolist(), one.each, strict=True):
            members[column] += range(count, last)
            values[column].append(bins)
        count = last
    pairs = zip(members, values, strict=True)
    return BinRows(count, [(np.array(own, np.intp), _part(bins, width)) for own, bins in pairs])


def _part(bins: Sequence[Complex], width: int) -> Array:
    """Real rows (a, 2 m) of bins in pieces (p, m)."""
    both = np.concatenate([np.zeros((0, width), np.complex128), *bins])
    both *= np.sqrt(2.0)
    return both.view(np.float64)


def row_by_column(bins: Complex, root: Array) -> Array:
    """One row (c, 2 m) of bins (m, c) over the roots of a power (m, c)."""
    return np.ascontiguousarray((bins * (np.sqrt(2.0) / root)).T).view(np.float64)


def squares_of(rows: Array) -> Array:
    """Squares (m, c) of the bins of one row (c, 2 m)."""
    return np.asarray(0.5 * (rows[:, ::2] ** 2 + rows[:, 1::2] ** 2).T)


def over(root: Array) -> Array:
    """Weights (c, 2 m), of real and of imaginary parts, over the roots of a power (m, c)."""
    return np.repeat(1.0 / root.T, 2, axis=1)
