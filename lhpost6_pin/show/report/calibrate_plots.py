"""Figures of a calibration: estimates and priors, subset and joint estimates, information per test."""

import html
from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import Any

import numpy as np

from ...core.arrays import Array
from ...identification.calibration import Calibration
from ...identification.calibration.result import changed_parameters, contradictions
from .layout import band_on, stacked_layout
from .page import Block, Figure, Markup, Table, number, shaded
from .plots import BLACK, BLUE, CYCLE, GREY, VERMILLION

__all__ = ["INTERVAL", "PROBABILITY", "forest_figure", "half_interval", "information_blocks", "subset_block"]


PROBABILITY = 0.9  # of every interval that is drawn or printed
INTERVAL = f"{100 * PROBABILITY:g}\N{NO-BREAK SPACE}% interval"
ROW, SUBSET_ROW = 19, 38  # [CSS px] height of a parameter's row
TOGETHER = "joint estimate"
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "x", "star", "hexagon")
_SHADES = (4, 3, 2, 0)
"""From much to little information."""


def half_interval(sd: float) -> float:
    """Half of the interval of an estimate with standard deviation `sd`."""
    return NormalDist().inv_cdf(0.5 + 0.5 * PROBABILITY) * sd


def _reach(calibration: Calibration) -> float:
    """Half of a drawn interval in standard deviations; no length where the fit did not converge."""
    return half_interval(1.0) if calibration.converged else 0.0


def _drawn(calibration: Calibration) -> str:
    """How estimates are drawn."""
    if calibration.converged:
        return f"with {INTERVAL}s"
    return "of the last round (not converged), without intervals"


def forest_figure(calibration: Calibration) -> Figure:
    """Return every parameter's estimate with its interval beside its prior."""
    changed, informed = changed_parameters(calibration), calibration.informed
    others = [i for i in range(len(calibration.parameters)) if i not in changed]
    groups = {
        "differs from nominal": (changed, {"color": VERMILLION, "symbol": "diamond"}),
        "does not differ": ([i for i in others if informed[i]], {"color": BLUE, "symbol": "circle"}),
        "not informed": ([i for i in others if not informed[i]], {"color": "#6e7781", "symbol": "circle-open"}),
    }
    where, reach = calibration.estimate / calibration.prior, _reach(calibration) * calibration.sd / calibration.prior
    names = [parameter.name for parameter in calibration.parameters]
    dots = [
        _dots(name, rows, where[rows].tolist(), reach[rows].tolist(), [names[i] for i in rows], marker)
        for name, (rows, marker) in groups.items()
        if rows
    ]
    words = (
        f"Estimates {_drawn(calibration)}, in standard deviations of their priors from nominal; the band is "
        f"the {INTERVAL} of the prior, before the campaign."
    )
    return _forest("forest", "Parameters and priors", words, names, dots, ROW)


