"""The summary of a run report: the verdict and three key figures."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from .page import Headline, Level
from .plots import SCALES
from .run_components import TOLERANCE
from .run_limits import LimitUse, governing_limits, of_limit
from .run_metrics import SpoolUse, Tracking, channel
from .run_motion import axis_scale, percent, shown_as

__all__ = ["FOLLOWED", "NEAR", "headlines", "judge"]

# Judgement, not physics: largest RRMSE, delay removed, with which a target counts as tracked.
FOLLOWED = {"displacement": 0.10, "acceleration": 0.40}
NEAR = 0.8  # demand over capacity that calls for attention


def judge(
    record: xr.Dataset,
    found: Sequence[Tracking],
    spools: Sequence[SpoolUse],
    uses: Sequence[LimitUse],
    notes: Sequence[str],
) -> tuple[str, Level]:
    """Return the verdict and its level: clipped spools, tracking, limits, notes."""
    stopped = str(record.attrs.get("trouble", "none")).partition(";")[0]
    if stopped != "none":  # the part before the stop does not represent the test
        clipped = _clipped(record, spools)
        said = [f"The run {stopped}: tracking is not judged.", clipped, "See the notes."]
        return " ".join(filter(None, said)), "bad"
    sentences, level = _followed(record, found)
    clipped, beyond = _clipped(record, spools), _beyond(uses)
    if clipped:
        sentences.insert(0, clipped)
    if beyond:
        sentences.append(f"Limits exceeded: {', '.join(beyond)}.")
    elif any(use.quantity != "spool" for use in uses):
        sentences.append(
            "All other demands are within the given limits." if clipped else "All demands are within the given limits."
        )
    elif spools and not clipped:
        sentences.append("No spool reached its limit.")
    if clipped or beyond:
        level = "bad"
    if notes:
        level = "attention" if level in ("good", "plain") else level
        sentences.append("See the notes.")
    return " ".join(sentences), level


def headlines(found: Sequence[Tracking], uses: Sequence[LimitUse]) -> list[Headline]:
    """Return worst RRMSE, peak displacement and the governing limit."""
    return [_worst_rrmse(found), _peak_displacement(found), _governing_limit(uses)]


def _followed(record: xr.Dataset, found: Sequence[Tracking]) -> tuple[list[str], Level]:
    words, good = [], True
    for quantity, allowed in FOLLOWED.items():
        worst = _worst(found, quantity)
        if worst:
            good &= worst.rrmse_aligned <= allowed
            words.append(f"{quantity} {percent(worst.rrmse_aligned)} ({worst.axis}, criterion {100 * allowed:.0f} %)")
    if not words:
        lacking = [n for n in ("platen_displacement", "reference_displacement") if n not in record]
        why = f"the record has no {' and no '.join(lacking)}" if lacking else "the target is at rest"
        return [f"Tracking cannot be judged: {why}."], "plain"
    start = "The table tracked its target" if good else "The table did not track its target closely enough"
    return [f"{start}: worst RRMSE, delay removed, {' and '.join(words)}."], "good" if good else "attention"


def _clipped(record: xr.Dataset, spools: Sequence[SpoolUse]) -> str:
    """Return the sentence on spools at full stroke and commands clipped to it; empty where there were none."""
    count = record.attrs.get("spool_values_clipped", 0)
    count = int(count) if isinstance(count, int | np.integer) else 0
    shares = {spool.actuator: spool.saturated for spool in spools}
    if "spool_command" in record:
        command = np.mean(np.abs(channel(record, "spool_command", "actuator")) >= 1.0, axis=0)
        for actuator, share in zip(map(str, record["actuator"].values), command, strict=True):
            shares[actuator] = max(shares.get(actuator, 0.0), float(share))
    full = [f"spool {actuator} {percent(share)} of the time" for actuator, share in shares.items() if share]
    if not (count or full):
        return ""
    start = f"{count} spool commands were clipped" if count else "Spools reached their full stroke"
    return f"{start}: {', '.join(full)}." if full else f"{start}."


def _beyond(uses: Sequence[LimitUse]) -> list[str]:
    """Names of limits exceeded by more than the tolerance, without spools."""
    beyond = [use for use in uses if use.quantity != "spool" and use.share > 1.0 + TOLERANCE]
    return [f"{use.name} {use.quantity} ({of_limit(use.share)})" for use in beyond]


def _worst_rrmse(found: Sequence[Tracking]) -> Headline:
    for quantity in ("acceleration", "velocity", "displacement"):
        worst = _worst(found, quantity)
        if worst:
            late = shown_as(worst.delay, SCALES["time"])
            note = f"axis {worst.axis}; {percent(worst.rrmse)} as recorded, delay {late}"
            level: Level = "attention" if worst.rrmse_aligned > FOLLOWED.get(quantity, np.inf) else "good"
            return Headline(percent(worst.rrmse_aligned), f"Worst {quantity} RRMSE, delay removed", note, level)
    return Headline("–", "Worst acceleration RRMSE", "no target and achieved motion in the record")


def _peak_displacement(found: Sequence[Tracking]) -> Headline:
    """Return the largest translation, or rotation where nothing else is known."""
    rows = [row for row in found if row.quantity == "displacement" and np.isfinite(row.peak_achieved)]
    straight = [row for row in rows if axis_scale(row.axis, "displacement") is SCALES["displacement"]]
    if not rows:
        return Headline("–", "Peak displacement", "no platen_displacement in the record")
    row = max(straight or rows, key=lambda row: row.peak_achieved)
    return Headline(
        shown_as(row.peak_achieved, axis_scale(row.axis, "displacement")), "Peak displacement", f"axis {row.axis}"
    )


def _governing_limit(uses: Sequence[LimitUse]) -> Headline:
    if not uses:
        return Headline(
            "–", "Governing limit: demand / capacity", "neither limits of the machine nor spools are available"
        )
    use = governing_limits(uses)[0]
    level: Level = "bad" if use.share > 1.0 + TOLERANCE else "attention" if use.share >= NEAR else "good"
    if use.quantity == "spool" and use.share >= 1.0:
        level = "bad"
    said = percent(use.share) if np.isfinite(use.share) else "no capacity"
    return Headline(said, "Governing limit: demand / capacity", f"{use.name}, {use.quantity}", level)


def _worst(found: Sequence[Tracking], quantity: str) -> Tracking | None:
    rows = [row for row in found if row.quantity == quantity and np.isfinite(row.rrmse_aligned)]
    return max(rows, key=lambda row: row.rrmse_aligned, default=None)
