"""Tests of a campaign that can be compared with a model: not too short nor too slow, no force sensor dead in one alone.

A test that cannot is skipped, with the reason; the others are used, a recording that tripped up to its trip.
"""

import logging
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import xarray as xr

from ...core.errors import RecordError
from ...data.campaign import Campaign, SkippedTest
from ...data.channels import calibrated_channels, columns_of
from ...data.conditioning import resolutions
from ...data.records import is_measured
from ...data.served_samples import part_compared
from .result import calibration_numbers
from .whitened_residuals import spectrum_of

__all__ = ["too_short", "usable_tests"]

log = logging.getLogger(__name__)

_LOADED = ("Pa", "N", "m/s2")
"""Units of sensors that show noise or a load in every test; a position may hold still within its resolution."""

_ALIVE = 100.0
"""Steps of its resolution by which a sensor moves in a test that shows it alive."""


def usable_tests(campaign: Campaign) -> Campaign:
    """The campaign without the tests that cannot be compared, which join its `skipped`; each is logged as a warning.

    Those that tripped are cut there (`part_compared`). Raises RecordError with the first reason if none is left.
    """
    campaign, numbers = campaign._replace(records=tuple(map(part_compared, campaign.records))), calibration_numbers()
    bands, edge = numbers.vector("comparison.bands"), numbers.number("comparison.edge")
    why = [too_short(record, bands, edge) for record in campaign.records]
    long = [record for record, reason in zip(campaign.records, why, strict=True) if not reason]
    why = [reason or _dead(record, long) for record, reason in zip(campaign.records, why, strict=True)]
    names = [str(record.attrs.get("test", f"record {k}")) for k, record in enumerate(campaign.records, start=1)]
    skipped = [SkippedTest(test, reason) for test, reason in zip(names, why, strict=True) if reason]
    if skipped and len(skipped) == len(names):
        raise RecordError(f"no test of {campaign.name} can be used; {skipped[0].test}: {skipped[0].why}")
    for one in skipped:
        log.warning("test %s is skipped: %s", one.test, one.why)
    kept = tuple(record for record, reason in zip(campaign.records, why, strict=True) if not reason)
    return campaign._replace(records=kept, skipped=(*campaign.skipped, *skipped))


def too_short(record: xr.Dataset, bands: Sequence[float], edge: float) -> str:
    """Why a record is too short or slow for the bands [Hz] from one period on, cut at both `edge`s [s]; or empty."""
    n = record.sizes["time"]
    if n < 2:
        return f"{n} sample{'s' * (n != 1)} are no test"
    length = float(record["time"][-1] - record["time"][0])
    dt = length / (n - 1)
    f = np.zeros(0)
    if n > 2 * round(edge / dt):
        f = spectrum_of(np.zeros((n, 1)), dt, bands[0], bands[-1], edge)[1]
    slowest = f[1] if len(f) > 1 else 0.0
    for low, high in pairwise(bands):
        if high > slowest and not np.any((f >= low) & ((f < high) | (f == bands[-1]))):
            return f"{length:.3g} s at {1 / dt:.4g} Hz leave nothing to compare between {low:g} and {high:g} Hz"
    return ""


def _dead(record: xr.Dataset, others: Sequence[xr.Dataset]) -> str:
    """Which sensor of a measured record stays at one value although it moves in other tests; empty if none does."""
    for name, channel in calibrated_channels().items():
        if channel.units.split(",")[0] not in _LOADED or name not in record or not is_measured(record):
            continue
        if not np.ptp(columns_of(record[name]), axis=0).any() and any(_alive(other, name) for other in others):
            return f"{name} stays at one value, though it moves in other tests"
    return ""


def _alive(record: xr.Dataset, name: str) -> bool:
    """Whether a channel moves by far more than its resolution."""
    if name not in record:
        return False
    moved, steps = np.ptp(columns_of(record[name]), axis=0), resolutions(record[name])
    return bool(moved.max() > _ALIVE * steps.max() > 0.0)
