"""Figures over something else than time: frequencies, iterations, harmonics.

Values are drawn as they are given, in the unit that a panel's title names; envelopes are for channels (`plots`).
"""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .layout import ROW, axis_suffix, level_label, level_line, log_ticks, on_row, stacked_layout
from .page import Figure
from .plots import packed

__all__ = ["FREQUENCY_TICKS", "Curve", "Panel", "Plot", "XAxis", "chart_figure", "grid_figure", "matrix_figure"]

FREQUENCY_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 40)  # [Hz]
BAND_COLOR = "#009e73"
LABEL_COLOR = "rgba(255,255,255,0.8)"  # behind words on a line: curves may cross them
CELL = 92  # [CSS px] height of one plot of a matrix
BETWEEN = 66  # [CSS px] between the rows of a grid
MATRIX_WIDTH = 720  # [CSS px] below which a matrix scrolls sideways


@dataclass(frozen=True)
class Curve:
    """Points (n,) to draw: a line, a line with markers, or bars."""

    name: str
    x: ArrayLike
    y: ArrayLike
    style: Mapping[str, Any]  # plotly line
    kind: str = "lines"  # or "lines+markers", "bar"


@dataclass(frozen=True)
class Panel:
    """One plot of a figure that stacks several over a common x axis."""

    title: str  # with its unit
    curves: Sequence[Curve]
    log: bool = False
    span: tuple[float, float] | None = None
    band: tuple[float, float] | None = None  # shaded values
    lines: Mapping[str, float] = field(default_factory=dict)  # label: level of a horizontal line


@dataclass(frozen=True)
class Plot:
    """One plot of a grid of plots, each with its own axes."""

    title: str  # with its unit
    x_title: str
    curves: Sequence[Curve]


@dataclass(frozen=True)
class XAxis:
    """What a figure's panels are drawn over."""

    title: str
    log: bool = False
    span: tuple[float, float] | None = None
    ticks: Sequence[float] | None = None


def chart_figure(
    name: str,
    title: str,
    description: str,
    panels: Sequence[Panel],
    x: XAxis,
    *,
    row_height: int = ROW,
    marks: Sequence[float] = (),
) -> Figure:
    """Return a figure of `panels`; dotted vertical lines at `marks`. Curves of one name share a legend entry."""
    layout = stacked_layout([panel.title for panel in panels], x.title, row_height=row_height)
    traces, named = [], set()
    for k, panel in enumerate(panels):
        layout[f"xaxis{axis_suffix(k)}"] |= _scaled(x.log, x.span) | ({"tickvals": list(x.ticks)} if x.ticks else {})
        layout[f"yaxis{axis_suffix(k)}"] |= _scaled(panel.log, panel.span)
        if panel.log:
            layout[f"yaxis{axis_suffix(k)}"] |= _decades(panel)
        for curve in panel.curves:
            traces.append(_trace(curve) | on_row(k) | {"showlegend": curve.name not in named})
            named.add(curve.name)
        if panel.band:
            layout["shapes"].append(_value_band(*panel.band, k))
        for label, level in panel.lines.items():
            layout["shapes"].append(level_line(level, k))
            place = float(np.log10(level)) if panel.log else level  # an annotation's place is in decades
            layout["annotations"].append(level_label(label, place, k) | {"bgcolor": LABEL_COLOR})
        layout["shapes"] += [_mark(place, k) for place in marks]
    return Figure(name, title, description, traces, layout, layout["height"])


def matrix_figure(
    name: str,
    title: str,
    description: str,
    labels: Sequence[str],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    style: Mapping[str, Any],
    span: tuple[float, float],
) -> Figure:
    """Return small plots of y (m, n, n) over x (m,) [Hz] on one scale, rows outputs, columns inputs."""
    n = len(labels)
    above, below = 30, 50
    layout: dict[str, Any] = {
        "height": above + n * CELL + below,
        "margin": {"l": 64, "r": 10, "t": above, "b": below},
        "meta": {"linked": False, "row": CELL},
        "annotations": [],
        "showlegend": False,
    }
    traces = []
    for row in range(n):
        for column in range(n):
            k = row * n + column
            suffix = axis_suffix(k)
            own = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}
            words = f"{labels[column]} to {labels[row]}"
            traces.append(_trace(Curve(words, x, y[:, row, column], style)) | own)
            across = [(column + 0.04) / n, (column + 0.96) / n]
            up = [1.0 - (row + 0.95) / n, 1.0 - (row + 0.05) / n]
            layout[f"xaxis{suffix}"] = {"domain": across, "anchor": f"y{suffix}", "showticklabels": row == n - 1}
            layout[f"xaxis{suffix}"] |= _scaled(True, (x[0], x[-1])) | {"tickvals": [1, 10], "matches": "x"}
            layout[f"yaxis{suffix}"] = {"domain": up, "anchor": f"x{suffix}", "showticklabels": column == 0}
            layout[f"yaxis{suffix}"] |= {"range": list(span), "nticks": 4, "matches": "y"}
        layout["annotations"].append(_heading(labels[row], x=0.0, y=1.0 - (row + 0.5) / n, turned=True))
    del layout["xaxis"]["matches"], layout["yaxis"]["matches"]
    heads = [_heading(f"from {label}", x=(c + 0.5) / n, y=1.0) for c, label in enumerate(labels)]
    layout["annotations"] += [*heads, _heading("Frequency [Hz]", x=0.5, y=0.0, below=True)]
    return Figure(name, title, description, traces, layout, layout["height"], MATRIX_WIDTH)


