"""Recorded spools without the noise of their sensors, to drive a model by them.

A valve near null passes more oil one way than the other, for the same opening: noise about a spool at rest does not
average out in a model but moves its platen, always the same way, until friction holds it. Noise that a spool's
variance exceeds by little is therefore left out, by a local Wiener filter.
"""

from functools import cache

import numpy as np
import xarray as xr

from ..core.files import models_folder
from ..machine.parameters import load_parameters
from .records import is_measured
from .sensors import SensorSet
from .signals import local_wiener

__all__ = ["quiet_spools"]

SPOOLS = ("spool_position", "spool_position_b")


def quiet_spools(record: xr.Dataset, sensors: SensorSet) -> xr.Dataset:
    """The record with its spools less the noise that sensors state; itself where none is stated, or it is simulated."""
    if not is_measured(record):
        return record
    time = record["time"].values
    dt = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    quiet = {}
    for name in SPOOLS:
        noise = sensors.noise_sd(name, 0.5 / dt) if name in record else np.zeros(1)
        if noise.any():
            values = local_wiener(record[name].values, noise, round(_window() / dt))
            quiet[name] = (record[name].dims, values, record[name].attrs)
    return record.assign(quiet) if quiet else record


@cache
def _window() -> float:
    """Width of the filter's window [s]."""
    return load_parameters(models_folder() / "procedures" / "replay.toml").number("spools.window")
