"""Quantities of a run that an ensemble keeps, by group; each is a number, or one for each axis, actuator, ..."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import OutOfRangeError, UnknownNameError
from ..core.names import AXES
from ..data.metrics import QUANTITIES, channel, peaks, sampling, spool_use, track
from ..machine.parameters import Parameters
from ..motions import response_spectrum
from ..simulation.limit_use import LimitUse, governing_limits, limit_uses, plant_limits, uses_of_peaks
from ..simulation.motion_limits import judge_record
from ..simulation.simulate import Run
from ..simulation.specimen_response import base_wrench

__all__ = ["DECIDING", "DEFAULT", "GROUPS", "LIMITS", "OF_LIMITS", "Variable", "check_groups", "evaluate"]
__all__ += ["periods_of", "psa", "variables_of"]

_RECORDED = (*QUANTITIES, "actuator stroke", "actuator velocity", "push", "pull", "spool")
_STRENGTHS = ("actuator unloading", "reaction mass strength", "reaction mass moment", "platen strength", "piston tilt")
_ALONE = ("axis force", "axis overturning moment", "axis yaw moment", "payload")

LIMITS = (*_RECORDED, *_STRENGTHS, *_ALONE)
"""Limits of a table; those from `actuator unloading` on follow from the motion by inverse dynamics."""

DECIDING = (*_RECORDED, *_STRENGTHS)
"""Limits beyond which a run is beyond the table; capacities along one axis alone are for comparison."""


class Variable(NamedTuple):
    """A quantity: its own dimensions, beyond those of the ensemble, unit and meaning."""

    dims: tuple[str, ...]
    units: str
    long_name: str


class Evaluated(NamedTuple):
    """A run with its record."""

    run: Run
    record: xr.Dataset
    numbers: Parameters


def _by_axis(values: Mapping[str, float]) -> Array:
    return np.array([values.get(axis, np.nan) for axis in AXES])


def _tracking(one: Evaluated) -> dict[str, Array]:
    found = {}
    for quantity in ("displacement", "acceleration"):
        rows = track(one.record, quantity)
        found[f"rrmse_{quantity}"] = _by_axis({row.axis: row.rrmse for row in rows})
        found[f"peak_{quantity}"] = _by_axis({row.axis: row.peak_achieved for row in rows})
        if quantity == "acceleration":
            found["rrmse_aligned"] = _by_axis({row.axis: row.rrmse_aligned for row in rows})
            found["delay"] = _by_axis({row.axis: row.delay for row in rows})
    return found


def _limits(one: Evaluated) -> dict[str, Array]:
    motion = [row for quantity in QUANTITIES for row in track(one.record, quantity, errors=False)]
    uses = limit_uses(one.record, motion, [], plant_limits(one.run.plant))
    command = channel(one.record, "spool_command") if "spool_command" in one.record else np.zeros((1, 1))
    demand = 1.0 if one.run.clipped else float(np.abs(command).max())  # a clipped command is no larger
    return {"limit_use": _shares([*uses, LimitUse("spool", "", demand, demand)])}


def _shares(uses: Sequence[LimitUse]) -> Array:
    """The largest demand over capacity by limit (LIMITS,)."""
    share = {use.quantity: use.share for use in governing_limits(uses)}
    return np.array([share.get(limit, np.nan) for limit in LIMITS])


def _strengths(one: Evaluated) -> dict[str, Array]:
    try:
        found = judge_record(one.run.plant, one.record, fits=False)
    except OutOfRangeError as error:  # beyond it at rest already
        return {"limit_use": _shares([LimitUse(limit, "", np.inf, np.inf) for limit in error.exceeded])}
    return {"limit_use": _shares([] if found is None else uses_of_peaks(found.peaks))}


def _forces(one: Evaluated) -> dict[str, Array]:
    return {
        "peak_force": peaks(channel(one.record, "actuator_force")),
        "valve_saturation": np.array([use.saturated for use in spool_use(one.record)]),
    }


def _spectra(one: Evaluated) -> dict[str, Array]:
    return {"psa": psa(channel(one.record, "platen_acceleration")[:, :3], sampling(one.record)[1], one.numbers)}


def _base(one: Evaluated) -> dict[str, Array]:
    if one.run.plant.machine.specimen is None:
        return {"base_shear": np.array(np.nan), "base_moment": np.array(np.nan)}
    wrench = base_wrench(one.run)
    shear, moment = (np.hypot(*wrench[:, columns].T).max() for columns in ([0, 1], [3, 4]))
    return {"base_shear": np.asarray(shear), "base_moment": np.asarray(moment)}


_LIMIT_USE = {"limit_use": Variable(("limit",), "1", "largest demand over capacity")}

GROUPS: Mapping[str, tuple[Callable[[Evaluated], dict[str, Array]], Mapping[str, Variable]]] = {
    "tracking": (
        _tracking,
        {
            "rrmse_acceleration": Variable(("axis",), "1", "RRMSE of acceleration"),
            "rrmse_aligned": Variable(("axis",), "1", "RRMSE of acceleration, delay removed"),
            "rrmse_displacement": Variable(("axis",), "1", "RRMSE of displacement"),
            "delay": Variable(("axis",), "s", "delay of acceleration"),
            "peak_acceleration": Variable(("axis",), "m/s2 or rad/s2", "peak achieved acceleration"),
            "peak_displacement": Variable(("axis",), "m or rad", "peak achieved displacement"),
        },
    ),
    "limits": (_limits, _LIMIT_USE),
    "strengths": (_strengths, _LIMIT_USE),
    "forces": (
        _forces,
        {
            "peak_force": Variable(("actuator",), "N", "peak actuator force"),
            "valve_saturation": Variable(("actuator",), "1", "share of the time at full spool"),
        },
    ),
    "spectra": (_spectra, {"psa": Variable(("direction", "period"), "m/s2", "pseudo-spectral acceleration, achieved")}),
    "base": (
        _base,
        {
            "base_shear": Variable((), "N", "peak base shear of the specimen"),
            "base_moment": Variable((), "N m", "peak overturning moment at the specimen's base"),
        },
    ),
}
"""Groups of quantities: how they are evaluated, and their variables."""

OF_LIMITS = ("limits", "strengths")
"""Groups of demand over capacity."""

DEFAULT = ("tracking", "limits", "forces", "spectra", "base")
"""Groups kept unless others are named: `strengths`, by inverse dynamics of the achieved motion, takes longest."""


def check_groups(groups: Sequence[str]) -> None:
    """Raise UnknownNameError for a group that does not exist."""
    for group in groups:
        if group not in GROUPS:
            raise UnknownNameError("group of quantities", group, list(GROUPS))


def variables_of(groups: Sequence[str]) -> dict[str, Variable]:
    """Variables of some groups, by name."""
    return {name: variable for group in groups for name, variable in GROUPS[group][1].items()}


def evaluate(groups: Sequence[str], run: Run, record: xr.Dataset, numbers: Parameters) -> dict[str, Array]:
    """Quantities of a run by name, each of its own dimensions; limits of two groups are put together."""
    found: dict[str, Array] = {}
    for group in groups:
        for name, values in GROUPS[group][0](Evaluated(run, record, numbers)).items():
            found[name] = np.where(np.isnan(values), found[name], values) if name in found else values
    return found


def periods_of(numbers: Parameters) -> Array:
    """Periods [s] of response spectra."""
    n = numbers.number
    return np.geomspace(n("spectrum.shortest"), n("spectrum.longest"), int(n("spectrum.periods")))


def psa(acceleration: Array, step: float, numbers: Parameters) -> Array:
    """Pseudo-spectral acceleration (c, periods) [m/s2] of accelerations (n, c) at a sampling interval [s]."""
    every = max(1, round(1.0 / (step * numbers.number("spectrum.rate"))))
    periods, damping = periods_of(numbers), numbers.number("spectrum.damping")
    columns = np.ascontiguousarray(acceleration[::every].T)
    return np.array([response_spectrum(a, every * step, periods, damping).pseudo_acceleration for a in columns])
