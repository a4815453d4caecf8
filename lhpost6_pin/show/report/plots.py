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
from scipy.constants import g

from .layout import ROW, axis_suffix, level_label, level_line, on_row, stacked_layout, time_band
from .page import Figure

__all__ = [
    "ACHIEVED",
    "AFTER",
    "BEFORE",
    "BUCKETS",
    "RECORDED",
    "SCALES",
    "SUPPLY",
    "TARGET",
    "Row",
    "Scale",
    "Trace",
    "envelope",
    "packed",
    "palette",
    "spectrum_figure",
    "time_figure",
]

BUCKETS = 1500  # stretches a channel is divided into; about one per pixel of a wide screen
PERIOD_TICKS = (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10)  # [s]

# Okabe and Ito's colours, told apart with any colour vision; their yellow is left out, too pale on white.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE = (
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#009e73",
    "#0072b2",
    "#d55e00",
    "#cc79a7",
)
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
class Scale:
    """How an SI quantity is shown to people: shown value = SI value times `factor`, in `unit`."""

    factor: float
    unit: str


SCALES: dict[str, Scale] = {
    "displacement": Scale(1e3, "mm"),
    "velocity": Scale(1.0, "m/s"),
    "acceleration": Scale(1.0 / g, "g"),
    "rotation": Scale(180.0 / np.pi, "deg"),
    "rotation velocity": Scale(180.0 / np.pi, "deg/s"),
    "rotation acceleration": Scale(180.0 / np.pi, "deg/s²"),
    "force": Scale(1e-6, "MN"),
    "pressure": Scale(1e-6, "MPa"),
    "time": Scale(1e3, "ms"),
    "ratio": Scale(1.0, "1"),
}


@dataclass(frozen=True)
class Trace:
    """One channel to draw: SI values (n,), a name and a plotly line style."""

    name: str
    values: NDArray[np.float64]
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
    note: str = ""  # said after the title and its unit


def envelope(values: NDArray[np.float64], buckets: int = BUCKETS) -> NDArray[np.int64]:
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


def time_figure(
    name: str,
    title: str,
    description: str,
    rows: Sequence[Row],
    *,
    start: float,
    step: float,
    buckets: int = BUCKETS,
    bands: Sequence[tuple[float, float]] = (),
    band_color: str = SKY,
    alone: bool = False,
    row_height: int = ROW,
) -> Figure:
    """Return a figure of `rows` over one time axis, zoomed with all others of the page unless `alone`.

    `start` and `step` are the first sample's time and the sample interval [s]; `bands` shades stretches of
    time, for instance the one a close-up shows, in `band_color`. Names are escaped: plotly reads HTML in its labels.
    """
    titles = [_titled(row.title, row.scale) + row.note for row in rows]
    layout = stacked_layout(titles, "Time [s]", row_height=row_height, linked=not alone)
    traces: list[dict[str, Any]] = []
    for k, row in enumerate(rows):
        if row.span:
            layout[f"yaxis{axis_suffix(k)}"]["range"] = [level * row.scale.factor for level in row.span]
        traces += [lines | on_row(k) for lines in _time_traces(row, start, step, buckets)]
        for label, level in row.lines.items():
            layout["shapes"].append(level_line(level * row.scale.factor, k))
            layout["annotations"].append(level_label(label, level * row.scale.factor, k))
        for begin, end in bands:
            layout["shapes"].append(time_band(begin, end, k, band_color))
    return Figure(name, title, description, traces, layout, layout["height"])


def spectrum_figure(
    name: str,
    title: str,
    description: str,
    periods: NDArray[np.float64],
    curves: Mapping[str, tuple[NDArray[np.float64], Mapping[str, Any]]],
    scale: Scale,
) -> Figure:
    """Return response spectra, `curves` of label: (spectral values SI (n,), line), over `periods` [s]."""
    traces = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": html.escape(label),
            "x": packed(periods),
            "y": packed(values * scale.factor),
            "line": dict(line),
        }
        for label, (values, line) in curves.items()
    ]
    layout = stacked_layout([_titled("PSA", scale)], "Period [s]", row_height=230)
    layout["xaxis"] |= {"type": "log", "tickvals": PERIOD_TICKS}
    layout["yaxis"] |= {"rangemode": "tozero"}
    return Figure(name, title, description, traces, layout, layout["height"])


def _time_traces(row: Row, start: float, step: float, buckets: int) -> list[dict[str, Any]]:
    drawn = []
    heads = {trace.folded: trace for trace in reversed(row.traces)}  # the first of each folded group
    for trace in row.traces:
        lines = _time_trace(trace, row.scale, start, step, buckets)
        if trace.folded:
            lines |= {"name": html.escape(trace.folded), "visible": "legendonly", "legendgroup": trace.folded}
            lines |= {"showlegend": heads[trace.folded] is trace}
            lines |= {"hovertemplate": f"%{{y:.4~g}}<extra>{html.escape(trace.name)}</extra>"}
        drawn.append(lines)
    return drawn


def _time_trace(trace: Trace, scale: Scale, start: float, step: float, buckets: int) -> dict[str, Any]:
    kept = envelope(trace.values, buckets)
    jumps = np.diff(kept, prepend=0)
    dtype = next(code for code in ("u1", "u2", "u4") if jumps.max() <= np.iinfo(code).max)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": html.escape(trace.name),
        "x": {"start": start, "step": step, "dtype": dtype, "bdata": _base64(jumps.astype(f"<{dtype}"))},
        "y": packed(trace.values[kept] * scale.factor),
        "line": dict(trace.line),
    }


def packed(values: NDArray[np.float64]) -> dict[str, str]:
    """Return values as plotly reads them from base64: float32, little-endian."""
    return {"dtype": "f4", "bdata": _base64(values.astype("<f4"))}


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(values.tobytes()).decode()


def _titled(words: str, scale: Scale) -> str:
    return words if scale.unit == "1" else f"{words} [{scale.unit}]"
