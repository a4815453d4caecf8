"""Demand over capacity of every limit, and the governing one."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...motions import Peak
from .page import Block, Table, bar
from .run_metrics import SpoolUse, Tracking, channel, labels, peaks, sampling
from .scales import SCALES, axis_scale, shown_as

__all__ = [
    "TOLERANCE",
    "ForceUse",
    "LimitUse",
    "Limits",
    "demand_table",
    "force_use",
    "governing_limits",
    "limit_blocks",
    "limit_table",
]
__all__ += ["limit_uses", "share_of_limit", "shares_of_limit", "uses_of_peaks"]

Limits = Mapping[str, Array]

TOLERANCE = 1e-3  # relative excess of a sampled peak over its limit that still counts as within
SHOWN = {"actuator stroke": "displacement", "actuator velocity": "velocity"}
SHOWN |= {"actuator unloading": "force", "reaction mass strength": "force", "platen strength": "force"}
SHOWN |= {"piston tilt": "rotation", "axis force": "force", "payload": "force", "axis overturning moment": "moment"}
SHOWN |= {"reaction mass moment": "moment"}
SHOWN |= {"axis yaw moment": "moment"}
SHOWN |= {"push": "force", "pull": "force", "force": "force", "spool": "ratio"}


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
    return [
        LimitUse(peak.quantity, peak.name, abs(peak.value), peak.utilisation, peak.decides)
        for peak in peaks
        if peak.value is not None and peak.quantity in SHOWN
    ]


def _of_actuators(record: xr.Dataset, limits: Limits) -> Iterator[tuple[str, Array, Array]]:
    """Quantities of the actuators, their peaks and demand over capacity."""
    if "actuator_displacement" in record:
        moved = channel(record, "actuator_displacement")
        stroke = peaks(moved)
        yield "actuator stroke", stroke, shares_of_limit(stroke, limits, "actuator_stroke")
        velocity = np.gradient(moved, sampling(record)[1], axis=0)
        out, back = peaks(np.maximum(velocity, 0.0)), peaks(np.maximum(-velocity, 0.0))
        extending = shares_of_limit(out, limits, "actuator_extending")
        retracting = shares_of_limit(back, limits, "actuator_retracting")
        peak = np.where(extending >= retracting, out, back)
        yield "actuator velocity", peak, np.maximum(extending, retracting)
    yield from force_use(record, limits)


def governing_limits(uses: Iterable[LimitUse]) -> list[LimitUse]:
    """Return the largest demand over capacity of each quantity, the governing limit first."""
    most: dict[str, LimitUse] = {}
    for use in uses:
        if use.quantity not in most or use.share > most[use.quantity].share:
            most[use.quantity] = use
    return sorted(most.values(), key=lambda use: -use.share)


def limit_blocks(uses: Sequence[LimitUse]) -> list[Block]:
    """Return the table of demand over capacity, the governing limit first."""
    if not uses:
        return ["Neither limits of the machine nor spools are available."]
    words = (
        "For each quantity the axis or actuator with the largest demand over capacity. The capacity of actuator "
        "velocity is that of the unloaded piston at full spool. Unloading is the loss of a bearing actuator's force, "
        "from rest to its least chamber pressure; forces and moments along an axis are beyond rest, over the capacity "
        "along that axis alone. All axes and actuators are in the other sections."
    )
    return [words, limit_table(uses)]


def demand_table(peaks: Iterable[Peak]) -> Table:
    """Return the largest demand of a motion on each quantity in words, the governing one first."""
    most: dict[str, Peak] = {}
    for peak in peaks:
        if peak.quantity not in most or peak.utilisation > most[peak.quantity].utilisation:
            most[peak.quantity] = peak
    rows = [
        (peak.quantity.capitalize(), peak.name, peak.text, bar(peak.utilisation, TOLERANCE))
        for peak in sorted(most.values(), key=lambda peak: -peak.utilisation)
    ]
    return Table("Demand over capacity", ("Limit", "Governing", "Peak", "Demand / capacity"), rows)


def limit_table(uses: Sequence[LimitUse]) -> Table:
    """Return the largest demand over capacity of each quantity, the governing limit first."""
    rows = []
    for use in governing_limits(uses):
        scale = SCALES[SHOWN[use.quantity]] if use.quantity in SHOWN else axis_scale(use.name, use.quantity)
        peak = "–" if use.quantity == "spool" else shown_as(use.peak, scale)
        rows.append((use.quantity.capitalize(), use.name, peak, bar(use.share, TOLERANCE)))
    return Table("Demand over capacity", ("Limit", "Governing", "Peak", "Demand / capacity"), rows)
