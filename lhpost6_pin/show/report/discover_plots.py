"""Figures of a discovery: misfit map, candidates, errors on held-out tests, residual function."""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...discovery import Discovery
from ...discovery.floor import NOISE
from ...discovery.localise import gap_map
from ...discovery.residual_function import ResidualFunction
from ...discovery.search_state import Round
from ...discovery.verdict_file import where
from ...discovery.verdict_notes import EXPECTED_SCATTER
from .layout import line_on, log_ticks, stacked_layout
from .page import Block, Figure, Markup, Table, shaded, text
from .plots import BLACK, BLUE, GREY, VERMILLION

__all__ = ["gain_figure", "gap_figure", "held_out_errors", "residual_function_figure", "map_blocks"]


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


def map_blocks(found: Discovery) -> list[Block]:
    """Return, for each kind of residual, the misfit of every column in every band, before and after."""
    problem = found.search.problem
    before, after = (gap_map(problem, rest) for rest in (found.search.refit.normal.residual, found.search.residual))
    blocks: list[Block] = [
        "Mean square of the whitened residuals, known parameters and sensor errors refitted: 1 is the expected scatter."
        f" {EXPECTED_SCATTER} Each cell: without effects → with the identified effects."
    ]
    for kind, words in _KINDS.items():
        pairs = [(old, new) for old, new in zip(before, after, strict=True) if old[0].kind == kind]
        if pairs:
            heads = [f"{low:g}–{high:g} Hz" for low, high in (spot.band for spot in pairs[0][0])]
            rows = [
                (old[0].label, *(_cell(a.misfit, b.misfit) for a, b in zip(old, new, strict=True)))
                for old, new in pairs
            ]
            blocks.append(Table(words, ("", *heads), rows))
    return blocks


def _cell(before: float, after: float) -> Markup:
    """Misfit before and after; the shade shows that before."""
    if not np.isfinite(before):
        return text("–")
    shade = next(k for k, top in _SHADES.items() if before <= top)
    return shaded(f"{_short(before)} → {_short(after)}", shade)


def _short(value: float) -> str:
    return f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def gain_figure(one: Round, number: int, least: float, confusable: float) -> Figure:
    """Return the gain of the best candidate of each family in one round, and whether it is rejected."""
    best = list(one.best.values())
    shown = [s for s in best if s.gain > 1.0][:SHOWN] or best[:3]
    names = [f"{s.candidate.family.named}, {where(s.candidate.components)}" for s in shown]
    traces = []
    for words, color, keep in (("accepted", BLUE, True), ("rejected", "#6e7781", False)):
        some = [i for i, s in enumerate(shown) if (not s.refused) == keep]
        if some:
            reasons = [shown[i].refused or "passes" for i in some]
            bar = _bar(words, color, [max(shown[i].gain, 1.0) for i in some], some, "%{x:.4g}: %{text}")
            traces.append(bar | {"text": list(map(html.escape, reasons)), "textposition": "none"})
    layout = _bars(names, "Gain of log-likelihood", 38, least, max(s.gain for s in shown))
    words = (
        "The best candidate of each family, with all known unknowns refitted. Dashed: the least gain, "
        f"{least:g}; families confusable with another form of the baseline laws need {confusable:g}."
    )
    return Figure(f"gains-{number}", f"Round {number}: candidate effects", words, traces, layout, layout["height"])


def held_out_errors(found: Discovery) -> dict[tuple[str, str], tuple[float, float, float]]:
    """Errors on held-out tests by phase or balance and test, and unit: as delivered, refitted, with the effects."""
    gaps = found.proof.gaps if found.proof else ()
    phases = {(f"{gap.phase}, {gap.test}", "sensor noise"): (gap.delivered, gap.refitted, gap.after) for gap in gaps}
    balances = {(f"{_KINDS[one.kind].lower()}, {one.test}", "expected scatter"): one.error for one in found.balances}
    return phases | balances


