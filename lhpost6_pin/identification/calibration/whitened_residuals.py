"""Residuals in the frequency domain, whitened by their sensor noise.

A discrete Fourier transform over a whole test is a zero-phase filter: only bins within the band are compared. In it
stationary noise is independent from bin to bin, so that least squares weighted with its cross-spectral matrix per band
is the best linear estimate, and its inverse normal matrix the covariance.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array, Complex, Mask
from ...core.errors import RecordError
from .sparse_bins import SparseBins

__all__ = ["Whitener", "excess", "make_whitener", "mean_squares", "spectrum_of"]
__all__ += ["negative_log_likelihood"]


BELIEF = 4.0
"""Weight of the stated noise power, in bins, where a band shows more: few bins estimate a power poorly."""

CERTAIN = 9.0
"""Squared partial correlation times samples from which two columns of noise count as correlated; one by chance."""


def spectrum_of(x: Array, dt: float, low: float, high: float, edge: float) -> tuple[Complex, Array]:
    """Bins (m, k) of columns (n, k) from `low` to `high` [Hz], and their frequencies (m,) [Hz].

    `edge` [s] is cut off at both ends, and a few samples more for a fast transform. Noise of one-sided spectrum S has
    E|X|^2 = S; the mean, which is real, E X^2 = S / 2.
    """
    from scipy import fft

    cut = round(edge / dt)
    n = fft.prev_fast_len(len(x) - 2 * cut, real=True)
    f = fft.rfftfreq(n, dt)
    first, last = np.searchsorted(f, low), np.searchsorted(f, high, side="right")
    out = fft.rfft(x[cut : cut + n].T)[:, first:last] * np.sqrt(2.0 * dt / n)
    if first == 0:
        out[:, 0] /= np.sqrt(2.0)
    return out.T, f[first:last]


class Whitener(NamedTuple):
    """Inverse Cholesky factors (t, b, k, k) of the noise's cross-spectral matrices: by test, in bands between `edges`.

    edges is (b + 1,) [Hz].
    """

    edges: Array
    factor: Complex

    def band(self, f: Array) -> NDArray[np.intp]:
        """Band (m,) of each frequency f (m,)."""
        return _band(self.edges, f)

    def starts(self, f: Array) -> NDArray[np.intp]:
        """Places (b,) in rising frequencies f (m,) at which those of a band begin, of bands that hold some."""
        return np.unique(self.band(f), return_index=True)[1]

    def scaled(self, scale: Array) -> "Whitener":
        """The same with whitened columns (t, b, k) times larger."""
        return self._replace(factor=scale[..., None] * self.factor)

    def apply(self, test: int, some: SparseBins, f: Array) -> SparseBins:
        """Whitened bins of a test's at f (m,), in the columns that show them: noise has unit power, uncorrelated."""
        factor, (k, count, m) = self.factor[test][:, :, some.columns], some.each.shape
        columns = np.flatnonzero(factor.any(axis=(0, 2)))
        out, first = np.empty((len(columns), count, m), np.complex128), self.starts(f)
        for b, low, high in zip(self.band(f)[first], first, (*first[1:], m), strict=True):
            mixed = factor[b][columns] @ some.each[:, :, low:high].reshape(k, count * (high - low))
            out[:, :, low:high] = mixed.reshape(len(columns), count, high - low)
        return SparseBins(columns, out.reshape(len(columns), *some.bins.shape[1:]))


def _band(edges: Array, f: Array) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(edges, f, side="right") - 1, 0, len(edges) - 2)


def excess(whitener: Whitener, whitened: Sequence[Complex], frequency: Sequence[Array]) -> list[Array]:
    """Power (m, k) of every test's whitened bins over that of noise, by column and band; at least one."""
    found = []
    for bins, f in zip(whitened, frequency, strict=True):
        means, counts = mean_squares(whitener, np.abs(bins) ** 2, f)
        power = (BELIEF + counts[:, None] * np.maximum(1.0, means)) / (BELIEF + counts[:, None])
        found.append(np.repeat(power, counts, axis=0))
    return found


def mean_squares(whitener: Whitener, squares: Array, f: Array) -> tuple[Array, NDArray[np.intp]]:
    """Means (b, k) over bands of squares (m, k) of a test's bins at rising f (m,), and the bins in each band (b,)."""
    first = whitener.starts(f)
    counts = np.diff(first, append=len(f))
    return np.add.reduceat(squares, first, axis=0) / counts[:, None], counts


