"""Sections of a run report on the platen's motion: target and achieved, response spectra, drift."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...motions.response_spectra import response_spectrum
from .page import Figure, Markup, details, figure, grid, missing, number, paragraph, table
from .plots import ACHIEVED, RECORDED, SCALES, TARGET, Row, Scale, Trace, palette, spectrum_figure, time_figure
from .run_components import draw_over_time
from .run_metrics import QUANTITIES, Tracking, channel, commanded_axes, drift, peak_window, sampling

__all__ = ["axis_scale", "drift_blocks", "percent", "shown_as", "spectrum_blocks", "tracking_blocks"]

DIRECTIONS = {"x": "longitudinal", "y": "transverse", "z": "vertical"}
ROTATIONS = ("roll", "pitch", "yaw")
PERIODS = np.geomspace(0.03, 10.0, 60)  # [s] of the response spectra
DAMPING = 0.05
CLOSE_UP = 3.0  # [s] drawn at full rate around the peak
CLOSE_UP_ROW = 210  # [CSS px]


def axis_scale(axis: str, quantity: str) -> Scale:
    """Return how a quantity of an axis is shown."""
    if axis not in ROTATIONS:
        return SCALES[quantity]
    return SCALES["rotation" if quantity == "displacement" else f"rotation {quantity}"]


def percent(fraction: float) -> str:
    """Return a share in per cent; an en dash where it is not finite."""
    return f"{number(100 * fraction)}\N{NO-BREAK SPACE}%" if np.isfinite(fraction) else "–"


def shown_as(value: float, scale: Scale) -> str:
    """Return an SI value in the unit it is shown in."""
    return f"{number(value * scale.factor)}\N{NO-BREAK SPACE}{scale.unit}"


def tracking_blocks(record: xr.Dataset, found: Sequence[Tracking]) -> list[Markup]:
    """Return target and achieved motion of every axis; uncommanded axes collapsed."""
    names = [f"{who}_{quantity}" for who in ("platen", "reference") for quantity in QUANTITIES]
    absent = [name for name in names if name not in record]
    blocks = [missing(absent, "The recorded part of target and motion is drawn.")] if absent else []
    if len(absent) == len(names):
        return blocks
    how = (
        "RRMSE = √(Σ error² ∕ Σ target²). The achieved motion, and the RRMSE in the title of each plot, are shown "
        "with the delay removed; the legend switches on the motion as recorded. Dragging zooms the time axes of all "
        "plots, a double click resets them. The shaded interval is drawn below its plot at the full rate."
    )
    blocks.append(paragraph(how))
    commanded = commanded_axes(record)
    for axis in commanded:
        window = _peak_window(record, axis)
        blocks.append(figure(_axis_figure(record, found, axis, window, "no target")))
        if window:
            blocks.append(figure(_close_up(record, found, axis, window)))
    uncommanded = [axis for axis in map(str, record["axis"].values) if axis not in commanded]
    if uncommanded:
        drawings = [figure(_axis_figure(record, found, axis, None, "uncommanded")) for axis in uncommanded]
        blocks.append(details(f"Uncommanded axes (cross-coupling): {', '.join(uncommanded)}", *drawings))
    return blocks


def spectrum_blocks(record: xr.Dataset) -> list[Markup]:
    """Return the response spectra of target and achieved acceleration of the commanded axes."""
    names = ("reference_acceleration", "platen_acceleration")
    absent = [name for name in names if name not in record]
    blocks = [missing(absent, "Their response spectra are not drawn.")] if absent else []
    if len(absent) == len(names):
        return blocks
    _, step = sampling(record)
    periods = PERIODS[PERIODS >= 10.0 * step]  # peaks are taken at samples
    drawings = []
    for axis in commanded_axes(record):
        curves = {}
        for name, label, line in zip(names, ("target", "achieved"), (TARGET, ACHIEVED), strict=True):
            motion = _of_axis(record, name, axis) if name in record else np.array([np.nan])
            if np.isfinite(motion).all():
                spectrum = response_spectrum(motion, step, periods, DAMPING)
                curves[label] = spectrum.pseudo_acceleration, {**line, "width": line["width"] + 0.6}
        words = f"Pseudo-spectral acceleration, {number(100 * DAMPING, 1)} % damping."
        scale = axis_scale(axis, "acceleration")
        name, title = f"spectrum-{axis}", _title(axis)
        drawings.append(figure(spectrum_figure(name, title, words, periods, curves, scale)))
    return [*blocks, grid(*drawings)]


def drift_blocks(record: xr.Dataset) -> list[Markup]:
    """Return the slow part of the displacement error, and the residual offset at the end."""
    absent = [name for name in ("platen_displacement", "reference_displacement") if name not in record]
    if absent:
        return [missing(absent, "Drift, the slow part of achieved minus target, is not drawn.")]
    slow = drift(record)
    if slow is None:
        return [paragraph("Drift is not shown: the displacement has non-finite samples.")]
    axes = [str(axis) for axis in record["axis"].values]
    scales = [axis_scale(axis, "displacement") for axis in axes]
    rows = []
    for kind, title in (("displacement", "Slow error"), ("rotation", "Slow rotation error")):
        own = [k for k, scale in enumerate(scales) if scale is SCALES[kind]]
        traces = [Trace(axes[k], slow.error[:, k], line) for k, line in zip(own, palette(len(own)), strict=True)]
        rows += [Row(title, traces, SCALES[kind])] if own else []
    words = f"Achieved minus target displacement below {number(slow.cutoff, 2)} Hz (zero-phase low-pass)."
    summary = [
        (axis, scale.unit, number(largest * scale.factor), number(left * scale.factor))
        for axis, scale, largest, left in zip(axes, scales, slow.largest, slow.residual, strict=True)
    ]
    header = ("Axis", "Unit", "Largest slow error", "Offset at the end")
    drawing = draw_over_time(record, "drift", "Drift of the platen", words, rows)
    return [drawing, table("Drift and residual offset", header, summary)]


def _axis_figure(
    record: xr.Dataset, found: Sequence[Tracking], axis: str, window: tuple[int, int] | None, untracked: str
) -> Figure:
    start, step = sampling(record)
    rows, words = [], []
    for quantity in QUANTITIES:
        row = _tracked(found, axis, quantity)
        traces = _traces(record, row, axis, quantity, slice(None), folded="as recorded")
        note = f", RRMSE {percent(row.rrmse_aligned)}" if row else ""
        rows += [Row(quantity.capitalize(), traces, axis_scale(axis, quantity), note=note)] if traces else []
        if row:
            after = f"{percent(row.rrmse_aligned)} after removing {shown_as(row.delay, SCALES['time'])}"
            words.append(f"{quantity} RRMSE {percent(row.rrmse)} as recorded, {after}")
    said = "; ".join(words) or untracked
    said = f"{said[0].upper()}{said[1:]}."
    bands = [(start + window[0] * step, start + window[1] * step)] if window else []
    return time_figure(f"axis-{axis}", _title(axis), said, rows, start=start, step=step, bands=bands)


def _close_up(record: xr.Dataset, found: Sequence[Tracking], axis: str, window: tuple[int, int]) -> Figure:
    """Return the highest recorded derivative around its peak, every sample, also as recorded."""
    start, step = sampling(record)
    quantity = next(q for q in reversed(QUANTITIES) if {f"platen_{q}", f"reference_{q}"} & set(record.variables))
    row = _tracked(found, axis, quantity)
    words = f"{quantity.capitalize()} around its peak, every sample."
    if row:
        words += f" The dotted line is as recorded, {shown_as(row.delay, SCALES['time'])} later."
    return time_figure(
        f"close-{axis}",
        f"{_title(axis)}, close-up",
        words,
        [Row(quantity.capitalize(), _traces(record, row, axis, quantity, slice(*window)), axis_scale(axis, quantity))],
        start=start + window[0] * step,
        step=step,
        buckets=window[1] - window[0],
        alone=True,
        row_height=CLOSE_UP_ROW,
    )


def _peak_window(record: xr.Dataset, axis: str) -> tuple[int, int] | None:
    """Return the samples of the close-up: around the peak target acceleration, or of what there is."""
    names = [f"{who}_{quantity}" for quantity in reversed(QUANTITIES) for who in ("reference", "platen")]
    name = next(name for name in names if name in record)
    _, step = sampling(record)
    return peak_window(_of_axis(record, name, axis), step, CLOSE_UP)


def _traces(
    record: xr.Dataset, row: Tracking | None, axis: str, quantity: str, part: slice, folded: str = ""
) -> list[Trace]:
    """Return target and achieved motion; where its delay is known, without it and then, maybe folded, as recorded."""
    traces = []
    if f"reference_{quantity}" in record:
        traces.append(Trace("target", _of_axis(record, f"reference_{quantity}", axis)[part], TARGET))
    if f"platen_{quantity}" in record:
        achieved = _of_axis(record, f"platen_{quantity}", axis)[part]
        if row and row.aligned is not None:
            traces.append(Trace("achieved, delay removed", row.aligned[part], ACHIEVED))
            traces.append(Trace("as recorded", achieved, RECORDED, folded))
        else:
            traces.append(Trace("achieved", achieved, ACHIEVED))
    return traces


def _of_axis(record: xr.Dataset, name: str, axis: str) -> NDArray[np.float64]:
    return channel(record, name, "axis")[:, list(map(str, record["axis"].values)).index(axis)]


def _tracked(found: Sequence[Tracking], axis: str, quantity: str) -> Tracking | None:
    """Return the tracking of a quantity, if it had a target."""
    rows = (row for row in found if row.axis == axis and row.quantity == quantity)
    return next((row for row in rows if np.isfinite(row.rrmse)), None)


def _title(axis: str) -> str:
    return f"Axis {axis} ({DIRECTIONS[axis]})" if axis in DIRECTIONS else f"Axis {axis}"
