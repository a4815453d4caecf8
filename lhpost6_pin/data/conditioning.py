"""Making a measured channel fit to be used: offsets, gaps, resolution, integrals. Time runs along the first axis."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import RecordError

__all__ = ["WIDTHS", "fill_gaps", "integrate", "quieted", "resolution", "without_offset"]

Array = NDArray[np.float64]


def without_offset(x: ArrayLike, rest: slice) -> Array:
    """Signal less its mean over the samples `rest`, per column; raises ValueError if there are none."""
    x = np.asarray(x, dtype=float)
    if not len(x[rest]):
        raise ValueError(f"no samples at rest in {rest} of {len(x)}")
    return x - x[rest].mean(axis=0)


def resolution(x: ArrayLike) -> float:
    """Smallest step of a channel: its digital resolution, or nearly nothing for a computed one; 0 if it holds still."""
    steps = np.abs(np.diff(np.asarray(x, dtype=float), axis=0))
    least = float(steps[steps > 0].min(initial=np.inf))
    return least if np.isfinite(least) else 0.0


def fill_gaps(x: ArrayLike, dt: float, most: float, name: str = "signal") -> Array:
    """Fill runs of samples that are not finite, up to `most` [s] long, by Akima's piecewise cubic through the others.

    Raises `RecordError` naming channel (`name` and column) and first sample of a longer run, or of one that reaches
    an end of the record: there is nothing to interpolate from.
    """
    from scipy.interpolate import Akima1DInterpolator

    x = np.array(x, dtype=float)
    columns = x.reshape(len(x), -1)  # a view: filling it fills x
    for k in np.flatnonzero(~np.isfinite(columns).all(axis=0)):
        good = np.isfinite(columns[:, k])
        edges = np.flatnonzero(np.diff(np.concatenate([[True], good, [True]]).astype(int)))
        for first, end in edges.reshape(-1, 2):
            at_end = first == 0 or end == len(x)
            if at_end or (end - first) * dt > most * (1 + 1e-9):
                why = "at an end of the record" if at_end else f"longer than {most:g} s"
                channel = name if x.ndim == 1 else f"{name}[{k}]"
                what = f"{channel}: {end - first} samples missing from sample {first}, {why}"
                raise RecordError(f"{what}; cut the record there")
        at = np.flatnonzero(good)
        columns[~good, k] = Akima1DInterpolator(at, columns[at, k])(np.flatnonzero(~good))
    return x


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
    """
    from scipy.interpolate import make_interp_spline

    x = np.asarray(x, dtype=float)
    t = dt * np.arange(len(x))
    spline = make_interp_spline(t, x, k=5)
    return spline.antiderivative(1)(t), spline.antiderivative(2)(t)