def subset_block(calibration: Calibration) -> Block:
    """Return the estimate of each group of residuals for each parameter alone, and the joint estimate."""
    count, prior, limit = len(calibration.parameters), calibration.prior, calibration.numbers.number("report.informed")
    own = calibration.numbers.number("simulation.deviations")
    groups = [s for s in calibration.subsets if np.any(s.sd[:count] < limit * prior[:count])]
    if not groups:
        return "No group identifies a parameter by itself."
    identifies = {s.name: [i for i in range(count) if s.sd[i] < limit * prior[i]] for s in groups}
    identified = sorted({i for chosen in identifies.values() for i in chosen})
    estimators = {i: [TOGETHER, *(name for name, chosen in identifies.items() if i in chosen)] for i in identified}
    names = calibration.names

    def place(name: str, i: int) -> float:
        """Place of a group's estimate up the figure: those of one parameter stand close together."""
        own_names = estimators[i]
        return identified.index(i) + 0.8 * ((own_names.index(name) + 0.5) / len(own_names) - 0.5)

    def dots_of(name: str, chosen: Sequence[int], estimate: Array, sd: Array, **marker: str) -> dict[str, Any]:
        places, labels = [place(name, i) for i in chosen], [names[i] for i in chosen]
        where, half = ([float(x[i] / prior[i]) for i in chosen] for x in (estimate, _reach(calibration) * sd))
        return _dots(name, places, where, half, labels, marker)

    series = [dots_of(TOGETHER, identified, calibration.estimate, calibration.sd, color=BLACK, symbol="line-ns-open")]
    for k, s in enumerate(groups):  # the last colour is black: the joint estimate
        color, symbol = CYCLE[k % (len(CYCLE) - 1)], SYMBOLS[k % len(SYMBOLS)]
        series.append(dots_of(s.name, identifies[s.name], s.estimate, s.sd, color=color, symbol=symbol))
    alone = {s.name: s.estimate for s in groups}
    marked = [(name, i) for name, i, _ in contradictions(calibration) if i in identifies.get(name, ())]
    if marked:
        places, where = [place(*one) for one in marked], [float(alone[name][i] / prior[i]) for name, i in marked]
        labels, half = [f"{names[i]}, {name}" for name, i in marked], [0.0] * len(marked)
        ring = {"color": VERMILLION, "symbol": "circle-open", "size": 17}
        series.append(_dots("contradicts the joint estimate", places, where, half, labels, ring))
    words = (
        f"Estimates {_drawn(calibration)}: of each group of residuals alone, and of open-loop simulation from the "
        "recorded spools, with the same priors; a group is omitted where its predicted deviation is "
        f"above {limit:g} of the prior's. Ringed: {calibration.limit:g} deviations or more from the joint estimate, "
        f"simulation {own:g}. "
        "Drag to zoom; a double click shows all."
    )
    shown = [names[i] for i in identified]
    return _forest("subsets", "Estimates by group of residuals", words, shown, series, SUBSET_ROW)


def information_blocks(calibration: Calibration, unknowns: Sequence[int]) -> list[Block]:
    """Return, for some unknowns, the predicted deviation from each test alone over the prior, as a shaded table."""
    informed = calibration.numbers.number("report.informed")
    edges = (0.2 * informed, 0.5 * informed, informed)
    ranges = [f"up to {edge:g}" for edge in edges] + [f"above {informed:g}: almost no information"]
    key = " ".join(map(shaded, ranges, _SHADES))
    ratios = np.vstack([calibration.sd, calibration.alone])[:, unknowns] / calibration.prior[unknowns]
    rows = [
        (
            calibration.names[i],
            *(shaded(number(float(r), 2), _SHADES[int(np.searchsorted(edges, r))]) for r in column),
        )
        for i, column in zip(unknowns, ratios.T, strict=True)
    ]
    header = ("Unknown", "All tests", *calibration.tests)
    caption = "Predicted deviation from a test alone, over that of the prior"
    return [Markup(f"<p>{key}</p>"), Table(caption, header, rows)]


def _forest(
    name: str, title: str, words: str, labels: Sequence[str], series: Sequence[dict[str, Any]], row_height: int
) -> Figure:
    """Rows of estimates over one axis, the first on top."""
    axis = "Prior standard deviations from nominal"
    layout = stacked_layout([""], axis, row_height=row_height * max(len(labels), 3))
    layout["hovermode"] = "closest"
    layout["yaxis"] |= {
        "range": [len(labels) - 0.5, -0.5],
        "tickvals": list(range(len(labels))),
        "ticktext": [html.escape(label) for label in labels],
        "tickfont": {"size": 11},
        "zeroline": False,
    }
    layout["xaxis"] |= {"zeroline": True, "zerolinecolor": BLACK, "zerolinewidth": 1}
    layout["shapes"].append(band_on(0, GREY, x=(-half_interval(1.0), half_interval(1.0))))
    return Figure(name, title, words, series, layout, layout["height"])


def _dots(
    name: str,
    place: Sequence[float],
    value: Sequence[float],
    half: Sequence[float],
    labels: Sequence[str],
    marker: Mapping[str, Any],
) -> dict[str, Any]:
    """Estimates with intervals: place (m,) up the figure, value and half interval (m,) in prior deviations."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": html.escape(name),
        "x": list(value),
        "y": list(place),
        "text": [html.escape(label) for label in labels],
        "customdata": list(half),
        "hovertemplate": "%{text}: %{x:.3f}" + " ± %{customdata:.3f}" * any(half),
        "marker": {"size": 8, "line": {"width": 1.6, "color": marker["color"]}, **marker},
        "error_x": {"type": "data", "array": list(half), "color": marker["color"], "thickness": 1.6, "width": 3},
    }
