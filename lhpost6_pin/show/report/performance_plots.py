"""Performance of a table on four-way logarithmic paper: peak velocity over frequency, a motion's spectrum on it.

Lines of equal displacement rise, lines of equal acceleration fall. A sine below the curve of a load is within its
limits. The peaks of a motion are drawn as the same three lines, min(2 pi f D, V, A / (2 pi f)): where they cross the
curve the motion exceeds that limit. Beside them its pseudo-velocity response spectrum.
"""

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...data.metrics import channel, commanded_axes, labels, sampling
from ...data.motion_measures import DAMPING
from ...mechanics.performance import QUANTITIES, AxisPerformance
from ...motions.response_spectra import response_spectrum
from .charts import Curve, Panel, chart_figure, frequency_axis
from .page import Block, Figure, Table, grid, number
from .plots import BLACK, BLUE, GREY, VERMILLION
from .scales import Scale, axis_scale, axis_title

__all__ = ["Load", "Peaks", "motion_peaks", "performance_blocks", "performance_table"]

BAND = (0.05, 50.0)  # [Hz]
ROW_HEIGHT = 330  # [CSS px]
PAPER_WIDTH = 420  # [CSS px] about, for the tilt of labels
FREQUENCIES = np.geomspace(*BAND, 121)
MESH = {"color": "#d5d9dd", "width": 0.7}
STYLES = ({"color": BLACK, "width": 2.0}, {"color": VERMILLION, "width": 2.0, "dash": "dash"})
PEAKS = {"color": BLUE, "width": 2.0}
SPECTRUM = {"color": GREY, "width": 2.4}


class Load(NamedTuple):
    """What a table carries, and its performance with that."""

    name: str  # "bare table", or the specimen's
    axes: Sequence[AxisPerformance]
    bandwidth: float = math.inf  # stated, up to which the table is used [Hz]
    valves: str = ""  # open servovalves, in words


class Peaks(NamedTuple):
    """What a motion demands of an axis."""

    displacement: float
    velocity: float
    acceleration: float
    pseudo_velocity: Array  # (len(FREQUENCIES),), not-a-number where samples are too few

    def envelope(self) -> Array:
        """Peak velocity over frequency of the sines whose peaks these are."""
        w = 2.0 * np.pi * FREQUENCIES
        return np.minimum(np.minimum(w * self.displacement, self.velocity), self.acceleration / w)


def motion_peaks(record: xr.Dataset) -> dict[str, Peaks]:
    """Peaks and spectrum of the target of a record, or of its motion, by commanded axis."""
    sources = [next((f"{w}_{q}" for w in ("reference", "platen") if f"{w}_{q}" in record), "") for q in QUANTITIES]
    if not all(sources):
        return {}
    step, names, found = sampling(record)[1], labels(record, "axis"), {}
    for axis in commanded_axes(record):
        columns = [channel(record, source)[:, names.index(axis)] for source in sources]
        if not all(np.isfinite(column).all() for column in columns):
            continue
        shown, slow = np.full(len(FREQUENCIES), np.nan), FREQUENCIES <= 0.1 / step  # peaks are taken at samples
        if slow.any():
            shown[slow] = response_spectrum(columns[2], step, 1.0 / FREQUENCIES[slow], DAMPING).pseudo_velocity
        displacement, velocity, acceleration = (float(np.abs(column).max()) for column in columns)
        found[axis] = Peaks(displacement, velocity, acceleration, shown)
    return found


def performance_blocks(
    loads: Sequence[Load], motion: Mapping[str, Peaks] | None = None, fits: str = "", *, source: str = "the motion"
) -> list[Block]:
    """Return the paper of every axis, those of the motion alone if there is one, and the table of governing limits."""
    words = (
        "Four-way logarithmic paper: lines rising to the right are equal displacement, lines falling equal "
        "acceleration. A sine below the curve is within all limits of this axis: strokes, stated displacement and "
        "valve flow less their reserves, tilt, forces of the actuators with what is mounted, strengths, and other "
        "stated limits. Dotted: stated bandwidth."
    )
    if motion:
        words += (
            f" Blue: peaks of {source}; where blue is above a curve, that limit is exceeded. Grey: its pseudo-velocity "
            f"response spectrum, {100 * DAMPING:g} % damping."
        )
    axes = [axis.axis for axis in loads[0].axes if not motion or axis.axis in motion]
    drawings = [_paper(axis, loads, (motion or {}).get(axis)) for axis in axes]
    return [words, *([fits] if fits else []), grid(*drawings), performance_table(loads, axes)]


