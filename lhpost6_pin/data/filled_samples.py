"""What of a record was not measured: interpolated samples (`fill_gaps`) and constants of a map.

No sensor is judged by them.
"""

import logging
import re

import numpy as np
import xarray as xr

from ..core.arrays import Mask

__all__ = ["CONSTANT", "FILLED", "between_gaps", "filled_samples", "longest_measured", "stated_constants"]
__all__ += ["stated_runs"]

log = logging.getLogger(__name__)

LONGEST_FILLED = 0.04
"""Gap [s] whose interpolation is as good as measured in the bands compared, up to half a period of 12 Hz."""

CONSTANT = "constant"
"""Attribute of a record: channels, as `platen_acceleration[roll]`, that a map gives as constants, behind a colon."""

FILLED = "filled_samples"
"""Attribute of a record: runs of interpolated samples, as in `100 from 3000, 5 from 4000`."""


def stated_runs(filled: Mask) -> str:
    """Runs of a mask (n,) as `FILLED` states them."""
    return ", ".join(f"{last - first} from {first}" for first, last in _runs(filled))


def filled_samples(record: xr.Dataset) -> Mask:
    """Samples (n,) that are interpolated."""
    mask = np.zeros(record.sizes.get("time", 0), bool)
    for count, first in re.findall(r"(\d+) from (\d+)", str(record.attrs.get(FILLED, ""))):
        mask[int(first) : int(first) + int(count)] = True
    return mask


def between_gaps(record: xr.Dataset) -> xr.Dataset:
    """The longest stretch of a record without a gap that is too long to be interpolated, as its attribute `gap` says.

    The cut is logged as a warning with the test's name.
    """
    filled = filled_samples(record)
    if not filled.any():
        return record
    time = record["time"].values
    most = LONGEST_FILLED * (len(time) - 1) / (time[-1] - time[0])
    gap = np.zeros(len(time), bool)
    for first, last in _runs(filled):
        gap[first:last] = last - first > most
    if not gap.any():
        return record
    part = _longest(~gap)
    lost = f"{int(gap.sum())} samples are interpolated, in gaps of more than {LONGEST_FILLED:g} s"
    kept = f"{lost}: only {time[part][0]:.5g} to {time[part][-1]:.5g} s, the longest stretch between them, are used"
    log.warning("test %s: %s", record.attrs.get("test", "test"), kept)
    cut = record.isel(time=part).assign_attrs({"gap": kept, FILLED: stated_runs(filled[part])})
    cut.encoding = dict(record.encoding)  # with the file's name
    return cut


def longest_measured(record: xr.Dataset) -> slice:
    """The longest run of samples without interpolated ones; all where there are none."""
    return _longest(~filled_samples(record))


def _longest(kept: Mask) -> slice:
    """The longest run of a mask; all where it has none."""
    return slice(*max(_runs(kept), key=lambda run: run[1] - run[0], default=(None, None)))


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """Runs (first, one past the last) of a mask (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [(first, last) for first, last in edges.reshape(-1, 2).tolist()]


def stated_constants(record: xr.Dataset) -> frozenset[str]:
    """Channels of a record that are constants of its map, as `platen_acceleration[roll]`."""
    names = str(record.attrs.get(CONSTANT, "")).partition(": ")[2]
    return frozenset(names.split(", ")) if names else frozenset()
