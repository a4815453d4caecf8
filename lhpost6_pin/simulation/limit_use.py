"""Demand over capacity of every limit of a table in a test, and the governing one."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.errors import UnknownNameError
from ..data.metrics import SpoolUse, Tracking, channel, labels, peaks, sampling
from ..data.served_samples import answered_samples
from ..mechanics.equilibrium import actuator_speeds
from ..mechanics.plant import Plant
from ..motions import Peak

__all__ = ["LIMIT_NAMES", "TOLERANCE", "ForceUse", "LimitUse", "Limits", "checked_limits", "force_use"]
__all__ += ["governing_limits", "limit_uses", "plant_limits", "sample_shares", "share_of_limit", "shares_of_limit"]
__all__ += ["all_uses_of_peaks", "uses_of_peaks"]

Limits = Mapping[str, Array]

TOLERANCE = 1e-3  # relative excess of a sampled peak over its limit that still counts as within

LIMIT_NAMES = (
    "displacement",  # (n_axes,) [m, rad]
    "velocity",  # (n_axes,) [m/s, rad/s]
    "acceleration",  # (n_axes,) [m/s2, rad/s2]
    "actuator_stroke",  # (n_act,) one-sided [m]
    "actuator_force",  # (n_act,) largest force [N]; of pushing alone where actuator_pull is given
    "actuator_pull",  # (n_act,) magnitude of the largest pulling force [N]; 0: it cannot pull
    "actuator_extending",  # (n_act,) speed of the unloaded piston at full spool [m/s]
    "actuator_retracting",  # (n_act,) the other way [m/s]
    "supply_pressure",  # [Pa]
    "strut_area",  # (n_strut,) [m2]: gas pressure times area is the pull of a strut
)

_OF_AXES = ("displacement", "velocity", "acceleration")
_IN_RECORD = (*_OF_AXES, "actuator stroke", "actuator velocity", "actuator push", "actuator pull")
"""Demands of a motion that the channels of a record show."""


class LimitUse(NamedTuple):
    """Peak demand of a test on one limit of an axis or actuator."""

    quantity: str  # "displacement", "actuator stroke", "push", "spool", ...
    name: str  # of the axis or actuator
    peak: float  # SI
    share: float  # demand over capacity; infinity for a capacity of zero
    decides: bool = True  # whether beyond it the test is beyond the table


class ForceUse(NamedTuple):
    """Peak forces of the actuators in one direction, and demand over capacity."""

    words: str  # "push", "pull", or "force" for both
    peak: Array  # (n_act,) magnitude [N]
    share: Array  # (n_act,) not-a-number without a limit, infinity for a pull without capacity


def plant_limits(plant: Plant) -> Limits:
    """Limits of a plant: Table 2.2, strokes, velocities and forces of actuators, supply, strut areas.

    Velocities are those by which an achieved motion is judged (`mechanics.motion_demands`). Raises SimulationError if
    the actuators cannot hold what is mounted.
    """
    machine, supply = plant.machine, plant.supply
    area_a, area_b = plant.actuators.area_a, plant.actuators.area_b
    speeds = actuator_speeds(plant)
    return checked_limits(
        {
            "displacement": machine.limits.displacement,
            "velocity": machine.limits.velocity,
            "acceleration": machine.limits.acceleration,
            "actuator_stroke": [a.stroke for a in machine.actuators],
            "actuator_force": supply.pressure * area_a - supply.return_pressure * area_b,
            "actuator_pull": np.maximum(0.0, supply.pressure * area_b - supply.return_pressure * area_a),
            "actuator_extending": speeds[:, 0],
            "actuator_retracting": speeds[:, 1],
            "supply_pressure": supply.pressure,
            "strut_area": [s.area for s in machine.struts],
        }
    )


def sample_shares(limits: Limits, displacement: Array, force: Array) -> tuple[Array, Array]:
    """Displacements (6,) over their limits, and forces (n_actuators,) over push or pull, of a sample (`plant_limits`).

    Not-a-number or infinite where there is no capacity.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return (
            displacement / limits["displacement"],
            force / np.where(force < 0.0, limits["actuator_pull"], limits["actuator_force"]),
        )


def checked_limits(limits: Mapping[str, ArrayLike]) -> Limits:
    """Capacities (SI) by names of `LIMIT_NAMES` as arrays; not-a-number is no limit, as is 0 but for `actuator_pull`.

    Raises UnknownNameError for another name.
    """
    for name in limits:
        if name not in LIMIT_NAMES:
            raise UnknownNameError("limit", name, LIMIT_NAMES)
    values = {name: np.atleast_1d(np.asarray(value, dtype=np.float64)) for name, value in limits.items()}
    least = {"actuator_pull": 0.0}  # elsewhere 0 is no limit
    tiny = np.finfo(float).tiny
    return {name: np.where(value >= least.get(name, tiny), value, np.nan) for name, value in values.items()}


