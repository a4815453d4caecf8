"""Metrics of a test: tracking per axis, use of the valves, drift of the platen.

Everything is computed from a record alone (dimensions `time`, `axis`, `actuator`, ...); missing channels
give not-a-number. Axis order x y z roll pitch yaw; SI.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import RecordError
from ..core.extremes import finite_peaks
from ..core.threads import by_threads
from .at_rest import at_rest
from .signals import Band, align, delay_within, rrmse

__all__ = [
    "QUANTITIES",
    "SpoolUse",
    "Tracking",
    "commanded_axes",
    "channel",
    "kinds",
    "labels",
    "drift",
    "peak_window",
    "peaks",
    "sampling",
    "spool_use",
    "track",
]

QUANTITIES = ("displacement", "velocity", "acceleration")
SQUARED = float(np.sqrt(np.finfo(np.float64).tiny))  # smaller values have no representable square
COMMANDED = 1e-3  # an axis is commanded if its peak target is at least this fraction of the largest (1 rad as 1 m)
DRIFT_BAND = 0.2  # [Hz] the displacement error below this frequency is drift
FEWEST = 64  # samples, below which no delay is sought and no tracking judged
LONGEST_DELAY = 0.25  # [s] sought either way; ten times what such a table has
END = 0.5  # [s] the residual offset is the mean error over this last part of the record


@dataclass(frozen=True)
class Tracking:
    """Tracking of one quantity of one axis; not-a-number without a target."""

    axis: str
    place: int  # of the axis in the record's order
    quantity: str
    peak_target: float  # SI
    peak_achieved: float  # SI
    rrmse: float  # as recorded
    delay: float  # [s], positive when the table is late
    rrmse_aligned: float  # after removing the delay
    aligned: Array | None  # (n,) achieved motion with the delay removed, SI


@dataclass(frozen=True)
class SpoolUse:
    """Use of the stroke of a fourth-stage spool."""

    actuator: str
    peak: float  # largest |x|, 1 is the full stroke
    rms: float
    saturated: float  # share of the time at the limit or beyond


def channel(record: xr.Dataset, name: str) -> Array:
    """Return the variable as float64 of shape (n,) or (n, n_axes), (n, n_act), ...."""
    return np.asarray(record[name].transpose("time", ...).values, dtype=np.float64)


def labels(record: xr.Dataset, dim: str) -> list[str]:
    """Return the names of the axes, actuators or other components of a record."""
    return [str(label) for label in record[dim].values]


def kinds(names: Sequence[str]) -> list[list[int]]:
    """Return the places of the components of each kind, by their names less the number: H1 to H4, V1 to V6."""
    places = groupby(range(len(names)), key=lambda k: re.sub(r"\d+$", "", names[k]))
    return [list(own) for _, own in places]


def sampling(record: xr.Dataset) -> tuple[float, float]:
    """Return first time and sample interval [s]; raise `RecordError` if time is missing or not uniform."""
    if "time" not in record.coords or record.sizes["time"] < 2:
        raise RecordError("the record holds no time series: it needs a coordinate `time` of two samples or more")
    time = np.asarray(record["time"].values, dtype=np.float64)
    step = (time[-1] - time[0]) / (len(time) - 1)
    uneven = np.flatnonzero(~(np.abs(np.diff(time) - step) <= 0.01 * abs(step)))  # catches NaN as well
    if step <= 0.0 or len(uneven):
        where = int(uneven[0]) if len(uneven) else 0
        raise RecordError(
            f"`time` is not uniform: sample {where + 1} follows at an uneven interval; resample the record"
        )
    return float(time[0]), float(step)


def commanded_axes(record: xr.Dataset) -> list[str]:
    """Return the names of the commanded axes; without a target, of those that moved."""
    name = "reference_displacement" if "reference_displacement" in record else "platen_displacement"
    if name not in record:
        return []
    motion = channel(record, name)
    size = np.nan_to_num(peaks(motion - motion[0]))
    commanded = (size > COMMANDED * size.max()) & ~at_rest(motion - motion[0], place=True)
    return [axis for axis, moves in zip(labels(record, "axis"), commanded, strict=True) if moves]


def track(record: xr.Dataset, quantity: str, *, errors: bool = True) -> list[Tracking]:
    """Return the tracking of `quantity` on every axis; empty if the record has no such motion.

    A delay is not-a-number where its removal does not reduce the error, or where it is at the end of the range in which
    it is sought. Without `errors` only peaks are evaluated, not RRMSE and delay, which take far longer.
    """
    if f"platen_{quantity}" not in record:
        return []
    _, step = sampling(record)
    achieved = channel(record, f"platen_{quantity}")
    known = f"reference_{quantity}" in record
    target = channel(record, f"reference_{quantity}") if known else np.full_like(achieved, np.nan)
    commanded = commanded_axes(record) if known and errors and len(achieved) >= FEWEST else []
    longest = min(LONGEST_DELAY, len(achieved) * step / 8.0)
    names = labels(record, "axis")

    def tracking(k: int) -> Tracking:
        whole, late, without, shifted = np.nan, np.nan, np.nan, None
        if names[k] in commanded and np.isfinite(achieved[:, k]).all() and np.abs(target[:, k]).max() > SQUARED:
            whole = float(rrmse(target[:, k], achieved[:, k]))
            late = float(delay_within(target[:, k], achieved[:, k], step, longest))
            shifted = align(achieved[:, k], late, step) if np.isfinite(late) else achieved[:, k]
            without = float(rrmse(target[:, k], shifted))
            if without > whole:  # the motion differs by more than a delay, as one that is cut off in full shaking
                late, shifted, without = np.nan, achieved[:, k], whole
        wanted, reached = float(peaks(target[:, k])), float(peaks(achieved[:, k]))
        return Tracking(names[k], k, quantity, wanted, reached, whole, late, without, shifted)

    return list(by_threads(tracking, range(len(names))))


def spool_use(record: xr.Dataset) -> list[SpoolUse]:
    """Return the use of every spool, by its feedback or else its command; empty without either."""
    name = next((name for name in ("spool_position", "spool_command") if name in record), None)
    if name is None:
        return []
    x = channel(record, name)
    x = np.where(np.isfinite(x), x, 0.0)
    columns = peaks(x), np.sqrt(np.mean(x**2, axis=0)), np.mean(np.abs(x) >= 1.0, axis=0)
    return [SpoolUse(*one) for one in zip(labels(record, "actuator"), *(c.tolist() for c in columns), strict=True)]


def drift(record: xr.Dataset) -> tuple[Array, float, Array] | None:
    """Return the slow part of the displacement error, achieved minus target, or nothing where it is not finite.

    The error (n, n_axes) low-passed, SI; the frequency below which it is slow [Hz]; and the mean unfiltered error
    (n_axes,) over the end of the record.
    """
    _, step = sampling(record)
    error = channel(record, "platen_displacement") - channel(record, "reference_displacement")
    if not np.isfinite(error).all():
        return None
    cutoff = min(max(DRIFT_BAND, 2.0 / (len(error) * step)), 0.4 / step)  # two periods at least fit in the record
    offset = error[-max(int(END / step), 1) :].mean(axis=0)
    return Band(high=cutoff, order=4).apply(error, step), cutoff, offset


def peaks(values: Array) -> Array:
    """Greatest finite |value| of each column (n, ...) -> (...); not-a-number for a column without any."""
    size = finite_peaks(values)
    return np.where(size >= 0.0, size, np.nan)


def peak_window(values: Array, step: float, duration: float) -> tuple[int, int] | None:
    """First and last sample of the `duration` [s] around the peak of (n,); nothing if the record is hardly longer."""
    n, length = len(values), int(duration / step)
    if n <= 2 * length:
        return None
    values = np.nan_to_num(values)
    peak = int(np.abs(values - values.mean()).argmax())
    first = min(max(peak - length // 2, 0), n - length)
    return first, first + length
