"""Columns of a record that are equal at every sample: one column of a file that was mapped to two channels.

Two sensors never agree to the last bit, noise included, however symmetric the motion. Simulated records without noise
may, and are left out.
"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np
import xarray as xr

from .channels import LAYOUT, channel_name, channel_unit, columns_of
from .records import is_measured
from .rests import rest_numbers

__all__ = ["repeated_columns"]

_SHARED = (
    ("platen_displacement", "actuator_displacement"),
    ("platen_acceleration", "point_acceleration", "floor_acceleration"),
)
"""Variables that one sensor may serve together, as the displacement of a table with one actuator."""

_Warning = tuple[str, int | None, str, str]  # channel, sample, message, remedy


def repeated_columns(record: xr.Dataset) -> Iterator[_Warning]:
    """Channel, sample, message and remedy of every sensor's column that equals an earlier one, but for its sign.

    Compared are columns of the layout in the same unit that vary; two commands may be equal.
    """
    if not is_measured(record):
        return
    least = rest_numbers().number("repeated.changes")
    alike: dict[tuple[str, bytes], list[tuple[str, float]]] = {}  # names with the sign of each
    for name in (name for name in LAYOUT if name in record):
        for k, x in enumerate(columns_of(record[name]).T):
            changes = np.flatnonzero(np.diff(x))
            if len(changes) >= least:
                channel = channel_name(record[name], k)
                sign = float(np.sign(x[np.flatnonzero(x)[0]]))
                key = channel_unit(channel), (x * sign + 0.0).tobytes()  # + 0.0: no zero is negative
                alike.setdefault(key, []).append((channel, sign))
    for same in alike.values():
        found: set[str] = set()
        for (one, sign), (other, turned) in combinations(same, 2):
            if other not in found and _differ(one, other):
                found.add(other)
                sided = "" if sign == turned else ", but for the sign"
                what = f"is the same as {one} at every sample{sided}: one column of the file for two channels?"
                yield other, None, what, "correct the column of the wrong one in the channel map, and import again"


def _differ(one: str, other: str) -> bool:
    """Whether two channels have a sensor each: not both a command, and not both what one sensor may serve."""
    names = [channel.partition("[")[0] for channel in (one, other)]
    if all(LAYOUT[name].role == "command" for name in names):
        return False
    return names[0] == names[1] or not any(set(names) <= set(shared) for shared in _SHARED)
