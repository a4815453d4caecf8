"""Demand over capacity of every limit, and the governing one."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .page import Markup, bar, number, paragraph, table
from .plots import SCALES, Scale
from .run_components import TOLERANCE, Limits, force_use, share_of_limit, shares_of_limit
from .run_metrics import SpoolUse, Tracking, channel, peaks, sampling
from .run_motion import axis_scale, shown_as

__all__ = ["LimitUse", "limit_blocks", "limit_uses", "governing_limits", "of_limit"]

SHOWN = {
    "actuator stroke": "displacement",
    "actuator velocity": "velocity",
    "push": "force",
    "pull": "force",
    "force": "force",
}


class LimitUse(NamedTuple):
    """Peak demand of a test on one limit of an axis or actuator."""

    quantity: str  # "displacement", "actuator stroke", "push", "spool", ...
    name: str  # of the axis or actuator
    peak: float  # SI
    share: float  # demand over capacity; infinity for a capacity of zero


def limit_uses(
    record: xr.Dataset, found: Sequence[Tracking], spools: Sequence[SpoolUse], limits: Limits
) -> list[LimitUse]:
    """Return the demand on every known limit: axes; strokes, speeds and forces of actuators; spools."""
    uses = [
        LimitUse(r.quantity, r.axis, r.peak_achieved, share_of_limit(r.peak_achieved, limits, r.quantity, r.place))
        for r in found
    ]
    uses += [
        *_actuators(record, limits),
        *(LimitUse("spool", spool.actuator, spool.peak, spool.peak) for spool in spools),
    ]
    return [use for use in uses if not np.isnan(use.share)]


def governing_limits(uses: Iterable[LimitUse]) -> list[LimitUse]:
    """Return the largest demand over capacity of each quantity, the governing limit first."""
    most: dict[str, LimitUse] = {}
    for use in uses:
        if use.quantity not in most or use.share > most[use.quantity].share:
            most[use.quantity] = use
    return sorted(most.values(), key=lambda use: -use.share)


def of_limit(share: float) -> str:
    """Return demand over capacity with four digits, to distinguish 100.2 % from 100 %."""
    return f"{number(100 * share, 4)}\N{NO-BREAK SPACE}% of its limit" if np.isfinite(share) else "no capacity"


def limit_blocks(uses: Sequence[LimitUse]) -> list[Markup]:
    """Return the table of demand over capacity, the governing limit first."""
    if not uses:
        return [paragraph("Neither limits of the machine nor spools are available.")]
    rows = [
        (use.quantity.capitalize(), use.name, _shown(use), bar(use.share, TOLERANCE)) for use in governing_limits(uses)
    ]
    words = (
        "For each quantity the axis or actuator with the largest demand over capacity. The capacity of actuator "
        "velocity is that of the unloaded piston at full spool. All axes and actuators are in the other sections."
    )
    return [paragraph(words), table("Demand over capacity", ("Limit", "Governing", "Peak", "Demand / capacity"), rows)]


def _actuators(record: xr.Dataset, limits: Limits) -> Iterator[LimitUse]:
    if "actuator" not in record.coords:
        return
    names = [str(name) for name in record["actuator"].values]

    def each(quantity: str, peak: NDArray[np.float64], share: NDArray[np.float64]) -> Iterator[LimitUse]:
        return (LimitUse(quantity, n, float(p), float(s)) for n, p, s in zip(names, peak, share, strict=True))

    if "actuator_displacement" in record:
        moved = channel(record, "actuator_displacement", "actuator")
        stroke = peaks(moved)
        yield from each("actuator stroke", stroke, shares_of_limit(stroke, limits, "actuator_stroke"))
        velocity = np.gradient(moved, sampling(record)[1], axis=0)
        out, back = peaks(np.maximum(velocity, 0.0)), peaks(np.maximum(-velocity, 0.0))
        extending = shares_of_limit(out, limits, "actuator_extending")
        retracting = shares_of_limit(back, limits, "actuator_retracting")
        peak = np.where(extending >= retracting, out, back)
        yield from each("actuator velocity", peak, np.maximum(extending, retracting))
    for words, peak, share in force_use(record, limits):
        yield from each(words, peak, share)


def _shown(use: LimitUse) -> str:
    return "–" if use.quantity == "spool" else shown_as(use.peak, _scale(use))


def _scale(use: LimitUse) -> Scale:
    shown = SHOWN.get(use.quantity)
    return SCALES[shown] if shown else axis_scale(use.name, use.quantity)
