"""The summary of a run report: the verdict and the three figures that matter."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from .page import Headline, Level
from .plots import SCALES
from .run_components import Limits, share_of_limit
from .run_metrics import SpoolUse, Tracking, channel, peaks
from .run_motion import axis_scale, percent, shown_as

__all__ = ["FOLLOWED", "NEAR", "headlines", "judge"]

# Judgement, not physics: the largest RRMSE, delay removed, with which a target counts as followed.
FOLLOWED = {"displacement": 0.10, "acceleration": 0.40}
NEAR = 0.8  # share of a limit from which attention is drawn to it


def judge(
    record: xr.Dataset,
    found: Sequence[Tracking],
    spools: Sequence[SpoolUse],
    limits: Limits,
    notes: Sequence[str],
) -> tuple[str, Level]:
    """Return the verdict in words and how grave it is: target followed, limits kept, notes to read."""
    sentences, level = _followed(record, found)
    beyond = _beyond(record, found, spools, limits)
    if beyond:
        level = "bad"
        sentences.append(f"Beyond a limit: {', '.join(beyond)}.")
    elif limits or spools:
        sentences.append("Every limit that was given is kept." if limits else "No spool reached its limit.")
    if notes:
        level = "attention" if level in ("good", "plain") else level
        sentences.append("See the notes below.")
    return " ".join(sentences), level


def headlines(found: Sequence[Tracking], spools: Sequence[SpoolUse], limits: Limits) -> list[Headline]:
    """Return worst RRMSE, peak displacement and valve utilisation."""
    return [_worst_rrmse(found), _peak_displacement(found, limits), _valves(spools)]


def _followed(record: xr.Dataset, found: Sequence[Tracking]) -> tuple[list[str], Level]:
    words, good = [], True
    for quantity, allowed in FOLLOWED.items():
        worst = _worst(found, quantity)
        if worst:
            good &= worst.rrmse_aligned <= allowed
            words.append(f"{quantity} {percent(worst.rrmse_aligned)} ({worst.axis}, allowed {100 * allowed:.0f} %)")
    if not words:
        lacking = [n for n in ("platen_displacement", "reference_displacement") if n not in record]
        why = f"the record has no {' and no '.join(lacking)}" if lacking else "no motion was asked for"
        return [f"Tracking cannot be judged: {why}."], "plain"
    start = "The table followed its target" if good else "The table did not follow its target closely enough"
    return [f"{start}: worst RRMSE, delay removed, {' and '.join(words)}."], "good" if good else "attention"


def _beyond(record: xr.Dataset, found: Sequence[Tracking], spools: Sequence[SpoolUse], limits: Limits) -> list[str]:
    uses = [(f"{row.axis} {row.quantity}", _used(row, limits)) for row in found]
    for name, bound in (("actuator_displacement", "actuator_stroke"), ("actuator_force", "actuator_force")):
        if name in record and bound in limits:
            largest = peaks(channel(record, name, "actuator"))
            names = [f"{actuator} {name.removeprefix('actuator_')}" for actuator in record["actuator"].values]
            shares = [share_of_limit(peak, limits, bound, k) for k, peak in enumerate(largest)]
            uses += zip(names, shares, strict=True)
    beyond = [f"{name} ({percent(use)} of its limit)" for name, use in uses if use > 1.0]
    full = [f"spool {s.actuator} ({percent(s.saturated)} of the time at its limit)" for s in spools if s.saturated]
    return beyond + full


def _worst_rrmse(found: Sequence[Tracking]) -> Headline:
    for quantity in ("acceleration", "velocity", "displacement"):
        worst = _worst(found, quantity)
        if worst:
            late = shown_as(worst.delay, SCALES["time"])
            note = f"axis {worst.axis}; {percent(worst.rrmse)} as recorded, delay {late}"
            level: Level = "attention" if worst.rrmse_aligned > FOLLOWED.get(quantity, np.inf) else "good"
            return Headline(percent(worst.rrmse_aligned), f"Worst {quantity} RRMSE, delay removed", note, level)
    return Headline("–", "Worst acceleration RRMSE", "no target and achieved motion in the record")


def _peak_displacement(found: Sequence[Tracking], limits: Limits) -> Headline:
    """Return the displacement nearest to its limit, or without limits the largest translation."""
    rows = [row for row in found if row.quantity == "displacement" and np.isfinite(row.peak_achieved)]
    limited = [row for row in rows if np.isfinite(_used(row, limits))]
    straight = [row for row in rows if axis_scale(row.axis, "displacement") is SCALES["displacement"]]
    if limited:
        row = max(limited, key=lambda row: _used(row, limits))
        used = _used(row, limits)
        level: Level = "bad" if used > 1.0 else "attention" if used >= NEAR else "good"
        note = f"axis {row.axis}, {percent(used)} of its limit, nearest of all axes"
    elif rows:
        row = max(straight or rows, key=lambda row: row.peak_achieved)
        note, level = f"axis {row.axis}", "plain"
    else:
        return Headline("–", "Peak displacement", "no platen_displacement in the record")
    shown = shown_as(row.peak_achieved, axis_scale(row.axis, "displacement"))
    return Headline(shown, "Peak displacement", note, level)


def _valves(spools: Sequence[SpoolUse]) -> Headline:
    if not spools:
        return Headline("–", "Valve utilisation", "no spool_position or spool_command in the record")
    most = max(spools, key=lambda spool: spool.peak)
    level: Level = "bad" if most.saturated else "attention" if most.peak >= NEAR else "good"
    return Headline(percent(most.peak), "Valve utilisation", f"largest spool opening, {most.actuator}", level)


def _worst(found: Sequence[Tracking], quantity: str) -> Tracking | None:
    rows = [row for row in found if row.quantity == quantity and np.isfinite(row.rrmse_aligned)]
    return max(rows, key=lambda row: row.rrmse_aligned, default=None)


def _used(row: Tracking, limits: Limits) -> float:
    return share_of_limit(row.peak_achieved, limits, row.quantity, row.place)
