"""Forces and pressure differences whose sign is turned: they oppose the acceleration, or the friction, they must cause.

Where the regression of a force on the motion (`mass_regression`) explains it with the coefficients of mass and friction
negative, its sign is turned. So it is where inertia is small beside friction, as in a slow sine, and the actuator takes
energy from the platen throughout: friction and dampers only dissipate, and springs give back what they took.
"""

from collections.abc import Sequence

import xarray as xr

from ..machine.machine import Machine
from .layout_faults import RecordFinding
from .mass_regression import MassFit, mass_fits
from .rests import rest_numbers

__all__ = ["turned_signs"]

_REMEDY = "its sign is turned: write sign = -1 in the channel map, and import again"


def turned_signs(record: xr.Dataset, machine: Machine, fits: Sequence[MassFit] | None = None) -> list[RecordFinding]:
    """An error for every force or pressure difference that opposes what it causes, from one record.

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
            found.append(RecordFinding("error", fit.channel, None, what, _REMEDY))
        elif fit.by_mass < numbers.number("sign.explained") and fit.given <= -numbers.number("sign.taken"):
            what = f"takes energy from the platen throughout (power over apparent power {fit.given:.2f})"
            found.append(RecordFinding("error", fit.channel, None, what, _REMEDY))
    return found
