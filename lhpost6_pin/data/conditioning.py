"""Conditioning of measured channels: resolution, smoothing at rest, integrals. Time runs along the first axis."""

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..core.arrays import Array
from .channels import columns_of, kinds_of

__all__ = ["WIDTHS", "integrate", "quieted", "resolution", "resolutions"]


def resolution(x: ArrayLike) -> float:
    """Smallest step of a channel: its digital resolution, near zero for a computed one; 0 if it is constant."""
    steps = np.abs(np.diff(np.asarray(x, dtype=float), axis=0))
    least = float(steps[steps > 0].min(initial=np.inf))
    return least if np.isfinite(least) else 0.0


def resolutions(variable: xr.DataArray) -> Array:
    """Digital resolution (k,) of each column of a variable: of translations, of rotations, or of all alike."""
    x = columns_of(variable)
    steps = np.empty(x.shape[1])
    for kind in kinds_of(variable):
        steps[kind] = resolution(x[:, kind])
    return steps


WIDTHS = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64)
"""Standard deviations [s] of the smoothing windows of `quieted`: from the noise's own pace to long rests."""

_NOISE = 5.0
"""Standard deviations of noise that smoothing may take away: rarely exceeded by chance, small beside what moves."""


def quieted(x: ArrayLike, noise: ArrayLike, dt: float) -> Array:
    """Signals (n, k) smoothed wherever only noise is lost: at rest they hardly move, elsewhere they are as given.

    Every sample has the widest of the Gaussian-like windows `WIDTHS` up to which each, all around the sample, changes
    what the one before it left by no more than noise (as in Lepski's choice of a bandwidth, Theory Probab. Appl. 35,
    1991). noise (len(WIDTHS), k) is the standard deviation of what each window takes of it beyond the one before.
    """
    from scipy.ndimage import minimum_filter1d, uniform_filter1d

    last = np.asarray(x, dtype=float)
    out, quiet = last.copy(), np.ones(last.shape, dtype=bool)
    for width, most in zip(WIDTHS, _NOISE * np.asarray(noise, dtype=float), strict=True):
        box = 2 * round(width / dt) + 1  # three of them have the standard deviation `width`, nearly
        smooth = np.asarray(x, dtype=float)
        for _ in range(3):
            smooth = uniform_filter1d(smooth, box, axis=0, mode="nearest")
        quiet &= minimum_filter1d(np.abs(smooth - last) <= most, 2 * box - 1, axis=0)
        out = np.where(quiet, smooth, out)
        last = smooth
    return out


def integrate(x: ArrayLike, dt: float) -> tuple[Array, Array]:
    """First and second time integral [unit of x * s, * s2] of sampled signals, both zero at the first sample.

    Those of the quintic spline through the samples: wrong by 1e-6 of the amplitude at a tenth of the sampling rate.
    Through fewer than six samples it is the polynomial.
    """
    from scipy.interpolate import make_interp_spline

    x = np.asarray(x, dtype=float)
    t = dt * np.arange(len(x))
    spline = make_interp_spline(t, x, k=min(5, len(x) - 1))
    return spline.antiderivative(1)(t), spline.antiderivative(2)(t)
