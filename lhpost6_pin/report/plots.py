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

from .page import Figure

__all__ = [
    "ACHIEVED",
    "BUCKETS",
    "RECORDED",
    "SCALES",
    "SUPPLY",
    "TARGET",
    "Row",
    "Scale",
    "Trace",
    "envelope",
    "palette",
    "spectrum_figure",
    "time_figure",
]

BUCKETS = 1500  # stretches a channel is divided into; about one per pixel of a wide screen
ROW, GAP, TOP, BOTTOM = (
    170,
    48,
    40,
    44,
)  # [CSS px] height of a row, between rows, above the first, below the last

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
    height = TOP + len(rows) * row_height + (len(rows) - 1) * GAP + BOTTOM
    inner = height - TOP - BOTTOM
    layout: dict[str, Any] = {
        "height": height,
        "margin": {"l": 52, "r": 14, "t": TOP, "b": BOTTOM},
        "annotations": [],
        "shapes": [],
        "meta": {"linked": not alone, "row": row_height},
    }
    traces: list[dict[str, Any]] = []
    last = "" if len(rows) == 1 else str(len(rows))
    for k, row in enumerate(rows):
        suffix = "" if k == 0 else str(k + 1)
        top = 1.0 - k * (row_height + GAP) / inner
        bottom = max(top - row_height / inner, 0.0)
        layout[f"yaxis{suffix}"] = {"domain": [bottom, top], "anchor": f"x{suffix}", "nticks": 6}
        if row.span:
            layout[f"yaxis{suffix}"]["range"] = [level * row.scale.factor for level in row.span]
        xaxis: dict[str, Any] = {"anchor": f"y{suffix}", "showticklabels": suffix == last}
        if suffix == last:
            xaxis["title"] = {"text": "Time [s]", "standoff": 6}
        layout[f"xaxis{suffix}"] = xaxis | ({} if k == 0 else {"matches": "x"})
        layout["annotations"].append(_row_title(_titled(row.title, row.scale) + row.note, top))
        legend = {
            "orientation": "h",
            "x": 1,
            "xanchor": "right",
            "y": top,
            "yanchor": "bottom",
            "tracegroupgap": 0,
        }
        layout[f"legend{suffix}"] = legend | {"bgcolor": "rgba(0,0,0,0)", "font": {"size": 11}}
        axes = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "legend": f"legend{suffix}"}
        traces += [lines | axes for lines in _time_traces(row, start, step, buckets)]
        for label, level in row.lines.items():
            layout["shapes"].append(_level(level * row.scale.factor, suffix))
            layout["annotations"].append(_level_label(label, level * row.scale.factor, suffix))
        for begin, end in bands:
            layout["shapes"].append(_band(begin, end, suffix, band_color))
    return Figure(name, title, description, traces, layout, height)


def spectrum_figure(
    name: str,
    title: str,
    description: str,
    periods: NDArray[np.float64],
    curves: Mapping[str, tuple[NDArray[np.float64], Mapping[str, Any]]],
    scale: Scale,
) -> Figure:
    """Return response spectra, `curves` of label: (spectral values SI (n,), line), over `periods` [s]."""
    row = 230
    height = TOP + row + BOTTOM
    traces = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": html.escape(label),
            "x": _packed(periods),
            "y": _packed(values * scale.factor),
            "line": dict(line),
        }
        for label, (values, line) in curves.items()
    ]
    layout = {
        "height": height,
        "margin": {"l": 52, "r": 14, "t": TOP, "b": BOTTOM},
        "meta": {"linked": False, "row": row},
        "xaxis": {"type": "log", "title": {"text": "Period [s]", "standoff": 6}, "tickvals": PERIOD_TICKS},
        "yaxis": {"rangemode": "tozero", "nticks": 6},
        "annotations": [_row_title(_titled("PSA", scale), 1.0)],
        "legend": {
            "orientation": "h",
            "x": 1,
            "xanchor": "right",
            "y": 1,
            "yanchor": "bottom",
            "font": {"size": 11},
        },
    }
    return Figure(name, title, description, traces, layout, height)


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
        "y": _packed(trace.values[kept] * scale.factor),
        "line": dict(trace.line),
    }


def _packed(values: NDArray[np.float64]) -> dict[str, str]:
    return {"dtype": "f4", "bdata": _base64(values.astype("<f4"))}


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(values.tobytes()).decode()


def _titled(words: str, scale: Scale) -> str:
    return words if scale.unit == "1" else f"{words} [{scale.unit}]"


def _row_title(words: str, top: float) -> dict[str, Any]:
    place = {
        "x": 0,
        "xref": "paper",
        "xanchor": "left",
        "y": top,
        "yref": "paper",
        "yanchor": "bottom",
        "yshift": 5,
    }
    return place | {
        "name": "title",
        "text": f"<b>{html.escape(words)}</b>",
        "showarrow": False,
        "font": {"size": 12},
    }


def _level(level: float, suffix: str) -> dict[str, Any]:
    place = {
        "type": "line",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "yref": f"y{suffix}",
        "y0": level,
        "y1": level,
    }
    return place | {"line": {"color": BLACK, "width": 1.2, "dash": "dash"}}


def _level_label(label: str, level: float, suffix: str) -> dict[str, Any]:
    place = {
        "x": 1,
        "xref": "paper",
        "xanchor": "right",
        "y": level,
        "yref": f"y{suffix}",
        "yanchor": "bottom",
    }
    return place | {"text": html.escape(label), "showarrow": False, "font": {"size": 11}}


def _band(begin: float, end: float, suffix: str, color: str) -> dict[str, Any]:
    place = {
        "type": "rect",
        "xref": f"x{suffix}",
        "x0": begin,
        "x1": end,
        "yref": f"y{suffix} domain",
        "y0": 0,
        "y1": 1,
    }
    return place | {"fillcolor": color, "opacity": 0.18, "line": {"width": 0}, "layer": "below"}
