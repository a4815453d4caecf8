"""What of a record was not measured: interpolated samples (`fill_gaps`) and constants of a map.

No sensor is judged by them.
"""

import re

import numpy as np
import xarray as xr

from ..core.arrays import Mask

__all__ = ["CONSTANT", "FILLED", "filled_samples", "longest_measured", "stated_constants", "stated_runs"]

CONSTANT = "constant"
"""Attribute of a record: channels, as `platen_acceleration[roll]`, that a map gives as constants, behind a colon."""

FILLED = "filled_samples"
"""Attribute of a record: runs of interpolated samples, as in `100 from 3000, 5 from 4000`."""


def stated_runs(filled: Mask) -> str:
    """Runs of a mask (n,) as `FILLED` states them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], filled, [False]])))
    return ", ".join(f"{b - a} from {a}" for a, b in edges.reshape(-1, 2).tolist())


def filled_samples(record: xr.Dataset) -> Mask:
    """Samples (n,) that are interpolated."""
    mask = np.zeros(record.sizes.get("time", 0), bool)
    for count, first in re.findall(r"(\d+) from (\d+)", str(record.attrs.get(FILLED, ""))):
        mask[int(first) : int(first) + int(count)] = True
    return mask


def longest_measured(record: xr.Dataset) -> slice:
    """The longest run of samples without interpolated ones; all where there are none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], filled_samples(record), [True]])))
    runs = edges.reshape(-1, 2)
    return slice(*runs[np.argmax(np.diff(runs, axis=1))].tolist()) if len(runs) else slice(None)


def stated_constants(record: xr.Dataset) -> frozenset[str]:
    """Channels of a record that are constants of its map, as `platen_acceleration[roll]`."""
    names = str(record.attrs.get(CONSTANT, "")).partition(": ")[2]
    return frozenset(names.split(", ")) if names else frozenset()
