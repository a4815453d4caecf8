"""Residuals in the frequency domain, whitened by the noise that sensors leave in them.

A discrete Fourier transform over a whole test is one zero-phase filter for everything that is compared: bins within
the band count, the others do not. There stationary noise is independent from bin to bin, so that least squares with
its cross-spectral matrix per band of frequencies is the best linear estimate, and its inverse normal matrix the
covariance.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Whitener", "make_whitener", "spectrum_of"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def spectrum_of(x: Array, dt: float, low: float, high: float, edge: float) -> tuple[Complex, Array]:
    """Bins (m, k) of columns (n, k) from `low` to `high` [Hz], `edge` [s] cut off at both ends, and their frequencies.

    Scaled so that noise of one-sided spectrum S has E|X|^2 = S; the mean, which is real, so that E X^2 = S / 2.
    """
    from scipy import fft

    cut = round(edge / dt)
    n = fft.prev_fast_len(len(x) - 2 * cut, real=True)
    f = fft.rfftfreq(n, dt)
    inside = (f >= low) & (f <= high)
    out = fft.rfft(x[cut : cut + n], axis=0)[inside] * np.sqrt(2.0 * dt / n)
    out[f[inside] == 0.0] /= np.sqrt(2.0)
    return out, f[inside]


class Whitener(NamedTuple):
    """Inverse Cholesky factors (b, k, k) of the noise's cross-spectral matrices in bands between `edges` (b + 1,)."""

    edges: Array
    factor: Complex

    def apply(self, bins: Complex, f: Array) -> Complex:
        """Whitened bins, shape (m, k, p) of `bins` at f (m,): noise in them has unit power, uncorrelated."""
        out = np.empty_like(bins)
        band = np.clip(np.searchsorted(self.edges, f, side="right") - 1, 0, len(self.factor) - 1)
        for b in np.unique(band):
            part = bins[band == b]
            mixed = self.factor[b] @ part.swapaxes(0, 1).reshape(part.shape[1], -1)
            out[band == b] = mixed.reshape(part.shape[1], part.shape[0], -1).swapaxes(0, 1)
        return out


def make_whitener(noise: Sequence[tuple[Complex, Array]], edges: Array) -> Whitener:
    """Whitener from realisations of the noise: bins (m, k) and their frequencies (m,)."""
    k = noise[0][0].shape[1]
    factors = np.zeros((len(edges) - 1, k, k), np.complex128)
    for b in range(len(edges) - 1):
        top = np.inf if b == len(edges) - 2 else edges[b + 1]
        inside = [bins[(f >= edges[b]) & (f < top) & (f > 0.0)] for bins, f in noise]
        rows = np.vstack(inside)
        matrix = rows.conj().T @ rows / len(rows)
        matrix = matrix.T  # E[x x^H]
        scale = np.sqrt(np.real(np.diag(matrix)))
        scale = np.where(scale > 0.0, scale, 1.0)
        normed = matrix / np.outer(scale, scale) + 1e-9 * np.eye(k)
        # the inverse of a matrix that was estimated from n samples is too large by n / (n - k)
        factors[b] = np.linalg.inv(np.linalg.cholesky(normed)) / scale * np.sqrt(1.0 - k / len(rows))
    return Whitener(edges, factors)
