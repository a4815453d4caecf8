"""Figures of a search for missing effects: where the gap is, what explains it, how it shrinks, what has no name."""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...discovery import Discovery
from ...discovery.held_out import FLOOR
from ...discovery.localise import gap_map
from ...discovery.residual_function import ResidualFunction
from ...discovery.search_state import Round
from ...discovery.verdict_summary import where
from .layout import log_ticks, stacked_layout
from .page import Figure, Markup, paragraph, shaded, table, text
from .plots import BLACK, BLUE, GREY, VERMILLION

__all__ = ["gain_figure", "gap_figure", "residual_function_figure", "map_blocks"]

Array = NDArray[np.float64]

SHOWN = 10  # families in a figure
_SHADES = {0: 1.3, 2: 3.0, 3: 10.0, 4: np.inf}
"""Misfit up to which a cell has each shade."""

_KINDS = {
    "wrench": "Wrench",
    "flow": "Flow",
    "gas": "Gas law",
    "force": "Force against pressure",
    "servo": "Spool against command",
    "supply": "Supply pressure",
}


def map_blocks(found: Discovery) -> list[Markup]:
    """Return, for each kind of residual, the misfit of every column in every band, before and after."""
    problem = found.search.problem
    before, after = (gap_map(problem, rest) for rest in (found.search.refit.normal.residual, found.search.residual))
    blocks = [
        paragraph(
            "Mean square of the whitened residuals, known parameters and sensor errors refitted: one is sensor noise "
            "alone. Each cell: without any effect → with the effects found."
        )
    ]
    for kind, words in _KINDS.items():
        pairs = [(old, new) for old, new in zip(before, after, strict=True) if old[0].kind == kind]
        if pairs:
            heads = [f"{low:g}–{high:g} Hz" for low, high in (spot.band for spot in pairs[0][0])]
            rows = [
                (old[0].label, *(_cell(a.misfit, b.misfit) for a, b in zip(old, new, strict=True)))
                for old, new in pairs
            ]
            blocks.append(table(words, ("", *heads), rows))
    return blocks


def _cell(before: float, after: float) -> Markup:
    """Before and after, on a ground that says how much was there before."""
    if not np.isfinite(before):
        return text("–")
    shade = next(k for k, top in _SHADES.items() if before <= top)
    return shaded(f"{_short(before)} → {_short(after)}", shade)


def _short(value: float) -> str:
    return f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def gain_figure(one: Round, number: int, least: float, confusable: float) -> Figure:
    """Return the best candidate of each family in one round: what it gains, and what is refused."""
    best = list(one.best.values())
    shown = [s for s in best if s.gain > 1.0][:SHOWN] or best[:3]
    names = [f"{s.candidate.family.named}, {where(s.candidate.components)}" for s in shown]
    traces = []
    for words, color, keep in (("may be added", BLUE, True), ("refused", "#6e7781", False)):
        some = [i for i, s in enumerate(shown) if (not s.refused) == keep]
        if some:
            said = [shown[i].refused or "passes" for i in some]
            traces.append(
                {
                    "type": "bar",
                    "orientation": "h",
                    "name": words,
                    "x": [max(shown[i].gain, 1.0) for i in some],
                    "y": [i + _BELOW for i in some],
                    "text": [html.escape(s) for s in said],
                    "textposition": "none",
                    "hovertemplate": "%{x:.4g}: %{text}",
                    "marker": {"color": color},
                }
            )
    layout = _bars(names, "Gain of log-likelihood", 38, least, max(s.gain for s in shown))
    words = (
        "The best candidate of each family, everything known refitted beside it. "
        f"The dashed line is the least gain, {least:g}; families that another form of the report's laws may pass for "
        f"need {confusable:g}."
    )
    return Figure(f"gains-{number}", f"Round {number}: what could explain it", words, traces, layout, layout["height"])


