"""Figures over something else than time: frequencies, iterations, harmonics, other channels.

Values are drawn as they are given, in the unit that a panel's title names; envelopes are for channels (`plots`).
"""

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.arrays import Array
from .layout import ROW, axis_suffix, band_on, heading, label_on, line_on, log_ticks, on_row, stacked_layout
from .page import Figure
from .plots import packed
from .scales import Scale

__all__ = ["Curve", "Panel", "Plot", "XAxis", "chart_figure", "frequency_axis", "grid_figure"]
__all__ += ["matrix_figure", "spectra_figure", "with_peaks"]

TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)  # [Hz]
BAND_COLOR = "#009e73"
LABEL_COLOR = "rgba(255,255,255,0.8)"  # behind words on a line: curves may cross them
CELL = 92  # [CSS px] height of one plot of a matrix
DOT = 1.5  # size of a point over the width of a line of the same style
BETWEEN = 66  # [CSS px] between the rows of a grid
MATRIX_WIDTH = 720  # [CSS px] below which a matrix scrolls sideways


@dataclass(frozen=True)
class Curve:
    """Points (n,) to draw: a line, a line with markers, points alone, or bars."""

    name: str
    x: ArrayLike
    y: ArrayLike
    style: Mapping[str, Any]  # plotly line
    kind: str = "lines"  # or "lines+markers", "markers", "bar"


def with_peaks(span: tuple[float, float], curves: Sequence[Curve]) -> tuple[float, float]:
    """A span [dB] whose upper end, in steps of three, leaves no peak of the curves out."""
    top = max((float(np.nanmax(np.asarray(c.y, float), initial=span[1])) for c in curves), default=span[1])
    return span[0], max(span[1], 3.0 * math.ceil(top / 3.0)) if math.isfinite(top) else span[1]


@dataclass(frozen=True)
class Panel:
    """One plot of a figure that stacks several over a common x axis."""

    title: str  # with its unit
    curves: Sequence[Curve]
    log: bool = False
    span: tuple[float, float] | None = None
    band: tuple[float, float] | None = None  # shaded values
    lines: Mapping[str, float] = field(default_factory=dict)  # label: level of a horizontal line
    from_zero: bool = False


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


def frequency_axis(low: float, high: float) -> XAxis:
    """Return a logarithmic axis of frequencies [Hz]."""
    ticks = [f for f in TICKS if low <= f <= high]
    end = [high] if high >= 2.0 * ticks[-1] else []
    return XAxis("Frequency [Hz]", log=True, span=(low, high), ticks=ticks + end)


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
        across, up = layout[f"xaxis{axis_suffix(k)}"], layout[f"yaxis{axis_suffix(k)}"]
        across |= _scaled(x.log, x.span) | ({"tickvals": list(x.ticks)} if x.ticks else {})
        up |= _scaled(panel.log, panel.span) | (_decades(panel) if panel.log else {})
        up |= {"rangemode": "tozero"} if panel.from_zero else {}
        for curve in panel.curves:
            traces.append(_trace(curve) | on_row(k) | {"showlegend": curve.name not in named})
            named.add(curve.name)
        if panel.band:
            layout["shapes"].append(band_on(k, BAND_COLOR, y=panel.band, opacity=0.14))
        for label, level in panel.lines.items():
            layout["shapes"].append(line_on(k, y=level))
            place = float(np.log10(level)) if panel.log else level  # an annotation's place is in decades
            layout["annotations"].append(label_on(k, label, place) | {"bgcolor": LABEL_COLOR})
        layout["shapes"] += [line_on(k, x=place) for place in marks]
    return Figure(name, title, description, traces, layout, layout["height"])


def spectra_figure(
    name: str,
    title: str,
    description: str,
    spectra: Sequence[tuple[str, Array, Mapping[str, Any]]],
    frequency: Array,
    scale: Scale,
    shown: tuple[float, float],
    *,
    decades: float | None = None,
    row_height: int = ROW,
    marks: Sequence[float] = (),
) -> Figure:
    """Return amplitude spectral densities, `spectra` of name, power (m,) SI and line, over `frequency` [Hz].

    `shown` is the band drawn; of values, that many decades below the largest, or all.
    """
    curves = []
    for label, power, line in spectra:
        drawn = (frequency >= shown[0]) & (frequency <= shown[1]) & (power > 0.0)
        curves.append(Curve(label, frequency[drawn], scale.factor * np.sqrt(power[drawn]), line))
    top = max((float(np.max(np.asarray(c.y))) for c in curves if np.size(c.y)), default=1.0)
    span = (10.0**-decades * top, 2.0 * top) if decades else None
    panel = Panel(f"Spectral density [{scale.unit}/√Hz]", curves, log=True, span=span)
    return chart_figure(name, title, description, [panel], frequency_axis(*shown), row_height=row_height, marks=marks)


