"""Forces and pressure differences whose sign is turned: they oppose the acceleration that they must cause.

Where the regression of a force on the motion (`mass_regression`) explains it with the coefficients of mass and friction
negative, its sign is turned.
"""

from collections.abc import Sequence

import xarray as xr

from ..machine.machine import Machine
from .layout_faults import RecordFinding
from .mass_regression import MassFit, mass_fits
from .rests import rest_numbers

__all__ = ["turned_signs"]


def turned_signs(record: xr.Dataset, machine: Machine, fits: Sequence[MassFit] | None = None) -> list[RecordFinding]:
    """An error for every force or pressure difference that opposes mass times acceleration, from one record.

    A record of another machine, without motion, or slower than the band compared has none. `fits` are the record's
    `mass_fits`, if they are known.
    """
    numbers, found = rest_numbers(), []
    least, most = numbers.vector("sign.share")
    low, high = numbers.vector("sign.band")
    for fit in mass_fits(record, machine, numbers) if fits is None else fits:
        firm = fit.explained >= numbers.number("sign.explained")
        if firm and least <= -fit.share <= most and fit.power < 0:
            what = f"opposes the motion that it causes, mass and friction alike, from {low:g} to {high:g} Hz"
            remedy = "its sign is turned: write sign = -1 in the channel map, and import again"
            found.append(RecordFinding("error", fit.channel, None, what, remedy))
    return found
