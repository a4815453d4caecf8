"""Channels to light interactive figures: plain plotly dictionaries, no graph objects.

A long channel is drawn by its envelope: the least and the greatest sample of each of about 1500 stretches, at
their own times, so that every peak is the recorded sample and no pixel shows less than the full record would.
Values travel as base64 float32, times as the number of samples between kept points.
"""

import base64
import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import Array
from .layout import ROW, axis_suffix, band_on, label_on, line_on, on_row, stacked_layout
from .page import Figure
from .scales import ROUND_OFF, Scale

__all__ = [
    "ACHIEVED",
    "AFTER",
    "BEFORE",
    "BUCKETS",
    "RECORDED",
    "SUPPLY",
    "TARGET",
    "Row",
    "Trace",
    "envelope",
    "packed",
    "palette",
    "palette_traces",
    "time_figure",
]

BUCKETS = 1500  # stretches a channel is divided into; about one per pixel of a wide screen

# Okabe and Ito's colours, distinct in any colour vision; without their yellow, too pale on white.
BLACK, ORANGE, SKY, GREEN = "#000000", "#e69f00", "#56b4e9", "#009e73"
BLUE, VERMILLION, PURPLE = "#0072b2", "#d55e00", "#cc79a7"
CYCLE = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
GREY = "#a8aeb4"  # the target, a broad band under what was achieved
DASHES = ("solid", "dash", "dot", "dashdot")
TARGET: dict[str, Any] = {"color": GREY, "width": 3.2}
ACHIEVED: dict[str, Any] = {"color": BLUE, "width": 1.2}
RECORDED: dict[str, Any] = {"color": VERMILLION, "width": 1.2, "dash": "dot"}
BEFORE: dict[str, Any] = {"color": ORANGE, "width": 1.4}
AFTER: dict[str, Any] = {"color": BLUE, "width": 1.4}
SUPPLY: dict[str, Any] = {"color": BLACK, "width": 1.2, "dash": "dash"}


@dataclass(frozen=True)
class Trace:
    """One channel to draw: SI values (n,), a name and a plotly line style."""

    name: str
    values: Array
    line: Mapping[str, Any]
    folded: str = ""  # not drawn until this entry of the legend, shared by all of the row with the same, is switched on


@dataclass(frozen=True)
class Row:
    """One plot of a figure that stacks several over a common time axis."""

    title: str
    traces: Sequence[Trace]
    scale: Scale
    lines: Mapping[str, float] = field(default_factory=dict)  # label: level of a horizontal line, SI
    span: tuple[float, float] | None = None  # limits of the value axis, SI
    note: str = ""  # after the title and its unit


def envelope(values: Array, buckets: int = BUCKETS) -> NDArray[np.int64]:
    """Return the indices of the samples to draw: extremes of each bucket, and both ends of the record.

    `values` has shape (n,). Not-a-number samples never hide a peak beside them.
    """
    n = len(values)
    if n <= 2 * buckets:
        return np.arange(n)
    size = -(-n // buckets)
    starts = np.arange(0, n, size)
    padded = np.full(len(starts) * size, np.nan)
    padded[:n] = values
    rows = padded.reshape(-1, size)
    gaps = np.isnan(rows)
    lowest = np.where(gaps, np.inf, rows).argmin(axis=1) + starts
    highest = np.where(gaps, -np.inf, rows).argmax(axis=1) + starts
    return np.unique(np.concatenate([[0, n - 1], lowest, highest]))


def palette(count: int) -> list[dict[str, Any]]:
    """Return `count` line styles that differ in colour, then in dash."""
    n = len(CYCLE)
    return [{"color": CYCLE[k % n], "dash": DASHES[k // n % len(DASHES)], "width": 1.2} for k in range(count)]


def palette_traces(names: Sequence[str], values: Array) -> list[Trace]:
    """Return a trace of every column of `values` (n, len(names)), each in a style of its own."""
    return [Trace(*one) for one in zip(names, values.T, palette(len(names)), strict=True)]


def time_figure(
    name: str,
    title: str,
    description: str,
    rows: Sequence[Row],
    *,
    start: float,
    step: float,
    buckets: int = BUCKETS,
    window: tuple[int, int] | None = None,
    bands: Sequence[tuple[float, float]] = (),
    band_color: str = SKY,
    alone: bool = False,
    row_height: int = ROW,
) -> Figure:
    """Return a figure of `rows` over one time axis, zoomed with all others of the page unless `alone`.

    `start` and `step` are the first sample's time and the sample interval [s]. With `window`, first and last sample of
    a stretch, every sample of that stretch is drawn, on a time axis of its own. `bands` shades stretches of time, for
    instance the one a close-up shows, in `band_color`. Names are escaped: plotly reads HTML in its labels.
    """
    first, last = window or (0, None)
    if window:
        buckets, alone = window[1] - window[0], True
    titles = [(row.title if row.scale.unit == "1" else f"{row.title} [{row.scale.unit}]") + row.note for row in rows]
    layout = stacked_layout(titles, "Time [s]", row_height=row_height, linked=not alone)
    traces: list[dict[str, Any]] = []
    for k, row in enumerate(rows):
        factor = row.scale.factor
        if row.span:
            layout[f"yaxis{axis_suffix(k)}"]["range"] = [level * factor for level in row.span]
        heads = {trace.folded: trace for trace in reversed(row.traces)}  # the first of each folded group
        for trace in row.traces:
            lines = _curve(trace, trace.values[first:last], factor, start + first * step, step, buckets) | on_row(k)
            if trace.folded:
                lines |= {"name": html.escape(trace.folded), "visible": "legendonly", "legendgroup": trace.folded}
                lines |= {"showlegend": heads[trace.folded] is trace}
                lines |= {"hovertemplate": f"%{{y:.4~g}}<extra>{html.escape(trace.name)}</extra>"}
            traces.append(lines)
        for label, level in row.lines.items():
            layout["shapes"].append(line_on(k, y=level * factor))
            layout["annotations"].append(label_on(k, label, level * factor))
        layout["shapes"] += [band_on(k, band_color, x=ends) for ends in bands]
    return Figure(name, title, description, traces, layout, layout["height"])


def _curve(trace: Trace, values: Array, factor: float, start: float, step: float, buckets: int) -> dict[str, Any]:
    """Plotly's trace of the samples `values` of a channel."""
    kept = envelope(values, buckets)
    jumps = np.diff(kept, prepend=0)
    dtype = next(code for code in ("u1", "u2", "u4") if jumps.max() <= np.iinfo(code).max)
    times = {"start": start, "step": step, "dtype": dtype, "bdata": _base64(jumps.astype(f"<{dtype}"))}
    line = {"type": "scatter", "mode": "lines", "name": html.escape(trace.name), "line": dict(trace.line)}
    shown = values[kept] * factor
    if np.all(np.abs(shown[np.isfinite(shown)]) < ROUND_OFF):
        shown *= 0.0  # no axis in femtonewtons
    return line | {"x": times, "y": packed(shown)}


def packed(values: Array) -> dict[str, str]:
    """Return values as plotly reads them from base64: float32, little-endian."""
    return {"dtype": "f4", "bdata": _base64(values.astype("<f4"))}


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(values.tobytes()).decode()
