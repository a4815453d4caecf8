"""Blocks in time of the tests that are searched, where these are few.

Cross-validation leaves one test out. With one test or two it has nothing to compare: an error of one sensor's clock in
one test is as consistent as an effect. Each is then cut into blocks, which are searched like tests. States with a long
memory (warm friction, leaking gas) start anew in every block, so that these effects need more tests to be found.
"""

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np
import xarray as xr

from ..identification.calibration.usable_tests import too_short
from ..machine.parameters import Parameters

__all__ = ["in_blocks"]


def in_blocks(
    records: Sequence[xr.Dataset], held: Collection[int], numbers: Parameters, calibration: Parameters
) -> tuple[list[xr.Dataset], tuple[int, ...]]:
    """Records, those searched cut into blocks if they are few; and the places of those `held` out.

    numbers are those of `models/procedures/discovery.toml`, calibration those of `calibration.toml`.
    """
    few = len(records) - len(held) < int(numbers.number("few.tests"))
    out: list[xr.Dataset] = []
    places = []
    for i, record in enumerate(records):
        if i in held:
            places.append(len(out))
        out += _blocks(record, numbers, calibration) if few and i not in held else [record]
    return out, tuple(places)


def _blocks(record: xr.Dataset, numbers: Parameters, calibration: Parameters) -> list[xr.Dataset]:
    """Blocks of a record, all long enough; the record itself where they would be too short."""
    count, time = int(numbers.number("few.blocks")), record["time"].values
    bands, edge = calibration.vector("comparison.bands"), calibration.number("comparison.edge")
    ends = np.linspace(0, len(time), count + 1).astype(int)
    blocks = [record.isel(time=slice(a, b)) for a, b in pairwise(ends.tolist())]
    short = (time[-1] - time[0]) / count < numbers.number("few.shortest")
    if short or any(too_short(block, tuple(bands), edge) for block in blocks):
        return [record]
    name = record.attrs.get("test", "test")
    return [b.assign_attrs(test=f"{name}, block {k} of {count}") for k, b in enumerate(blocks, start=1)]
