"""The summary of a run report: the verdict and three key figures."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from ...data.metrics import SpoolUse, Tracking, channel, labels
from ...simulation.divergence import recorded_divergence
from ...simulation.limit_use import TOLERANCE, LimitUse, governing_limits
from .control_blocks import loop_sentence
from .page import Headline, Level, number
from .run_limits import only_spools
from .scales import SCALES, axis_scale, late_or_ahead, percent, shown_as

__all__ = ["headlines", "verdict_of_run"]

# Judgement, not physics: largest RRMSE, delay removed, with which a target counts as tracked.
FOLLOWED = {"displacement": 0.10, "acceleration": 0.40}
NEAR = 0.8  # demand over capacity that calls for attention


def verdict_of_run(
    record: xr.Dataset,
    found: Sequence[Tracking],
    spools: Sequence[SpoolUse],
    uses: Sequence[LimitUse],
    notes: Sequence[str],
) -> tuple[str, Level]:
    """Return the verdict and its level: clipped spools, tracking, limits, control loop, notes."""
    stopped = _trouble(record)
    clipped, loop, unstable = _clipped(record, spools), *loop_sentence(record.attrs)
    if stopped:  # the part before the stop does not represent the test
        clipped = "" if recorded_divergence(record.attrs) else clipped
        sentences = [f"The run {stopped}: tracking is not judged.", clipped, loop, "See the notes."]
        return " ".join(filter(None, sentences)), "bad"
    tracked, level = _followed(record, found, clipped=bool(clipped))
    beyond = [use for use in uses if use.decides and use.quantity != "spool" and use.share > 1.0 + TOLERANCE]
    sentences = [clipped, tracked]
    if beyond:
        shares = {use: f"{number(100 * use.share, 4)}\N{NO-BREAK SPACE}% of its limit" for use in beyond}
        named = (f"{u.name} {u.quantity} ({shares[u] if np.isfinite(u.share) else 'no capacity'})" for u in beyond)
        sentences.append(f"Limits exceeded: {', '.join(named)}.")
    elif any(use.quantity != "spool" for use in uses):
        sentences.append(f"All {'other ' * bool(clipped)}demands are within the given limits.")
    elif spools and not clipped:
        sentences.append("No spool reached its limit.")
    if clipped or beyond:
        level = "bad"
    sentences.append(loop)
    if unstable:
        level = "bad"
    elif loop:
        level = "attention" if level in ("good", "plain") else level
    if notes:
        level = "attention" if level in ("good", "plain") else level
        sentences.append("See the notes.")
    return " ".join(filter(None, sentences)), level


def headlines(record: xr.Dataset, found: Sequence[Tracking], uses: Sequence[LimitUse]) -> list[Headline]:
    """Return worst RRMSE, peak displacement and the governing limit."""
    return [_worst_rrmse(record, found), _peak_displacement(found), _governing_limit(uses)]


def _trouble(record: xr.Dataset) -> str:
    """How a run stopped or lost its commands; empty where it did neither."""
    trouble = str(record.attrs.get("trouble", "none")).partition(";")[0]
    return "" if trouble == "none" else trouble


def _followed(record: xr.Dataset, found: Sequence[Tracking], *, clipped: bool) -> tuple[str, Level]:
    """Sentence on tracking and its level; with clipped commands a small error is no proof that the table followed."""
    worst = {quantity: _worst(found, quantity) for quantity in FOLLOWED}
    tracked = [(row, FOLLOWED[quantity]) for quantity, row in worst.items() if row]
    if not tracked:
        lacking = [n for n in ("platen_displacement", "reference_displacement") if n not in record]
        why = f"the record has no {' and no '.join(lacking)}" if lacking else "the target is at rest"
        return f"Tracking cannot be judged: {why}.", "plain"
    good = all(row.rrmse_aligned <= allowed for row, allowed in tracked)
    start = "The table tracked its target" if good else "The table did not track its target closely enough"
    if good and clipped:
        start = "Errors are within the criteria, but with clipped commands the table does not follow its target"
    words = " and ".join(
        f"{row.quantity} {_against(row.rrmse_aligned, allowed)} ({row.axis}, criterion {100 * allowed:.0f} %)"
        for row, allowed in tracked
    )
    return f"{start}: worst RRMSE, delay removed, {words}.", "good" if good and not clipped else "attention"


def _against(error: float, allowed: float) -> str:
    """An error in per cent, with a word where only digits that are not shown are beyond what is allowed."""
    same = error > allowed and percent(error) == percent(allowed)
    return "just above " * same + percent(error)


def _clipped(record: xr.Dataset, spools: Sequence[SpoolUse]) -> str:
    """The sentence on spools at full stroke and commands clipped to it; empty where there were none."""
    count = record.attrs.get("spool_values_clipped", 0)
    count = int(count) if isinstance(count, int | np.integer) else 0
    shares = {spool.actuator: spool.saturated for spool in spools}
    if "spool_command" in record:
        command = np.mean(np.abs(channel(record, "spool_command")) >= 1.0, axis=0)
        for actuator, share in zip(labels(record, "actuator"), command.tolist(), strict=True):
            shares[actuator] = max(shares.get(actuator, 0.0), share)
    full = [f"spool {actuator} {percent(share)} of the time" for actuator, share in shares.items() if share]
    if not (count or full):
        return ""
    start = f"{count} spool commands were clipped" if count else "Spools reached their full stroke"
    return f"{start}: {', '.join(full)}." if full else f"{start}."


def _worst_rrmse(record: xr.Dataset, found: Sequence[Tracking]) -> Headline:
    if _trouble(record):
        return Headline("–", "Worst acceleration RRMSE", "tracking is not judged")
    for quantity in ("acceleration", "velocity", "displacement"):
        worst = _worst(found, quantity)
        if worst:
            note = f"axis {worst.axis}; {percent(worst.rrmse)} as recorded, {late_or_ahead(worst.delay)}"
            level: Level = "attention" if worst.rrmse_aligned > FOLLOWED.get(quantity, np.inf) else "good"
            return Headline(percent(worst.rrmse_aligned), f"Worst {quantity} RRMSE, delay removed", note, level)
    return Headline("–", "Worst acceleration RRMSE", "no target and achieved motion in the record")


def _peak_displacement(found: Sequence[Tracking]) -> Headline:
    """The largest translation, or rotation where nothing else is known."""
    rows = [row for row in found if row.quantity == "displacement" and np.isfinite(row.peak_achieved)]
    straight = [row for row in rows if axis_scale(row.axis, "displacement") is SCALES["displacement"]]
    if not rows:
        return Headline("–", "Peak displacement", "no platen_displacement in the record")
    row = max(straight or rows, key=lambda row: row.peak_achieved)
    peak = shown_as(row.peak_achieved, axis_scale(row.axis, "displacement"))
    return Headline(peak, "Peak displacement", f"axis {row.axis}")


def _governing_limit(uses: Sequence[LimitUse]) -> Headline:
    label = "Governing limit: demand / capacity"
    if not uses:
        return Headline("–", label, "neither limits of the machine nor spools are available")
    use = governing_limits(use for use in uses if use.decides)[0]
    label = "Largest spool demand; limits were not evaluated" if only_spools(uses) else label
    over = use.share >= 1.0 if use.quantity == "spool" else use.share > 1.0 + TOLERANCE
    level: Level = "bad" if over else "attention" if use.share >= NEAR else "good"
    share = percent(use.share) if np.isfinite(use.share) else "no capacity"
    return Headline(share, label, f"{use.name}, {use.quantity}", level)


def _worst(found: Sequence[Tracking], quantity: str) -> Tracking | None:
    rows = [row for row in found if row.quantity == quantity and np.isfinite(row.rrmse_aligned)]
    return max(rows, key=lambda row: row.rrmse_aligned, default=None)
