"""The frame of every figure: rows over one x axis, each with a title and a legend, and the lines and bands on them."""

import html
import math
from collections.abc import Sequence
from typing import Any

__all__ = ["ROW", "axis_suffix", "band_on", "heading", "label_on", "line_on", "log_ticks", "on_row", "stacked_layout"]

ROW, GAP, TOP, BOTTOM = 170, 48, 40, 44  # [CSS px] height of a row, between rows, above the first, below the last


def axis_suffix(k: int) -> str:
    """What plotly appends to the names of the axes and the legend of row `k`."""
    return "" if k == 0 else str(k + 1)


def on_row(k: int) -> dict[str, str]:
    """Return what puts a trace on row `k`."""
    return {name: f"{name[0] if name != 'legend' else name}{axis_suffix(k)}" for name in ("xaxis", "yaxis", "legend")}


def stacked_layout(
    titles: Sequence[str], x_title: str, *, row_height: int = ROW, linked: bool = False
) -> dict[str, Any]:
    """Return the layout of rows over one x axis, each with a title and a legend above it.

    With `linked` the x axis is the page's time axis, zoomed with all others.
    """
    height = TOP + len(titles) * row_height + (len(titles) - 1) * GAP + BOTTOM
    inner = height - TOP - BOTTOM
    layout: dict[str, Any] = {
        "height": height,
        "margin": {"l": 52, "r": 14, "t": TOP, "b": BOTTOM},
        "annotations": [],
        "shapes": [],
        "meta": {"linked": linked, "row": row_height},
    }
    for k, title in enumerate(titles):
        suffix, last = axis_suffix(k), k == len(titles) - 1
        top = 1.0 - k * (row_height + GAP) / inner
        bottom = max(top - row_height / inner, 0.0)
        layout[f"yaxis{suffix}"] = {"domain": [bottom, top], "anchor": f"x{suffix}", "nticks": 6}
        layout[f"xaxis{suffix}"] = {"anchor": f"y{suffix}", "showticklabels": last}
        if last:
            layout[f"xaxis{suffix}"] |= {"title": {"text": html.escape(x_title), "standoff": 6}}
        if k:
            layout[f"xaxis{suffix}"] |= {"matches": "x"}
        layout["annotations"].append(heading(title, x=0, y=top) | {"name": "title", "xanchor": "left", "yshift": 5})
        legend = {"orientation": "h", "x": 1, "xanchor": "right", "y": top, "yanchor": "bottom", "tracegroupgap": 0}
        layout[f"legend{suffix}"] = legend | {"bgcolor": "rgba(0,0,0,0)", "font": {"size": 11}}
    return layout


def heading(words: str, *, x: float, y: float) -> dict[str, Any]:
    """Return bold words centred above a place, in shares of the figure."""
    place = {"x": x, "xref": "paper", "xanchor": "center", "y": y, "yref": "paper", "yanchor": "bottom", "yshift": 3}
    return place | {"text": f"<b>{html.escape(words)}</b>", "showarrow": False, "font": {"size": 12}}


def log_ticks(low: float, high: float) -> dict[str, Any]:
    """Return ticks of a logarithmic axis: at 1, 2 and 5 over a few decades, at powers of ten over many."""
    if not 0.0 < high < 300.0 * low:
        return {"dtick": 1, "exponentformat": "power"}
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return {"tickvals": [float(f"{m}e{d}") for d in decades for m in (1, 2, 5)]}


Ends = tuple[float, float] | None


def _place(k: int, x: Ends, y: Ends) -> dict[str, Any]:
    """Ends of a shape on row `k` along x or y, in data; it spans the row in the other direction."""
    suffix = axis_suffix(k)
    (x0, x1), (y0, y1) = x or (0, 1), y or (0, 1)
    across = {"xref": f"x{suffix}" if x else "paper", "x0": x0, "x1": x1}
    return across | {"yref": f"y{suffix}" if y else f"y{suffix} domain", "y0": y0, "y1": y1}


def line_on(k: int, *, x: float | None = None, y: float | None = None) -> dict[str, Any]:
    """Return a dotted vertical line at `x`, or a dashed horizontal one at `y`, on row `k`."""
    style = {"color": "#000000" if x is None else "#57606a", "width": 1.2, "dash": "dash" if x is None else "dot"}
    place = _place(k, None if x is None else (x, x), None if y is None else (y, y))
    return {"type": "line"} | place | {"line": style}


def band_on(k: int, color: str, *, x: Ends = None, y: Ends = None, opacity: float = 0.18) -> dict[str, Any]:
    """Return a shaded stretch of the x or the y axis of row `k`."""
    return (
        {"type": "rect"}
        | _place(k, x, y)
        | {"fillcolor": color, "opacity": opacity, "line": {"width": 0}}
        | {"layer": "below"}
    )


def label_on(k: int, label: str, level: float) -> dict[str, Any]:
    """Return the words on a horizontal line of row `k`; `level` in decades on a logarithmic axis."""
    place = {"x": 1, "xref": "paper", "xanchor": "right", "y": level, "yref": f"y{axis_suffix(k)}", "yanchor": "bottom"}
    return place | {"text": html.escape(label), "showarrow": False, "font": {"size": 11}}
