"""Samples of a recording of a served plant that show no sensor: unanswered ones, and those of its safe hold.

A sample that the controller did not answer repeats the row before it, in all channels. In its safe hold, as after a
trip, the plant moves its valves by itself, to where they stay: what follows a trip is not the test's.
"""

import logging
import re
from collections.abc import Iterator

import numpy as np
import xarray as xr

from ..core.arrays import Mask
from .filled_samples import between_gaps

__all__ = ["ANSWERED", "PLANT_STATE", "SAFE_HOLD", "answered_samples", "cut_notes", "judged_samples", "part_compared"]
__all__ += ["served_findings"]

log = logging.getLogger(__name__)

ANSWERED, PLANT_STATE = "answered", "plant_state"
"""Channels of such a recording: whether the controller answered a sample, and the state of the plant."""

SAFE_HOLD = 2  # state, as `interfaces.link.PlantState`


_TRIP = re.compile(r"tripped (?:at (?P<time>[\d.]+) s|before the recording began)")
"""Beginning of the attribute `trouble` of a recording that tripped; its time is that of the record."""


def part_compared(record: xr.Dataset) -> xr.Dataset:
    """The part of a record that is compared: up to its trip, with its time and reason as attribute `cut`, else all.

    Of one that tripped before it began the first two samples are left, which are too short for all; of one with long
    gaps the longest stretch between them (`between_gaps`). Cuts are logged as warnings with the test's name.
    """
    return between_gaps(_up_to_trip(record))


def _up_to_trip(record: xr.Dataset) -> xr.Dataset:
    trouble = str(record.attrs.get("trouble", "none"))
    trip = _TRIP.match(trouble)
    if trip is None or "time" not in record:
        return record
    time = record["time"].values
    count = max(2, int(np.searchsorted(time - time[:1], float(trip["time"] or 0.0))))  # a record has two at least
    if count >= len(time):
        return record
    cut = f"{trouble}; what follows, {len(time) - count} of {len(time)} samples, is left out"
    log.warning("test %s %s", record.attrs.get("test", "test"), cut)
    part = record.isel(time=slice(0, count)).assign_attrs(cut=cut)
    part.encoding = dict(record.encoding)  # with the file's name
    return part


def cut_notes(record: xr.Dataset) -> tuple[str, ...]:
    """When and why a record was cut by `part_compared`, as notes; none where it was not."""
    cut, gap = (str(record.attrs.get(name, "")) for name in ("cut", "gap"))
    return (*((cut,) if _TRIP.match(cut) else ()), *((gap,) if gap else ()))


def answered_samples(dataset: xr.Dataset) -> Mask:
    """Samples (n,) that the controller answered; all where a record does not state it."""
    return np.asarray(_row(dataset, ANSWERED, 1) != 0)


def judged_samples(dataset: xr.Dataset) -> Mask:
    """Samples (n,) that sensors are judged by: answered, and not of a safe hold; all where a record states neither."""
    return answered_samples(dataset) & (_row(dataset, PLANT_STATE, 0) != SAFE_HOLD)


def served_findings(dataset: xr.Dataset) -> Iterator[tuple[str, int | None, str, str]]:
    """Channel, sample, message and remedy: unanswered samples, and what the record states as its trouble."""
    missed = ~answered_samples(dataset)
    if missed.any():
        count = int(missed.sum())
        what = f"{count} sample{'s'[: count != 1]} without an answer of the controller (`{ANSWERED}`)"
        yield "", int(missed.argmax()), what, "all channels repeat the sample before"
    trouble = str(dataset.attrs.get("trouble", "none"))
    if trouble not in ("none", ""):
        yield "", None, trouble, "what follows is not the test's"


def _row(dataset: xr.Dataset, name: str, usual: int) -> np.ndarray:
    """A channel (n,) of numbers; the usual one where the record has none."""
    if name in dataset and dataset[name].dims == ("time",) and dataset[name].dtype.kind in "biuf":
        return np.asarray(dataset[name].values)
    return np.full(dataset.sizes["time"], usual)