def share_of_limit(peak: float, limits: Limits, name: str, k: int) -> float:
    """Return peak over limit; not-a-number where no limit was given."""
    bounds = limits.get(name, np.array([]))
    return float(peak / bounds[k]) if k < len(bounds) else float("nan")


def shares_of_limit(peak: Array, limits: Limits, name: str) -> Array:
    """Return the peaks (n,) over the limits of as many axes or actuators."""
    return np.array([share_of_limit(value, limits, name, k) for k, value in enumerate(peak)])


def force_use(record: xr.Dataset, limits: Limits) -> list[ForceUse]:
    """Return demand over capacity of actuator forces: push and pull where `actuator_pull` is given, else magnitude."""
    if "actuator_force" not in record:
        return []
    force = channel(record, "actuator_force")
    if "actuator_pull" not in limits:
        return [ForceUse("force", peaks(force), shares_of_limit(peaks(force), limits, "actuator_force"))]
    push, pull = peaks(np.maximum(force, 0.0)), peaks(np.maximum(-force, 0.0))
    allowed = np.pad(limits["actuator_pull"], (0, len(pull)), constant_values=np.nan)[: len(pull)]
    known = np.nan_to_num(np.pad(limits.get("actuator_force", np.array([])), (0, len(pull)))[: len(pull)])
    # without pull capacity, the tolerance of the push applies
    none = np.where(pull > TOLERANCE * known, np.inf, np.where(np.isnan(pull), np.nan, 0.0))
    share = np.where(allowed == 0.0, none, pull / np.where(allowed == 0.0, np.nan, allowed))
    return [ForceUse("push", push, shares_of_limit(push, limits, "actuator_force")), ForceUse("pull", pull, share)]


def limit_uses(
    record: xr.Dataset, found: Sequence[Tracking], spools: Sequence[SpoolUse], limits: Limits
) -> list[LimitUse]:
    """Return the demand on every known limit: axes; strokes, speeds and forces of actuators; spools."""
    uses = [
        LimitUse(r.quantity, r.axis, r.peak_achieved, share_of_limit(r.peak_achieved, limits, r.quantity, r.place))
        for r in found
    ]
    for quantity, peak, share in _of_actuators(record, limits):
        actuators = zip(labels(record, "actuator"), peak.tolist(), share.tolist(), strict=True)
        uses += [LimitUse(quantity, *one) for one in actuators]
    uses += [LimitUse("spool", spool.actuator, spool.peak, spool.peak) for spool in spools]
    return [use for use in uses if not np.isnan(use.share)]


def uses_of_peaks(peaks: Iterable[Peak]) -> list[LimitUse]:
    """Return the demands of a motion on forces and strengths, of those that no channel of a record shows."""
    return all_uses_of_peaks(peak for peak in peaks if peak.quantity not in _IN_RECORD)


def all_uses_of_peaks(peaks: Iterable[Peak]) -> list[LimitUse]:
    """Return the demands of a motion on all limits, as far as they are known in SI."""
    return [
        LimitUse(peak.quantity, peak.name, abs(peak.value), peak.utilisation, peak.decides)
        for peak in peaks
        if peak.value is not None
    ]


def _of_actuators(record: xr.Dataset, limits: Limits) -> Iterator[tuple[str, Array, Array]]:
    """Quantities of the actuators, their peaks and demand over capacity."""
    if "actuator_displacement" in record:
        moved = channel(record, "actuator_displacement")
        stroke = peaks(moved)
        yield "actuator stroke", stroke, shares_of_limit(stroke, limits, "actuator_stroke")
        velocity = _rates(record, moved)
        out, back = peaks(np.maximum(velocity, 0.0)), peaks(np.maximum(-velocity, 0.0))
        extending = shares_of_limit(out, limits, "actuator_extending")
        retracting = shares_of_limit(back, limits, "actuator_retracting")
        peak = np.where(extending >= retracting, out, back)
        yield "actuator velocity", peak, np.maximum(extending, retracting)
    yield from force_use(record, limits)


def _rates(record: xr.Dataset, values: Array) -> Array:
    """Rates of a channel's values (n, k) between samples that were answered: others repeat the row before them."""
    shown = answered_samples(record)
    if shown.all():
        return np.gradient(values, sampling(record)[1], axis=0)
    if np.count_nonzero(shown) < 2:
        return np.zeros_like(values)
    return np.gradient(values[shown], record["time"].values[shown], axis=0)


def governing_limits(uses: Iterable[LimitUse]) -> list[LimitUse]:
    """Return the largest demand over capacity of each quantity, the governing limit first."""
    most: dict[str, LimitUse] = {}
    for use in uses:
        if use.quantity not in most or use.share > most[use.quantity].share:
            most[use.quantity] = use
    return sorted(most.values(), key=lambda use: -use.share)
