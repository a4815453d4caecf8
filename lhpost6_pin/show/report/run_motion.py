"""Sections of a run report on the platen's motion: target and achieved, drift."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...data.metrics import QUANTITIES, Tracking, channel, commanded_axes, drift, labels, peak_window, peaks, sampling
from .page import Block, Figure, Table, details, missing, number
from .plots import ACHIEVED, RECORDED, TARGET, Row, Trace, palette_traces, time_figure
from .run_components import draw_over_time
from .scales import SCALES, axis_scale, axis_title, late_or_ahead, percent, scaled_number

__all__ = ["drift_blocks", "tracking_blocks"]

CLOSE_UP = 3.0  # [s] drawn at full rate around the peak
CLOSE_UP_ROW = 210  # [CSS px]


def tracking_blocks(record: xr.Dataset, found: Sequence[Tracking]) -> list[Block]:
    """Return target and achieved motion of every axis; uncommanded axes collapsed."""
    names = [f"{who}_{quantity}" for who in ("platen", "reference") for quantity in QUANTITIES]
    absent = [name for name in names if name not in record]
    blocks: list[Block] = [missing(absent, "The recorded part of target and motion is drawn.")] if absent else []
    if len(absent) == len(names):
        return blocks
    blocks.append(
        "RRMSE = √(Σ error² ∕ Σ target²). The achieved motion, and the RRMSE in the title of each plot, are shown "
        "with the delay removed; the legend switches on the motion as recorded. Dragging zooms the time axes of all "
        "plots, a double click resets them. The shaded interval is drawn below its plot at the full rate."
    )
    # the close-up is around the peak target acceleration, or that of the highest derivative there is
    sources = [f"{who}_{quantity}" for quantity in reversed(QUANTITIES) for who in ("reference", "platen")]
    source = next(name for name in sources if name in record)
    commanded = commanded_axes(record)
    for axis in commanded:
        window = peak_window(_of_axis(record, source, axis), sampling(record)[1], CLOSE_UP)
        blocks.append(_axis_figure(record, found, axis, window, "no target"))
        if window:
            blocks.append(_close_up(record, found, axis, window))
    uncommanded = [axis for axis in labels(record, "axis") if axis not in commanded]
    if uncommanded:
        drawings = [_axis_figure(record, found, axis, None, "uncommanded") for axis in uncommanded]
        blocks.append(details(f"Uncommanded axes (cross-coupling): {', '.join(uncommanded)}", *drawings))
    return blocks


def drift_blocks(record: xr.Dataset) -> list[Block]:
    """Return the slow part of the displacement error, and the residual offset at the end."""
    absent = [name for name in ("platen_displacement", "reference_displacement") if name not in record]
    if absent:
        return [missing(absent, "Drift, the slow part of achieved minus target, is not drawn.")]
    found = drift(record)
    if found is None:
        return ["Drift is not shown: the displacement has non-finite samples."]
    slow, cutoff, offset = found
    axes = labels(record, "axis")
    scales = [axis_scale(axis, "displacement") for axis in axes]
    rows = []
    for kind, title in (("displacement", "Slow error"), ("rotation", "Slow rotation error")):
        own = [k for k, scale in enumerate(scales) if scale is SCALES[kind]]
        rows += [Row(title, palette_traces([axes[k] for k in own], slow[:, own]), SCALES[kind])] if own else []
    words = f"Achieved minus target displacement below {number(cutoff, 2)} Hz (zero-phase low-pass)."
    summary = [
        (axis, scale.unit, scaled_number(largest, scale), scaled_number(last, scale))
        for axis, scale, largest, last in zip(axes, scales, peaks(slow), offset, strict=True)
    ]
    header = ("Axis", "Unit", "Largest slow error", "Offset at the end")
    drawing = draw_over_time(record, "drift", "Drift of the platen", words, rows)
    return [drawing, Table("Drift and residual offset", header, summary)]


def _axis_figure(
    record: xr.Dataset, found: Sequence[Tracking], axis: str, window: tuple[int, int] | None, untracked: str
) -> Figure:
    start, step = sampling(record)
    rows, words = [], []
    for quantity in QUANTITIES:
        row = _tracked(found, axis, quantity)
        traces = _traces(record, row, axis, quantity, folded="as recorded")
        note = f", RRMSE {percent(row.rrmse_aligned)}" if row else ""
        rows += [Row(quantity.capitalize(), traces, axis_scale(axis, quantity), note=note)] if traces else []
        if row:
            late = late_or_ahead(row.delay)
            words.append(
                f"{quantity} RRMSE {percent(row.rrmse)} as recorded ({late}), {percent(row.rrmse_aligned)} aligned"
            )
    text = "; ".join(words) or untracked
    bands = [(start + window[0] * step, start + window[1] * step)] if window else []
    description = f"{text[0].upper()}{text[1:]}."
    return time_figure(f"axis-{axis}", axis_title(axis), description, rows, start=start, step=step, bands=bands)


def _close_up(record: xr.Dataset, found: Sequence[Tracking], axis: str, window: tuple[int, int]) -> Figure:
    """Every sample of the highest recorded derivative around its peak, also as recorded."""
    quantity = next(q for q in reversed(QUANTITIES) if {f"platen_{q}", f"reference_{q}"} & set(record.variables))
    row = _tracked(found, axis, quantity)
    words = f"{quantity.capitalize()} around its peak, every sample."
    if row:
        words += f" The dotted line is as recorded, {late_or_ahead(row.delay)}."
    rows = [Row(quantity.capitalize(), _traces(record, row, axis, quantity), axis_scale(axis, quantity))]
    title, (start, step) = f"{axis_title(axis)}, close-up", sampling(record)
    return time_figure(
        f"close-{axis}", title, words, rows, start=start, step=step, window=window, row_height=CLOSE_UP_ROW
    )


def _traces(record: xr.Dataset, row: Tracking | None, axis: str, quantity: str, folded: str = "") -> list[Trace]:
    """Target and achieved motion; where its delay is known, without it and then, maybe folded, as recorded."""
    traces = []
    if f"reference_{quantity}" in record:
        traces.append(Trace("target", _of_axis(record, f"reference_{quantity}", axis), TARGET))
    if f"platen_{quantity}" in record:
        achieved = _of_axis(record, f"platen_{quantity}", axis)
        if row and row.aligned is not None:
            traces.append(Trace("achieved, delay removed", row.aligned, ACHIEVED))
            traces.append(Trace("as recorded", achieved, RECORDED, folded))
        else:
            traces.append(Trace("achieved", achieved, ACHIEVED))
    return traces


def _of_axis(record: xr.Dataset, name: str, axis: str) -> Array:
    return channel(record, name)[:, labels(record, "axis").index(axis)]


def _tracked(found: Sequence[Tracking], axis: str, quantity: str) -> Tracking | None:
    """The tracking of a quantity, if it had a target."""
    rows = (row for row in found if row.axis == axis and row.quantity == quantity)
    return next((row for row in rows if np.isfinite(row.rrmse)), None)
