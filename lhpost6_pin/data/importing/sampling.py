"""From time stamps as they were written to uniform samples: rounded stamps, gaps, holes, and a common rate."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array
from ...core.errors import RecordError
from ...core.rounding import rounding_of
from ..layout_faults import STEP_TOLERANCE
from ..signals import lowpass_zero_phase, resample_band_limited

__all__ = ["Sampling", "common_time", "fill_holes", "resample", "uniform"]

Indices = NDArray[np.intp]

_SAME_TIME = 1e-6  # of one sample: two clocks that differ by less are the same
_ANTI_ALIAS = (0.4, 16)  # cutoff of the new rate, order: 1 % lost at 0.3 of the rate, 0.2 % left at 0.6
_MOST = 2**24  # samples: more than two hours at 2048 Hz
_LONGEST = 1e12  # [s]: seconds since any usual epoch are far fewer


class Sampling(NamedTuple):
    """Uniform times [s], which of them each sample of the file belongs to, and runs (first, count) with no sample."""

    time: Array  # (m,)
    place: Indices  # (n,)
    gaps: tuple[tuple[int, int], ...] = ()

    @property
    def step(self) -> float:
        """Sample interval [s]."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)


def uniform(time: Array, most_missing: int, where: str) -> Sampling:
    """Uniform times that the stamps `time` (n,) [s] stand for.

    Stamps may be off their place by 1 % of a sample, or by their rounding to decimals, digits or single precision. Gaps
    of up to `most_missing` samples are allowed. Raises RecordError naming the sample of anything else.
    """
    usable = np.abs(time) < _LONGEST
    if not usable.all():
        k = int(np.argmin(usable))
        raise RecordError(f"{where}, time, sample {k}: {time[k]:g} is no time in seconds; cut the file there")
    diff = np.diff(time)
    if (diff <= 0).any():
        k = int(np.argmax(diff <= 0)) + 1
        what = f"does not increase: {time[k]:.9g} s after {time[k - 1]:.9g} s"
        raise RecordError(f"{where}, time, sample {k}: {what}; sort the rows or cut the file there")
    usual = float(np.median(diff))
    if (np.abs(diff - usual) <= STEP_TOLERANCE * usual).all():
        return Sampling(time, np.arange(len(time)))
    steps = diff / float(np.mean(diff[diff < 1.5 * usual]))  # rounded stamps have steps of two sizes
    lost = np.maximum(np.rint(steps), 1) - 1
    if (lost > most_missing).any():
        k, count = int(np.argmax(lost > most_missing)), f"{lost.max():.0f}"
        raise RecordError(
            f"{where}, time, sample {k + 1}: {lost[k]:.0f} samples are missing between {time[k]:.9g} s and "
            f"{time[k + 1]:.9g} s; cut the file there, or set fill_gaps = {count} in [test] of the map to interpolate "
            "them: they are not measured then, and no sensor is judged by them"
        )
    if lost.sum() + len(time) > _MOST:
        raise RecordError(f"{where}, time: its gaps are {lost.sum():.3g} samples long; cut the file at the longest")
    place = np.concatenate([[0], np.cumsum(lost + 1)]).astype(np.intp)
    step, start = np.polyfit(place, time - time[0], 1)
    off = np.abs(time - time[0] - start - step * place)
    beyond = off - np.maximum(STEP_TOLERANCE * step, rounding_of(time))
    if (beyond > 0).any():
        k = int(np.argmax(beyond))
        raise RecordError(
            f"{where}, time, sample {k}: {time[k]:.9g} s is {off[k] / step:.2g} of a sample off its place at "
            f"{1 / step:.6g} Hz; resample the file to a uniform rate"
        )
    gaps = tuple((int(place[k]) + 1, int(lost[k])) for k in np.flatnonzero(lost))
    return Sampling(time[0] + start + step * np.arange(place[-1] + 1), place, gaps)


def fill_holes(values: Array, most: int, where: str) -> tuple[Array, tuple[tuple[int, int], ...]]:
    """Interpolate runs of at most `most` samples that are no numbers; returns values (n,), runs (first, count).

    The cubic spline through all other samples. Raises RecordError naming the first sample of a longer run, or of one
    at either end.
    """
    hole = ~np.isfinite(values)
    if not hole.any():
        return values, ()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], hole, [False]])))
    runs = tuple((int(a), int(b - a)) for a, b in edges.reshape(-1, 2))
    for first, count in runs:
        if first == 0 or first + count == len(values):
            what = f"{count} samples at the {'end' if first else 'start'} are not numbers"
            raise RecordError(f"{where}, sample {first}: {what}; cut the file there, or leave the channel out")
        if count > most:
            raise RecordError(
                f"{where}, sample {first}: {count} samples are not numbers; set fill_gaps = {count} in [test] of the "
                "map to interpolate them, or leave the channel out"
            )
    from scipy.interpolate import CubicSpline

    known = np.flatnonzero(~hole)
    filled = values.copy()
    filled[hole] = CubicSpline(known, values[known])(np.flatnonzero(hole))
    return filled, runs


def common_time(samplings: Sequence[Sampling], rate: float | None, where: str) -> Array:
    """Times [s] at `rate` [Hz], or the highest rate there is, over the stretch that all samplings have.

    Raises RecordError if there is none.
    """
    if len(samplings) == 1 and rate is None:
        return samplings[0].time
    fastest = min(samplings, key=lambda s: s.step)
    step = 1.0 / rate if rate else fastest.step
    start, end = max(float(s.time[0]) for s in samplings), min(float(s.time[-1]) for s in samplings)
    count = int(np.floor((end - start) / step + _SAME_TIME)) + 1
    if count > max(_MOST, *(len(s.time) for s in samplings)):
        raise RecordError(f"{where}: {count:.3g} samples at {1 / step:g} Hz are too many; choose a lower rate")
    if count < 2:
        spans = ", ".join(f"{s.time[0]:g} to {s.time[-1]:g} s" for s in samplings)
        raise RecordError(f"{where}: the files do not overlap in time: {spans}; give files of one test")
    grid = start + step * np.arange(count, dtype=np.float64)
    for sampling in samplings:  # a clock that fits is kept to the last bit
        k = int(np.argmin(np.abs(sampling.time - start)))
        own = sampling.time[k : k + count]
        if len(own) == count and np.abs(own - grid).max() < STEP_TOLERANCE * step:
            return own
    return grid


def resample(values: Array, sampling: Sampling, time: Array) -> Array:
    """Values (m,) of a sampling at other times; before a lower rate, without phase, a low-pass."""
    k = int(np.argmin(np.abs(sampling.time - time[0])))
    own = sampling.time[k : k + len(time)]
    if len(own) == len(time) and np.abs(own - time).max() <= _SAME_TIME * sampling.step:
        return values[k : k + len(time)]
    step = float(time[-1] - time[0]) / (len(time) - 1)
    if step > sampling.step * (1 + _SAME_TIME):
        cutoff, order = _ANTI_ALIAS
        values = lowpass_zero_phase(values, sampling.step, cutoff / step, order)
    return resample_band_limited(values, sampling.time, time)