def matrix_figure(
    name: str,
    title: str,
    description: str,
    labels: Sequence[str],
    x: Array,
    y: Array,
    style: Mapping[str, Any],
    span: tuple[float, float],
) -> Figure:
    """Return small plots of y (m, n, n) over x (m,) [Hz] on one scale, rows outputs, columns inputs."""
    n = len(labels)
    layout = _cells_layout(n, CELL, 0, above=30, left=64, right=10) | {"showlegend": False}
    traces = []
    for k in range(n * n):
        row, column = divmod(k, n)
        traces.append(_trace(Curve(f"{labels[column]} to {labels[row]}", x, y[:, row, column], style)) | _own_axes(k))
        across = [(column + 0.04) / n, (column + 0.96) / n]
        up = [1.0 - (row + 0.95) / n, 1.0 - (row + 0.05) / n]
        shared: tuple[dict[str, str], dict[str, str]] = ({"matches": "x"}, {"matches": "y"}) if k else ({}, {})
        frequencies = _scaled(True, (x[0], x[-1])) | {"tickvals": [1, 10]} | shared[0]
        _place_cell(layout, k, across, up, {"showticklabels": row == n - 1} | frequencies)
        values = {"range": list(span), "nticks": 4} | shared[1]
        layout[f"yaxis{axis_suffix(k)}"] |= {"showticklabels": column == 0} | values
    turned = {"textangle": -90, "xshift": -52, "yanchor": "middle", "yshift": 0}
    layout["annotations"] += [heading(label, x=0.0, y=1.0 - (r + 0.5) / n) | turned for r, label in enumerate(labels)]
    layout["annotations"] += [heading(f"from {label}", x=(c + 0.5) / n, y=1.0) for c, label in enumerate(labels)]
    below = {"text": "Frequency [Hz]", "yanchor": "top", "yshift": -20}
    layout["annotations"].append(heading("", x=0.5, y=0.0) | below)
    return Figure(name, title, description, traces, layout, layout["height"], MATRIX_WIDTH)


def grid_figure(
    name: str, title: str, description: str, rows: Sequence[Sequence[Plot]], *, cell: int, gap: float
) -> Figure:
    """Return rows of equally many plots, `cell` [CSS px] high; curves are named once, by the first.

    `gap` is what is left free at the left of a column, as a share of it.
    """
    columns = len(rows[0])
    layout = _cells_layout(len(rows), cell, BETWEEN, above=44, left=62, right=12) | {"hovermode": "closest"}
    inner = len(rows) * cell + (len(rows) - 1) * BETWEEN
    layout["legend"] = {"orientation": "h", "x": 1, "xanchor": "right", "y": 1 + 20 / inner, "yanchor": "bottom"}
    layout["legend"]["itemsizing"] = "constant"  # markers of a pixel have a visible colour there
    traces = []
    for k, plot in enumerate(plot for row in rows for plot in row):
        r, c = divmod(k, columns)
        top = 1.0 - r * (cell + BETWEEN) / inner
        across, up = [(c + (gap if c else 0.0)) / columns, (c + 0.97) / columns], [max(top - cell / inner, 0.0), top]
        words = {"text": plot.x_title, "standoff": 4, "font": {"size": 11}}
        _place_cell(layout, k, across, up, {"nticks": 6, "title": words})
        layout[f"yaxis{axis_suffix(k)}"]["nticks"] = 6
        layout["annotations"].append(heading(plot.title, x=across[0], y=top) | {"xanchor": "left"})
        traces += [_trace(curve) | _own_axes(k) | {"showlegend": k == 0} for curve in plot.curves]
    return Figure(name, title, description, traces, layout, layout["height"], 300 * columns)


def _cells_layout(rows: int, cell: int, between: int, *, above: int, left: int, right: int) -> dict[str, Any]:
    """Layout of a figure of rows of plots, still empty."""
    height, below = above + rows * cell + (rows - 1) * between + 50, 50
    margin = {"l": left, "r": right, "t": above, "b": below}
    return {"height": height, "margin": margin, "meta": {"linked": False, "row": cell}, "annotations": []}


def _place_cell(layout: dict[str, Any], k: int, across: list[float], up: list[float], xaxis: dict[str, Any]) -> None:
    """Add the axes of plot `k`, which take the shares `across` and `up` of the figure."""
    suffix = axis_suffix(k)
    layout[f"xaxis{suffix}"] = {"domain": across, "anchor": f"y{suffix}"} | xaxis
    layout[f"yaxis{suffix}"] = {"domain": up, "anchor": f"x{suffix}"}


def _own_axes(k: int) -> dict[str, str]:
    return {"xaxis": f"x{axis_suffix(k)}", "yaxis": f"y{axis_suffix(k)}"}


def _trace(curve: Curve) -> dict[str, Any]:
    values = {"x": packed(np.asarray(curve.x, float)), "y": packed(np.asarray(curve.y, float))}
    shared = {"name": html.escape(curve.name), "legendgroup": html.escape(curve.name)} | values
    if curve.kind == "bar":
        return shared | {"type": "bar", "marker": {"color": curve.style["color"]}}
    if curve.kind == "markers":
        dot = {"color": curve.style["color"], "size": DOT * curve.style["width"]}
        return shared | {"type": "scatter", "mode": "markers", "marker": dot}
    line = {"type": "scatter", "mode": curve.kind, "line": dict(curve.style)}
    return shared | line | ({"marker": {"size": 7}} if "markers" in curve.kind else {})


def _scaled(log: bool, span: tuple[float, float] | None) -> dict[str, Any]:
    """Type and range of an axis; plotly takes the ends of a logarithmic one in decades."""
    scale: dict[str, Any] = {"type": "log"} if log else {}
    if span:
        scale["range"] = [float(v) for v in (np.log10(span) if log else span)]
    return scale


def _decades(panel: Panel) -> dict[str, Any]:
    """Ticks of a logarithmic value axis."""
    drawn = np.concatenate([np.ravel(curve.y) for curve in panel.curves]) if panel.curves else np.ones(1)
    low, high = panel.span or (np.min(drawn[drawn > 0.0], initial=np.inf), np.max(drawn, initial=0.0))
    return log_ticks(float(low), float(high))