def performance_table(loads: Sequence[Load], axes: Sequence[str] | None = None) -> Table:
    """Return the governing limit of displacement, velocity and acceleration of each axis, and the next."""
    rows = []
    for load in loads:
        for one in load.axes:
            if axes is not None and one.axis not in axes:
                continue
            for quantity in QUANTITIES:
                bounds, scale = getattr(one, quantity), axis_scale(one.axis, quantity)
                said = [f"{number(b.value * scale.factor)} ({b.by})" for b in bounds]
                first = number(bounds[0].value * scale.factor)
                row = (load.name, f"{one.axis} {quantity}", first, scale.unit, bounds[0].by, "; ".join(said[1:]) or "–")
                rows.append(row)
    header = ("Load", "Limit", "Value", "Unit", "Governed by", "Next")
    valves = f", {loads[0].valves}" if loads and loads[0].valves else ""
    return Table(f"Limits of sinusoidal motion by axis, the governing one first{valves}", header, rows)


def _paper(axis: str, loads: Sequence[Load], motion: Peaks | None) -> Figure:
    scale = axis_scale(axis, "velocity")
    curves, drawn = [], []
    for load, style in zip(loads, STYLES, strict=False):
        one = next((one for one in load.axes if one.axis == axis), None)
        if one is not None:
            drawn.append(one.peak_velocity(FREQUENCIES) * scale.factor)
            curves.append(Curve(load.name, FREQUENCIES, drawn[-1], style))
    top = 4.0 * max(float(values.max()) for values in drawn)
    low = 0.2 * min(float(values.min()) for values in drawn)
    if motion is not None:
        envelope = motion.envelope() * scale.factor
        if envelope.max() > 0.0:
            top = max(top, 2.0 * float(envelope.max()))
            low = min(low, max(float(envelope[envelope > 0.0].min()), 1e-4 * top))
        spectrum = motion.pseudo_velocity * scale.factor
        curves.append(Curve("pseudo-velocity spectrum", FREQUENCIES, spectrum, SPECTRUM))
        curves.append(Curve("peaks of the motion", FREQUENCIES, envelope, PEAKS))
    mesh, notes = _mesh(axis, scale, (low, top))
    panel = Panel(f"Peak velocity [{scale.unit}]", [*mesh, *curves], log=True, span=(low, top))
    words = "Peak velocity of a sine over its frequency; diagonals: displacement and acceleration."
    name, ends = f"performance-{axis}", [loads[0].bandwidth] if loads[0].bandwidth < BAND[1] else []
    figure = chart_figure(
        name, axis_title(axis), words, [panel], frequency_axis(*BAND), row_height=ROW_HEIGHT, marks=ends
    )
    silent = {"showlegend": False, "hoverinfo": "skip"}
    traces = [{**trace, **silent} if i < len(mesh) else trace for i, trace in enumerate(figure.traces)]
    layout = {**figure.layout, "annotations": [*figure.layout["annotations"], *notes]}
    return replace(figure, traces=traces, layout=layout)


def _mesh(axis: str, scale: Scale, span: tuple[float, float]) -> tuple[list[Curve], list[dict[str, Any]]]:
    """Diagonals at powers of ten of displacement and acceleration as shown, with their labels in the plot."""
    curves, notes = [], []
    ends = np.array(BAND)
    w = 2.0 * np.pi * ends
    low, high = (v / scale.factor for v in span)
    tilt = float(np.degrees(np.arctan2(ROW_HEIGHT / np.log10(high / low), PAPER_WIDTH / np.log10(BAND[1] / BAND[0]))))
    for quantity, power in (("displacement", 1.0), ("acceleration", -1.0)):
        shown = axis_scale(axis, quantity)
        reach = [shown.factor * v * x**-power for v in (low, high) for x in w]
        for decade in range(math.floor(math.log10(min(reach))), math.ceil(math.log10(max(reach))) + 1):
            value = 10.0**decade / shown.factor
            curves.append(Curve(f"{quantity} {decade}", ends, value * w**power * scale.factor, MESH))
            # labels of displacements are along the right and the top edge, those of accelerations left and below
            edge = BAND[1] * 0.6 if power > 0.0 else BAND[0] * 1.7
            level = value * (2.0 * np.pi * edge) ** power
            if level > 0.6 * high:
                level = 0.6 * high if power > 0.0 else 1.7 * low
                edge = (level / value) ** power / (2.0 * np.pi)
            if level >= 1.5 * low and BAND[0] * 1.5 < edge < BAND[1] * 0.65:
                notes.append(_label(f"{10.0**decade:g} {shown.unit}", edge, level * scale.factor, -power * tilt))
    return curves, notes


def _label(words: str, x: float, y: float, angle: float) -> dict[str, Any]:
    place = {"x": float(np.log10(x)), "y": float(np.log10(y)), "xref": "x", "yref": "y", "textangle": angle}
    return place | {"text": html.escape(words), "showarrow": False, "font": {"size": 9, "color": "#57606a"}}
