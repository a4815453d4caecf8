"""Forces and pressure differences whose sign is turned: they oppose the acceleration, or the friction, they must cause.

Where the regression of a force on the motion (`mass_regression`) explains it with the coefficients of mass and friction
negative, its sign is turned. So it is where inertia is small beside friction, as in a slow sine, and the actuator takes
energy from the platen throughout, against the sign of its mass: friction and dampers only dissipate, and springs give
back what they took. One of several that are more than the platen's degrees of freedom may take what the others give;
its mass is positive then.
Two such forces along which the motion is opposite may as well be exchanged: the record does not distinguish these.
"""

from collections.abc import Sequence, Set

import xarray as xr

from ..machine.machine import Machine
from .layout_faults import RecordFinding
from .mass_regression import MassFit, mass_fits
from .rests import rest_numbers

__all__ = ["SIGN_REMEDY", "TURN_IT", "turned_signs"]

TURN_IT = "write sign = -1 in the channel map, or remove it where it stands, and import again"
SIGN_REMEDY = f"its sign is turned: {TURN_IT}"
"""Remedies of a turned channel: of one that is known to be, and of one that the message calls so."""
_EITHER = (
    "its sign is turned, or it is exchanged with {}: write sign = -1 in the channel map, or exchange both there, "
    "and import again"
)


def turned_signs(record: xr.Dataset, machine: Machine, fits: Sequence[MassFit] | None = None) -> list[RecordFinding]:
    """An error for every force or pressure difference that opposes what it causes, from one record.

    A record of another machine, without motion, or slower than the band compared has none. `fits` are the record's
    `mass_fits`, if they are known.
    """
    numbers = rest_numbers()
    found: list[tuple[MassFit, str]] = []
    least, most = numbers.vector("sign.share")
    taken = numbers.number("sign.taken")
    low, high = numbers.vector("sign.band")
    for fit in mass_fits(record, machine, numbers) if fits is None else fits:
        firm = fit.explained >= numbers.number("sign.explained")
        if firm and least <= -fit.share <= most and fit.power < 0:
            what = f"opposes the motion that it causes, mass and friction alike, from {low:g} to {high:g} Hz"
            found.append((fit, what))
        elif fit.share < 0.0 and fit.by_mass < numbers.number("sign.explained") and fit.given <= -taken:
            what = f"takes energy from the platen throughout (power over apparent power {fit.given:.2f})"
            found.append((fit, what))
    turned = {fit.channel for fit, _ in found}
    return [RecordFinding("error", fit.channel, None, what, _remedy(fit, turned)) for fit, what in found]


def _remedy(fit: MassFit, turned: Set[str]) -> str:
    """What to do about a turned force; all channels that are turned."""
    name = fit.channel.partition("[")[0]
    others = [other for other in fit.opposite if f"{name}[{other}]" in turned]
    return _EITHER.format(" or ".join(others)) if others else SIGN_REMEDY