def negative_log_likelihood(means: Array, counts: NDArray[np.intp]) -> Array:
    """Negative log-likelihood (k,) of bins by their `mean_squares`.

    The residual is modelled as noise of unit power, or, where a band shows more, of a power in between: the stated one
    weighs as `BELIEF` bins. Its derivative by a mean is that of least squares over the power of `excess`.
    """
    more = (BELIEF + counts[:, None] * np.maximum(means, 1.0)) / (BELIEF + counts[:, None])
    return np.asarray(counts @ np.minimum(means, 1.0) + (BELIEF + counts) @ np.log(more))


def make_whitener(
    noise: Sequence[Sequence[Complex]],
    frequency: Sequence[Array],
    edges: Array,
    groups: NDArray[np.int64] | None = None,
    last: Mask | None = None,
) -> Whitener:
    """Whitener from realisations of every test's noise, bins (m, k) at its frequencies (m,).

    Columns are scaled by their noise in that test: friction at rest wanders where a leg hardly slides. Correlations are
    pooled over all tests, and those of means with the first band: one test has too few bins in a band. Columns of
    different `groups` (k,) count as uncorrelated. Each column is mixed with those before it, and the `last` (k,) with
    all others: if these are the ones in which most quantities show, whitened quantities show in few columns.

    Raises RecordError if all together still have too few.
    """
    count, k = len(edges) - 1, noise[0][0].shape[1]
    places = np.arange(k) if last is None else np.argsort(last, kind="stable")
    order = np.ix_(places, places)
    factors = np.zeros((len(noise), count, k, k), np.complex128)
    scaled: list[list[Complex]] = [[] for _ in range(count)]
    for t, (realisations, f) in enumerate(zip(noise, frequency, strict=True)):
        whole = np.where(f > 0.0, 1.0, np.sqrt(2.0))[:, None]  # a mean is real, with half the power of other bins
        band = _band(edges, f)
        for b in range(count):
            rows = np.concatenate([(bins * whole)[band == b] for bins in realisations], dtype=np.complex128)
            if len(rows) == 0:  # the test is shorter than a period of that band
                continue
            power = np.mean(np.abs(rows) ** 2, axis=0) / (1.0 - 2.0 / len(rows))  # its inverse is unbiased
            scale = np.sqrt(np.where(power > 0.0, power, 1.0))
            scaled[b].append(rows / scale)
            factors[t, b] = np.diag(1.0 / scale)
    for b in range(count):
        rows = np.vstack(scaled[b] + (scaled[1] if b == 0 else []))
        if len(rows) <= CERTAIN:  # too few for correlations
            what = f"{len(rows)} samples of the noise between {edges[b]:g} and {edges[b + 1]:g} Hz"
            raise RecordError(f"the tests are too short together: they give {what}; add tests, or longer ones")
        matrix = rows.T @ rows.conj() / len(rows)  # E[x x^H]
        if groups is not None:
            matrix = np.where(groups[:, None] == groups, matrix, 0.0)
        mixed = np.zeros_like(matrix)
        mixed[order] = _uncorrelated(matrix[order], len(rows))
        factors[:, b] = mixed @ factors[:, b]
    return Whitener(edges, factors)


def _uncorrelated(matrix: Complex, count: int) -> Complex:
    """Triangular matrix (k, k) that makes columns of a cross-spectral matrix (k, k) uncorrelated, with unit power.

    Each column is regressed on those before it. Only columns with a significant correlation in `count` samples are
    used: correlations by chance would propagate an error of one kind of residual into all others.
    """
    k = len(matrix)
    out = np.zeros((k, k), np.complex128)
    for i in range(k):
        power = float(matrix[i, i].real)
        left, right = matrix[:i, :i].copy(), matrix[:i, i].copy()  # of columns before, less those that were used
        used: list[int] = []
        while len(used) < i:
            own = left.diagonal().real
            free = own > 1e-9 * matrix.diagonal().real[:i]
            share = np.where(free, np.abs(right) ** 2 / np.where(free, own, 1.0), 0.0) / max(power, 1e-12)
            j = int(np.argmax(share))
            if share[j] * (count - len(used)) < CERTAIN:
                break
            used.append(j)
            power -= float(abs(right[j]) ** 2 / own[j])
            ratio = left[:, j] / own[j]
            right = right - ratio * right[j]
            left = left - np.outer(ratio, left[j])
        power = max(power, 1e-9 * float(matrix[i, i].real)) or 1.0
        weights = np.linalg.solve(matrix[np.ix_(used, used)] + 1e-9 * np.eye(len(used)), matrix[used, i])
        # the residual of a regression is too small in the sample itself
        scale = np.sqrt((1.0 - (len(used) + 1) / count) / power)
        out[i, i] = scale
        out[i, used] = -scale * weights.conj()
    return out
