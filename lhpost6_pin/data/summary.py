"""One line for each test of a campaign: duration, sampling rate, channels, peak motions."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import xarray as xr

from .metrics import QUANTITIES, channel, labels, peaks, sampling

__all__ = ["RecordSummary", "summarise_records"]


class RecordSummary(NamedTuple):
    """What a test is, from its record alone."""

    test: str
    seconds: float
    rate_hz: float
    channels: int  # columns along time
    peaks: Mapping[str, Mapping[str, float]]  # largest |platen motion| by quantity and axis, SI
    cut: str = ""  # that a simulated test ends in motion, without the rest that a real one needs


def summarise_records(records: Sequence[xr.Dataset]) -> tuple[RecordSummary, ...]:
    """Summaries of records, in their order; motions that a record lacks are omitted."""
    found = []
    for record in records:
        _, step = sampling(record)
        motions = {
            quantity: dict(zip(labels(record, "axis"), peaks(channel(record, name)).tolist(), strict=True))
            for quantity in QUANTITIES
            if (name := f"platen_{quantity}") in record
        }
        columns = [v for v in record.data_vars.values() if v.dims[:1] == ("time",) and v.dtype.kind in "fiu"]
        count = sum(v[0].size for v in columns)
        seconds = step * (record.sizes["time"] - 1)
        found.append(
            RecordSummary(
                *(str(record.attrs.get("test", "")), seconds, float(f"{1 / step:.6g}"), count, motions),
                cut=str(record.attrs.get("cut", "")),
            )
        )
    return tuple(found)