def gap_figure(found: Discovery) -> Figure:
    """Return the errors of every phase and balance of every held-out test: delivered, refitted, with the effects."""
    errors = held_out_errors(found)
    series = zip(("as delivered", "refitted", "with the effects"), (GREY, VERMILLION, BLUE), strict=True)
    traces = [
        _bar(words, color, [three[k] for three in errors.values()], range(len(errors)), "%{x:.3g}")
        for k, (words, color) in enumerate(series)
    ]
    floors = [gap.floor for gap in found.proof.gaps] if found.proof else []
    marks = {"symbol": "line-ns-open", "size": 26, "color": BLACK, "line": {"width": 2.5}}
    traces.append(
        {"type": "scatter", "mode": "markers", "name": "floor", "marker": marks, "hovertemplate": "floor %{x:.3g}"}
        | {"x": floors, "y": [row + _BELOW for row in range(len(floors))]}
    )
    most = max(max(three) for three in errors.values())
    names = [f"{name}: over {unit}" for name, unit in errors]
    layout = _bars(names, "Normalised RMS error", 74, NOISE, most) | {"barmode": "group"}
    words = (
        "Root mean square error: of all moving channels in a phase, over sensor noise alone; of each balance, over the "
        f"expected scatter. {EXPECTED_SCATTER} Dashed: one; upright mark: expected of a model that lacks nothing."
    )
    return Figure("gap", "Normalised RMS error on held-out tests", words, traces, layout, layout["height"])


def residual_function_figure(function: ResidualFunction) -> Figure:
    """Return a residual function of an actuator's or strut's state with its band of ± 2 sigma."""
    title = "Rate of elongation [m/s]" if function.state == "velocity" else f"Elongation: {function.description} [m]"
    layout = stacked_layout([f"Force along {where(function.components)} [kN]"], title, row_height=240)
    nodes, value, sd = function.nodes.tolist(), function.value / 1e3, function.sd / 1e3
    band = {"x": [*nodes, *nodes[::-1]], "y": [*(value + 2 * sd).tolist(), *(value - 2 * sd)[::-1].tolist()]}
    shade = {"fill": "toself", "line": {"width": 0}, "fillcolor": "rgba(0,114,178,0.2)", "hoverinfo": "skip"}
    traces = [
        {"type": "scatter", "mode": "lines", "name": "± 2 sigma"} | band | shade,
        {"type": "scatter", "mode": "lines+markers", "name": "force"}
        | {"x": nodes, "y": value.tolist(), "line": {"color": BLUE}},
    ]
    place = where(function.components)
    words = f"Force along {place} as a nonparametric function of {function.description}, fitted to the residual."
    return Figure("left", "Residual function", words, traces, layout, layout["height"])


_BELOW = 0.2
"""Offset of a bar below the middle of its row, in rows; the name is above it."""


def _bar(name: str, color: str, sizes: Sequence[float], rows: Sequence[int], hover: str) -> dict[str, Any]:
    """Horizontal bars of one series."""
    shared = {"type": "bar", "orientation": "h", "name": name, "marker": {"color": color}, "hovertemplate": hover}
    return shared | {"x": list(sizes), "y": [row + _BELOW for row in rows]}


def _bars(names: Sequence[str], x_title: str, height: int, mark: float, most: float) -> dict[str, Any]:
    """Layout of rows of bars, `height` [CSS px] each, over a logarithmic axis to `most`; a line at `mark`."""
    layout = stacked_layout([""], f"{x_title} (logarithmic axis)", row_height=height * max(len(names), 1))
    bare = {"showticklabels": False, "showgrid": False, "zeroline": False, "ticks": "", "fixedrange": True}
    layout["yaxis"] |= {"range": [len(names) - 0.5, -0.5]} | bare
    layout["xaxis"] |= {"type": "log"} | log_ticks(1.0, most)
    layout["margin"]["l"] = 14
    layout["hovermode"], layout["bargap"] = "closest", 0.45
    for k, name in enumerate(names):
        place = {"x": 0, "xref": "paper", "xanchor": "left", "y": k - 0.48, "yref": "y", "yanchor": "top"}
        words = {"text": html.escape(name), "showarrow": False, "font": {"size": 11}}
        layout["annotations"].append(place | words | {"bgcolor": "rgba(255,255,255,0.7)"})
    layout["shapes"].append(line_on(0, x=mark) | {"line": {"color": BLACK, "width": 1.2, "dash": "dash"}})
    return layout
