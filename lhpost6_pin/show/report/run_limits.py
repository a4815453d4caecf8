"""Tables of demand over capacity, the governing limit first."""

from collections.abc import Iterable, Sequence

from ...motions import Peak
from ...simulation.limit_use import TOLERANCE, LimitUse, all_uses_of_peaks, governing_limits
from .page import Block, Table, bar, number
from .scales import SCALES, axis_scale, load_scale, shown_as

__all__ = ["NOT_EVALUATED", "demand_table", "limit_blocks", "limit_table", "only_spools"]

SHOWN = {"actuator stroke": "displacement", "actuator velocity": "velocity"}
SHOWN |= {"actuator unloading": "force", "reaction mass strength": "force", "platen strength": "force"}
SHOWN |= {"piston tilt": "rotation", "axis force": "force", "payload": "force", "axis overturning moment": "moment"}
SHOWN |= {"reaction mass moment": "moment"}
SHOWN |= {"axis yaw moment": "moment"}
SHOWN |= {"actuator push": "force", "actuator pull": "force"}
SHOWN |= {"push": "force", "pull": "force", "force": "force", "spool": "ratio"}


NOT_EVALUATED = "Limits of the machine were not evaluated: a record alone has spools only"


def only_spools(uses: Sequence[LimitUse]) -> bool:
    """Whether of all limits that of the spools alone is known, as of a record without its machine."""
    return all(use.quantity == "spool" for use in uses)


def limit_blocks(uses: Sequence[LimitUse]) -> list[Block]:
    """Return the table of demand over capacity, the governing limit first."""
    if not uses:
        return ["Neither limits of the machine nor spools are available."]
    if only_spools(uses):
        return [f"{NOT_EVALUATED}; `show_report` of the whole test, or `lhpost6 run`, has them.", limit_table(uses)]
    words = (
        "For each quantity the axis or actuator with the largest demand over capacity. The capacity of actuator "
        "velocity is that of the unloaded piston at full spool. The check before the run leaves a reserve of it, and "
        "of strokes and displacements (limits.valve_reserve and limits.stroke_reserve of the machine file). Unloading "
        "is the loss of a bearing actuator's force, from rest to its least chamber pressure; forces and moments along "
        "an axis are beyond rest, over the capacity along that axis alone. All axes and actuators are in the other "
        "sections."
    )
    return [words, limit_table(uses)]


def demand_table(peaks: Iterable[Peak]) -> Table:
    """Return the largest demand of a target on each quantity, the governing one first, as `limit_table`."""
    return limit_table(all_uses_of_peaks(peaks), "Demand over capacity, target; actuator forces beyond rest")


def limit_table(uses: Sequence[LimitUse], title: str = "Demand over capacity, achieved") -> Table:
    """Return the largest demand over capacity of each quantity, the governing limit first."""
    rows, governing = [], governing_limits(uses)
    loads = ("force", "moment")
    largest = max((use.peak for use in governing if SHOWN.get(use.quantity) in loads), default=0.0)
    scales = SCALES | {load: load_scale(load, largest) for load in loads}
    for use in governing:
        scale = scales[SHOWN[use.quantity]] if use.quantity in SHOWN else axis_scale(use.name, use.quantity)
        peak = f"{number(use.peak, 3)} of the stroke" if use.quantity == "spool" else shown_as(use.peak, scale)
        rows.append((use.quantity.capitalize(), use.name, peak, bar(use.share, TOLERANCE)))
    return Table(title, ("Limit", "Governing", "Peak", "Demand / capacity"), rows)
