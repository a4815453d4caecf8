"""The frame of every figure: rows over one x axis, each with a title and a legend, and the lines and bands on them."""

import html
import math
from collections.abc import Sequence
from typing import Any

__all__ = ["ROW", "axis_suffix", "level_label", "level_line", "log_ticks", "on_row", "stacked_layout", "time_band"]

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

    `linked` says that the x axis is the page's time axis, zoomed with all others.
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
        suffix = axis_suffix(k)
        top = 1.0 - k * (row_height + GAP) / inner
        bottom = max(top - row_height / inner, 0.0)
        layout[f"yaxis{suffix}"] = {"domain": [bottom, top], "anchor": f"x{suffix}", "nticks": 6}
        xaxis: dict[str, Any] = {"anchor": f"y{suffix}", "showticklabels": k == len(titles) - 1}
        if k == len(titles) - 1:
            xaxis["title"] = {"text": html.escape(x_title), "standoff": 6}
        layout[f"xaxis{suffix}"] = xaxis | ({} if k == 0 else {"matches": "x"})
        layout["annotations"].append(_row_title(title, top))
        legend = {"orientation": "h", "x": 1, "xanchor": "right", "y": top, "yanchor": "bottom", "tracegroupgap": 0}
        layout[f"legend{suffix}"] = legend | {"bgcolor": "rgba(0,0,0,0)", "font": {"size": 11}}
    return layout


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


def log_ticks(low: float, high: float) -> dict[str, Any]:
    """Return ticks of a logarithmic axis: at 1, 2 and 5 over a few decades, at powers of ten over many."""
    if not 0.0 < high < 300.0 * low:
        return {"dtick": 1, "exponentformat": "power"}
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return {"tickvals": [float(f"{m}e{d}") for d in decades for m in (1, 2, 5)]}


def level_line(level: float, k: int) -> dict[str, Any]:
    """Return a dashed horizontal line over row `k`."""
    suffix = axis_suffix(k)
    place = {
        "type": "line",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "yref": f"y{suffix}",
        "y0": level,
        "y1": level,
    }
    return place | {"line": {"color": "#000000", "width": 1.2, "dash": "dash"}}


def level_label(label: str, level: float, k: int) -> dict[str, Any]:
    """Return the words on a horizontal line of row `k`."""
    place = {
        "x": 1,
        "xref": "paper",
        "xanchor": "right",
        "y": level,
        "yref": f"y{axis_suffix(k)}",
        "yanchor": "bottom",
    }
    return place | {"text": html.escape(label), "showarrow": False, "font": {"size": 11}}


def time_band(begin: float, end: float, k: int, color: str) -> dict[str, Any]:
    """Return a shaded stretch of the x axis of row `k`."""
    suffix = axis_suffix(k)
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