def grid_figure(
    name: str, title: str, description: str, rows: Sequence[Sequence[Plot]], *, cell: int, gap: float
) -> Figure:
    """Return rows of equally many plots, `cell` [CSS px] high; curves are named once, by the first.

    `gap` is what is left free at the left of a column, as a share of it.
    """
    columns, above, below = len(rows[0]), 44, 50
    height = above + len(rows) * cell + (len(rows) - 1) * BETWEEN + below
    inner = height - above - below
    layout: dict[str, Any] = {
        "height": height,
        "margin": {"l": 62, "r": 12, "t": above, "b": below},
        "meta": {"linked": False, "row": cell},
        "annotations": [],
        "hovermode": "closest",
        "legend": {"orientation": "h", "x": 1, "xanchor": "right", "y": 1 + 20 / inner, "yanchor": "bottom"},
    }
    traces = []
    for r, row in enumerate(rows):
        top = 1.0 - r * (cell + BETWEEN) / inner
        for c, plot in enumerate(row):
            suffix = axis_suffix(r * columns + c)
            across = [(c + (gap if c else 0.0)) / columns, (c + 0.97) / columns]
            words = {"text": plot.x_title, "standoff": 4, "font": {"size": 11}}
            layout[f"xaxis{suffix}"] = {"domain": across, "anchor": f"y{suffix}", "nticks": 6, "title": words}
            up = [max(top - cell / inner, 0.0), top]
            layout[f"yaxis{suffix}"] = {"domain": up, "anchor": f"x{suffix}", "nticks": 6}
            layout["annotations"].append(_heading(plot.title, x=across[0], y=top) | {"xanchor": "left"})
            own = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "showlegend": r == c == 0}
            traces += [_trace(curve) | own for curve in plot.curves]
    return Figure(name, title, description, traces, layout, height, 300 * columns)


def _trace(curve: Curve) -> dict[str, Any]:
    values = {"x": packed(np.asarray(curve.x, float)), "y": packed(np.asarray(curve.y, float))}
    shared = {"name": html.escape(curve.name), "legendgroup": html.escape(curve.name)} | values
    if curve.kind == "bar":
        return shared | {"type": "bar", "marker": {"color": curve.style["color"]}}
    line = {"type": "scatter", "mode": curve.kind, "line": dict(curve.style)}
    return shared | line | ({"marker": {"size": 7}} if "markers" in curve.kind else {})


def _scaled(log: bool, span: tuple[float, float] | None) -> dict[str, Any]:
    """Type and range of an axis; plotly wants the ends of a logarithmic one in decades."""
    scale: dict[str, Any] = {"type": "log"} if log else {}
    if span:
        scale["range"] = [float(v) for v in (np.log10(span) if log else span)]
    return scale


def _decades(panel: Panel) -> dict[str, Any]:
    """Ticks of a logarithmic value axis."""
    drawn = np.concatenate([np.ravel(curve.y) for curve in panel.curves]) if panel.curves else np.ones(1)
    low, high = panel.span or (np.min(drawn[drawn > 0.0], initial=np.inf), np.max(drawn, initial=0.0))
    return log_ticks(float(low), float(high))


def _value_band(low: float, high: float, k: int) -> dict[str, Any]:
    place = {"type": "rect", "xref": "paper", "x0": 0, "x1": 1, "yref": f"y{axis_suffix(k)}", "y0": low, "y1": high}
    return place | {"fillcolor": BAND_COLOR, "opacity": 0.14, "line": {"width": 0}, "layer": "below"}


def _mark(place: float, k: int) -> dict[str, Any]:
    suffix = axis_suffix(k)
    ends = {"type": "line", "xref": f"x{suffix}", "x0": place, "x1": place, "yref": f"y{suffix} domain"}
    return ends | {"y0": 0, "y1": 1, "line": {"color": "#57606a", "width": 1.2, "dash": "dot"}}


def _heading(words: str, *, x: float, y: float, turned: bool = False, below: bool = False) -> dict[str, Any]:
    place: dict[str, Any] = {"x": x, "y": y, "xref": "paper", "yref": "paper", "showarrow": False}
    place |= {"xanchor": "center", "yanchor": "top" if below else "bottom", "yshift": -20 if below else 3}
    if turned:
        place |= {"textangle": -90, "xshift": -52, "yanchor": "middle", "yshift": 0}
    return place | {"text": html.escape(words) if below else f"<b>{html.escape(words)}</b>", "font": {"size": 12}}