def gap_figure(found: Discovery) -> Figure:
    """Return the gap of every phase of every held-out test: delivered, refitted, after."""
    assert found.proof is not None
    gaps = found.proof.gaps
    names = [f"{gap.phase}, {gap.test}" for gap in gaps]
    traces = []
    series = (
        ("as delivered", "delivered", GREY),
        ("refitted", "refitted", VERMILLION),
        ("with the effects", "after", BLUE),
    )
    for words, key, color in series:
        traces.append(
            {
                "type": "bar",
                "orientation": "h",
                "name": words,
                "x": [getattr(gap, key) for gap in gaps],
                "y": [i + _BELOW for i in range(len(gaps))],
                "hovertemplate": "%{x:.3g} × noise",
                "marker": {"color": color},
            }
        )
    most = max(max(gap.delivered, gap.refitted, gap.after) for gap in gaps)
    layout = _bars(names, "Gap over sensor noise", 74, FLOOR, most) | {"barmode": "group"}
    words = "Root mean square error over everything that moves, in deviations of noise; the dashed line is noise alone."
    return Figure("gap", "The gap on tests that were not searched", words, traces, layout, layout["height"])


def residual_function_figure(left: ResidualFunction) -> Figure:
    """Return a free function of a leg's state with two deviations on either side."""
    title = "Rate of elongation [m/s]" if left.state == "velocity" else f"Elongation: {left.words} [m]"
    layout = stacked_layout([f"Force along {where(left.components)} [kN]"], title, row_height=240)
    nodes, value, sd = left.nodes.tolist(), left.value / 1e3, left.sd / 1e3
    band = [*(value + 2 * sd).tolist(), *(value - 2 * sd)[::-1].tolist()]
    traces = [
        {
            "type": "scatter",
            "mode": "lines",
            "x": [*nodes, *nodes[::-1]],
            "y": band,
            "fill": "toself",
            "line": {"width": 0},
            "fillcolor": "rgba(0,114,178,0.2)",
            "name": "two deviations",
            "hoverinfo": "skip",
        },
        {
            "type": "scatter",
            "mode": "lines+markers",
            "x": nodes,
            "y": value.tolist(),
            "line": {"color": BLUE},
            "name": "force",
        },
    ]
    words = f"A force along {where(left.components)} as a free function of {left.words}, fitted to what is left."
    return Figure("left", "What has no name", words, traces, layout, layout["height"])


_BELOW = 0.2
"""How far a bar stands below the middle of its row, whose name is above it; in rows."""


def _bars(names: Sequence[str], x_title: str, height: int, mark: float, most: float) -> dict[str, Any]:
    """Layout of rows of bars, `height` [CSS px] each, over a logarithmic axis to `most`; a line at `mark`."""
    layout = stacked_layout([""], x_title, row_height=height * max(len(names), 1))
    layout["yaxis"] |= {
        "range": [len(names) - 0.5, -0.5],
        "showticklabels": False,
        "showgrid": False,
        "zeroline": False,
    }
    layout["yaxis"] |= {"ticks": "", "fixedrange": True}
    layout["xaxis"] |= {"type": "log"} | log_ticks(1.0, most)
    layout["margin"]["l"] = 14
    layout["hovermode"], layout["bargap"] = "closest", 0.45
    for k, name in enumerate(names):
        place = {"x": 0, "xref": "paper", "xanchor": "left", "y": k - 0.48, "yref": "y", "yanchor": "top"}
        words = {
            "text": html.escape(name),
            "showarrow": False,
            "font": {"size": 11},
            "bgcolor": "rgba(255,255,255,0.7)",
        }
        layout["annotations"].append(place | words)
    line = {"type": "line", "xref": "x", "x0": mark, "x1": mark, "yref": "paper", "y0": 0, "y1": 1}
    layout["shapes"].append(line | {"line": {"color": BLACK, "width": 1.2, "dash": "dash"}})
    return layout
