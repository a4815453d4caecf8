"""Figures of an ensemble: exceedance against scale, demand over capacity, spectra, and what results follow from."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import xarray as xr

from ...studies.exceedance import Exceedance
from ...studies.quantities import DECIDING
from ...studies.summary import CONFIGURATION, QUANTILES, Configuration, ImportanceOf, places_of
from .charts import Curve, Panel, XAxis, chart_figure
from .layout import line_on, on_row, stacked_layout
from .page import Figure, number
from .plots import ACHIEVED, BLACK, TARGET, packed, palette
from .run_spectra import PERIOD_AXIS
from .scales import SCALES, axis_title

__all__ = ["demand_figure", "exceedance_figure", "importance_figure", "spectra_figures"]

BAND = {**ACHIEVED, "width": 0.9, "dash": "dot"}
MOST_LIMITS = 6  # drawn beside that of any limit
MOST_NUMBERS = 12  # of the numbers that results follow from
MOST_MOTIONS = 6
ROW = 250  # [CSS px]
CELL = 30  # [CSS px] height of a box or of a cell


def exceedance_figure(name: str, found: Configuration, scales: np.ndarray, level: float) -> Figure:
    """Return the probability of exceeding each limit against the scale of the motions."""
    any_limit, *limits = found.exceedances
    shown = [one for one in limits if one.share.max(initial=0.0) > 0.0][:MOST_LIMITS]
    curves = [_curve(any_limit, scales, {"color": BLACK, "width": 2.2})]
    curves += [_curve(one, scales, line) for one, line in zip(shown, palette(len(shown)), strict=True)]
    panel = Panel("Probability of exceedance", curves, span=(-0.02, 1.04), lines={f"{100 * level:g} %": level})
    words = (
        "Share of machines whose demand has reached a limit, between the scales that were run by linear "
        "interpolation of each demand; points: any limit at the scales run, with its interval."
    )
    margin = 0.04 * (scales[-1] - scales[0])
    axis = XAxis("Scale of the motion", span=(scales[0] - margin, scales[-1] + margin))
    title = f"Risk against scale: {found.motion}, specimen {found.specimen}, controller {found.controller}"
    figure = chart_figure(name, title, words, [panel], axis, row_height=300)
    ends = {"array": any_limit.high - any_limit.share, "arrayminus": any_limit.share - any_limit.low}
    bars = {"type": "data", "symmetric": False, "thickness": 1.4, **{k: x.tolist() for k, x in ends.items()}}
    points = {"x": packed(scales), "y": packed(any_limit.share), "marker": {"color": BLACK, "size": 7}}
    whiskers = {"type": "scatter", "mode": "markers", "name": "at the scales run", "error_y": bars, **points}
    return replace(figure, traces=[*figure.traces, {**whiskers, **on_row(0)}])


def _curve(one: Exceedance, scales: np.ndarray, line: dict[str, Any]) -> Curve:
    """Distribution of critical scales, a step at each."""
    reached = one.critical[np.isfinite(one.critical)]
    n = max(len(one.critical), 1)
    x = np.concatenate([[scales[0]], np.repeat(reached, 2), [scales[-1]]])
    y = np.concatenate([[0.0], np.repeat(np.arange(len(reached) + 1), 2)[1:-1] / n, [len(reached) / n]])
    return Curve(one.limit, x, y, line)


def demand_figure(results: xr.Dataset, scale: int) -> Figure:
    """Return boxes of demand over capacity of all runs at one scale, by deciding limit."""
    limits, use = map(str, results["limit"].values), results["limit_use"].values[:, scale]
    values = {limit: use[..., k].ravel() for k, limit in enumerate(limits)}
    known = {limit: x[np.isfinite(x)] for limit, x in values.items() if limit in DECIDING and np.isfinite(x).any()}
    order = sorted(known, key=lambda limit: float(np.median(known[limit])))
    layout = stacked_layout(["Demand over capacity"], "Demand over capacity", row_height=CELL * len(order) + 20)
    layout["shapes"].append(line_on(0, x=1.0))
    layout |= {"showlegend": False, "hovermode": "closest"}
    layout["margin"]["l"] = 170
    layout["xaxis"]["rangemode"] = "tozero"
    layout["yaxis"] |= {"type": "category", "dtick": 1}
    box = {"type": "box", "orientation": "h", "boxpoints": "outliers", "line": {"width": 1.2}}
    traces = [
        {**box, "name": limit, "x": packed(known[limit]), "marker": {"size": 3, "color": line["color"]}}
        for limit, line in zip(order, palette(len(order)), strict=True)
    ]
    words = (
        f"All runs at scale {float(results['scale'][scale]):g}, of all motions, specimens and controllers: "
        "quartiles and range (points: beyond 1.5 times the quartiles' distance). Dotted: capacity."
    )
    return Figure("demand", "Demand over capacity", words, traces, layout, layout["height"])


def spectra_figures(results: xr.Dataset, scale: int) -> list[Figure]:
    """Return response spectra at one scale, of the first motions, specimens and controllers.

    Target, and quantiles of what machines achieved.
    """
    figures, periods, unit = [], results["period"].values, SCALES["acceleration"]
    first = islice(places_of(results, *CONFIGURATION), MOST_MOTIONS)
    for k, ((m, s, c), (motion, specimen, controller)) in enumerate(first):
        target, achieved = results["target_psa"][m, scale, s].values, results["psa"][m, scale, s, c].values
        panels = []
        for d, axis in enumerate(map(str, results["direction"].values)):
            own = achieved[:, d][np.isfinite(achieved[:, d]).all(axis=-1)]
            if not own.size or not np.nanmax(target[d], initial=0.0) > 0.0:
                continue
            low, middle, high = unit.factor * np.quantile(own, QUANTILES, axis=0)
            curves = [Curve("target", periods, unit.factor * target[d], TARGET)]
            curves += [Curve("median", periods, middle, ACHIEVED)]
            curves += [Curve(_between(), periods, x, BAND) for x in (low, high)]
            panels.append(Panel(f"{axis_title(axis)}: PSA [{unit.unit}]", curves, from_zero=True))
        if panels:
            damping = f"{100 * float(results.attrs['damping']):g} % damping"
            words = f"Pseudo-spectral acceleration, {damping}, at scale {float(results['scale'][scale]):g}."
            title = f"{motion}, specimen {specimen}, controller {controller}"
            figures.append(chart_figure(f"psa-{k}", title, words, panels, PERIOD_AXIS, row_height=ROW - 60))
    return figures


def importance_figure(name: str, found: Sequence[ImportanceOf]) -> Figure:
    """Return first-order indices of the numbers that matter most (rows) for each result (columns)."""
    tables = [{index.parameter: index.first_order for index in one.indices if index.sure} for one in found]
    most: dict[str, float] = {}
    for table in tables:
        most |= {parameter: max(most.get(parameter, 0.0), share) for parameter, share in table.items()}
    rows = sorted(most, key=lambda parameter: most[parameter])[-MOST_NUMBERS:]
    z = [[max(0.0, table.get(parameter, 0.0)) for table in tables] for parameter in rows]
    layout = stacked_layout([""], "", row_height=CELL * len(rows))
    layout |= {"showlegend": False, "hovermode": "closest"}
    layout["margin"] |= {"l": 190, "b": 110}
    layout["height"] += 70
    layout["xaxis"] |= {"type": "category", "tickangle": -25, "automargin": True}
    layout["yaxis"] |= {"type": "category", "dtick": 1}
    trace = {
        "type": "heatmap",
        "x": [one.result.replace("demand over capacity, ", "use: ") for one in found],
        "y": rows,
        "z": z,
        "zmin": 0.0,
        "zmax": 1.0,
        "colorscale": [[0.0, "#ffffff"], [1.0, "#0072b2"]],
        "text": [[number(value, 2) if value > 0.0 else "" for value in row] for row in z],
        "texttemplate": "%{text}",
        "xgap": 2,
        "ygap": 2,
        "colorbar": {"title": {"text": "share"}, "thickness": 10},
    }
    one = found[0]
    words = (
        f"Share of each result's variance that a number explains alone (first-order Sobol index), {one.motion} at "
        f"scale {one.scale:g}, specimen {one.specimen}, controller {one.controller}."
    )
    return Figure(name, "Which uncertain number matters most", words, [trace], layout, layout["height"], 640)


def _between() -> str:
    return f"{100 * QUANTILES[0]:g} and {100 * QUANTILES[-1]:g} %"
