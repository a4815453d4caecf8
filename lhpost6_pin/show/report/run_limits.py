"""How much of every limit a test used, and which limit it came nearest to."""

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

__all__ = ["LimitUse", "limit_blocks", "limit_uses", "nearest_limits", "of_limit"]

SHOWN = {"leg stroke": "displacement", "leg velocity": "velocity", "push": "force", "pull": "force", "force": "force"}


class LimitUse(NamedTuple):
    """The most that a test used of one limit of an axis or actuator."""

    quantity: str  # "displacement", "leg stroke", "push", "spool", ...
    name: str  # of the axis or actuator
    peak: float  # SI
    share: float  # of the limit; infinity of one that is nought


def limit_uses(
    record: xr.Dataset, found: Sequence[Tracking], spools: Sequence[SpoolUse], limits: Limits
) -> list[LimitUse]:
    """Return the use of every limit that is known: axes, then strokes, speeds and forces of the legs, then spools."""
    uses = [
        LimitUse(r.quantity, r.axis, r.peak_achieved, share_of_limit(r.peak_achieved, limits, r.quantity, r.place))
        for r in found
    ]
    uses += [*_legs(record, limits), *(LimitUse("spool", spool.actuator, spool.peak, spool.peak) for spool in spools)]
    return [use for use in uses if not np.isnan(use.share)]


def nearest_limits(uses: Iterable[LimitUse]) -> list[LimitUse]:
    """Return of each quantity the use nearest to its limit, the nearest of all first."""
    most: dict[str, LimitUse] = {}
    for use in uses:
        if use.quantity not in most or use.share > most[use.quantity].share:
            most[use.quantity] = use
    return sorted(most.values(), key=lambda use: -use.share)


def of_limit(share: float) -> str:
    """Return the share of a limit with a digit more than elsewhere, to tell 100.2 % from 100 %."""
    return f"{number(100 * share, 4)}\N{NO-BREAK SPACE}% of its limit" if np.isfinite(share) else "it can give none"


def limit_blocks(uses: Sequence[LimitUse]) -> list[Markup]:
    """Return the table of the limits used, the nearest first."""
    if not uses:
        return [paragraph("No limits of the machine were given to this report, and no spool was recorded.")]
    rows = [
        (use.quantity.capitalize(), use.name, _shown(use), bar(use.share, TOLERANCE)) for use in nearest_limits(uses)
    ]
    words = (
        "Of each quantity the axis or actuator that came nearest to its limit. A leg's velocity is held against that "
        "of the unloaded piston at full spool. Every axis and actuator is in the tables of the other sections."
    )
    return [paragraph(words), table("Limits used", ("Limit", "Nearest", "Peak", "of its limit"), rows)]


def _legs(record: xr.Dataset, limits: Limits) -> Iterator[LimitUse]:
    if "actuator" not in record.coords:
        return
    names = [str(name) for name in record["actuator"].values]

    def each(quantity: str, peak: NDArray[np.float64], share: NDArray[np.float64]) -> Iterator[LimitUse]:
        return (LimitUse(quantity, n, float(p), float(s)) for n, p, s in zip(names, peak, share, strict=True))

    if "actuator_displacement" in record:
        moved = channel(record, "actuator_displacement", "actuator")
        stroke = peaks(moved)
        yield from each("leg stroke", stroke, shares_of_limit(stroke, limits, "actuator_stroke"))
        velocity = np.gradient(moved, sampling(record)[1], axis=0)
        out, back = peaks(np.maximum(velocity, 0.0)), peaks(np.maximum(-velocity, 0.0))
        extending = shares_of_limit(out, limits, "actuator_extending")
        retracting = shares_of_limit(back, limits, "actuator_retracting")
        peak = np.where(extending >= retracting, out, back)
        yield from each("leg velocity", peak, np.maximum(extending, retracting))
    for words, peak, share in force_use(record, limits):
        yield from each(words, peak, share)


def _shown(use: LimitUse) -> str:
    return "–" if use.quantity == "spool" else shown_as(use.peak, _scale(use))


def _scale(use: LimitUse) -> Scale:
    shown = SHOWN.get(use.quantity)
    return SCALES[shown] if shown else axis_scale(use.name, use.quantity)
