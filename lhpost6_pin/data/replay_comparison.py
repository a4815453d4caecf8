"""A replayed test against the recorded one, channel by channel."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from .at_rest import at_rest
from .channels import LAYOUT, channel_unit
from .metrics import commanded_axes
from .signals import drift_rate, rrmse

__all__ = ["Compared", "Paired", "compare", "paired"]

_COMPARED = ("platen_displacement", "chamber_pressure_a", "chamber_pressure_b", "actuator_force")


class Paired(NamedTuple):
    """A variable of both records on the samples of the recorded one."""

    name: str
    columns: tuple[str, ...]
    recorded: Array  # (n, n_columns)
    model: Array


class Compared(NamedTuple):
    """Difference of a replayed channel from the recorded one, in `unit`."""

    channel: str
    unit: str
    peak_recorded: float
    largest_difference: float
    rrmse: float  # not-a-number for a channel at rest, of displacements for an axis that is not commanded
    drift: float  # of the difference [unit/s]


def paired(measured: xr.Dataset, simulated: xr.Dataset, names: Sequence[str]) -> list[Paired]:
    """Variables that both records have, up to the end of the simulated one; none below two common samples."""
    t = measured["time"].values - float(measured["time"][0])
    t = t[t <= simulated["time"].values[-1]]
    found: list[Paired] = []
    for name in names if len(t) > 1 else ():
        if name in measured and name in simulated:
            dim = LAYOUT[name].dims[1]
            recorded = measured[name].transpose("time", dim).values[: len(t)]
            model = simulated[name].interp(time=t).transpose("time", dim).values
            found.append(Paired(name, tuple(map(str, measured[dim].values)), recorded, model))
    return found


def compare(measured: xr.Dataset, simulated: xr.Dataset) -> list[Compared]:
    """Differences of a replayed test from the recorded one by channel, on common samples; empty below two.

    Axes at rest in the target (`commanded_axes`) have no RRMSE, as in a run: theirs is over noise and cross-coupling.
    """
    found, commanded = [], commanded_axes(measured)
    for pair in paired(measured, simulated, _COMPARED):
        step = float(measured["time"][1] - measured["time"][0])
        apart, peak = np.abs(pair.model - pair.recorded).max(axis=0), np.abs(pair.recorded).max(axis=0)
        ratio, drift = rrmse(pair.recorded, pair.model), drift_rate(pair.model - pair.recorded, step)
        still = at_rest(pair.recorded)
        if pair.name == "platen_displacement":
            still = np.array([axis not in commanded for axis in pair.columns])
        for k, label in enumerate(pair.columns):
            numbers = peak[k], apart[k], math.nan if still[k] else ratio[k], drift[k]
            found.append(Compared(f"{pair.name} {label}", channel_unit(f"{pair.name}[{label}]"), *map(float, numbers)))
    return found
