"""Figures of a validation, in the kind of the report's Figures 6.1 to 6.37: measured and model's, overlaid."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.names import AXES
from ...identification.validation import ComparedQuantity, Phase, Valves
from ...identification.validation.phase_agreement import MOTIONS
from .charts import Curve, Panel, Plot, XAxis, chart_figure, grid_figure
from .control_blocks import axis_title
from .decompose_plots import force_scale
from .page import Figure, Markup, figure, grid, number
from .plots import ACHIEVED, SCALES, TARGET, Row, Scale, Trace, envelope, palette, time_figure
from .run_components import kinds
from .run_motion import axis_scale, percent

__all__ = ["actuator_blocks", "force_blocks", "motion_blocks", "scale_of", "spectrum_block", "valve_block"]

Array = NDArray[np.float64]

BUCKETS = 320  # stretches of a channel over time, each drawn by its least and greatest sample
FEW = 160  # the same where many actuators share a figure
LOOP = 1600  # points of a loop, evenly spaced: above 60 Hz in a test of half a minute
ROW, SMALL_ROW = 130, 84  # [CSS px]
CELL = 170  # [CSS px] height of a loop
SHOWN = (0.2, 80.0)  # [Hz] of spectra
TICKS = (0.2, 0.5, 1, 2, 5, 10, 20, 50)
_SCALES = {"actuator_force": "force", "chamber_pressure_a": "pressure", "chamber_pressure_b": "pressure"}
_WORDS = {
    "actuator_force": "Actuator forces",
    "chamber_pressure_a": "Pressures in chambers A",
    "chamber_pressure_b": "Pressures in chambers B",
    "spool_command": "Fourth-stage spool commands",
}
_FORCES = {"wrench": "Total actuator force", "struts": "Strut force", "dissipative": "Dissipative force"}


def scale_of(quantity: str, column: str) -> Scale:
    """Display scale of a compared quantity."""
    if quantity in MOTIONS:
        return axis_scale(column, quantity)
    if quantity in _FORCES:
        return force_scale(column)
    return SCALES[_SCALES.get(quantity, "ratio")]


def force_blocks(phase: Phase, motion: Phase | None, axes: Sequence[str]) -> list[Markup]:
    """Return Section 6.1's six rows: forces over time, displacement and velocity of the axes, as a grid of loops.

    The motion is that measured in a phase that compared it, else displacements and velocities are left out.
    """
    rows = [("wrench", "time"), ("wrench", "displacement"), ("wrench", "velocity")]
    rows += [("struts", "displacement"), ("dissipative", "displacement"), ("dissipative", "velocity")]
    words = "At the centre of the platen's top (C), platen axes; grey: measured, blue: required."
    name = f"forces-{phase.test}"
    return [figure(_grid(name, "Forces by inverse dynamics", words, phase, motion, rows, axes))] if axes else []


def motion_blocks(phase: Phase, axes: Sequence[str]) -> list[Markup]:
    """Return motion and total force of every axis over time, and in open loop force against displacement."""
    drawings = []
    for axis in axes:
        rows, said = [], []
        for quantity in (*MOTIONS, *(["wrench"] if phase.number == 2 else [])):
            pair = phase.pair(quantity)
            if pair is None:
                continue
            word = quantity.capitalize() if quantity in MOTIONS else "Total actuator force"
            rows.append(Row(word, _traces(pair, pair.columns.index(axis)), scale_of(quantity, axis)))
            one = next(a for a in phase.of(quantity) if a.column == axis)
            if one.moves:
                said.append(f"{word.lower()} {percent(one.rrmse_aligned)}")
        words = f"RRMSE, delay removed: {', '.join(said)}." if said else "Almost at rest."
        drawings.append(
            figure(_over_time(f"motion{phase.number}-{phase.test}-{axis}", axis_title(axis), words, phase, rows))
        )
    blocks = [grid(*drawings, pairs=True)]
    if phase.number == 2 and phase.pair("wrench") is not None:
        loops = [("wrench", "displacement")]
        words = "At the centre of the platen's top (C), each over its own displacement; grey: measured, blue: model."
        name = f"loops-{phase.test}"
        blocks.append(figure(_grid(name, "Forces against displacement", words, phase, phase, loops, axes)))
    return blocks


def actuator_blocks(phase: Phase, quantity: str) -> list[Markup]:
    """Return a quantity of every actuator over time, a row each, actuators of a kind in one figure."""
    pair = phase.pair(quantity)
    if pair is None:
        return []
    drawings = []
    for own in kinds(pair.columns):
        rows = [Row(pair.columns[k], _traces(pair, k), scale_of(quantity, pair.columns[k])) for k in own]
        ends = f"{pair.columns[own[0]]} to {pair.columns[own[-1]]}" if len(own) > 1 else pair.columns[own[0]]
        name = f"{quantity}{phase.number}-{phase.test}-{pair.columns[own[0]]}"
        title = f"{_WORDS[quantity]}, {ends}"
        drawings.append(figure(_over_time(name, title, "Grey: measured, blue: model.", phase, rows, FEW, SMALL_ROW)))
    return [grid(*drawings, pairs=True)]


def spectrum_block(phase: Phase, axes: Sequence[str], edges: Sequence[float]) -> list[Markup]:
    """Return amplitude spectral densities of both sides, with the oil columns of the linear model marked."""
    spectrum = phase.spectrum
    if spectrum is None:
        return []
    f = spectrum.frequency
    inside = (f >= SHOWN[0]) & (f <= SHOWN[1])
    expected = {r.column: r.expected for r in phase.resonances}
    drawings = []
    for axis in axes:
        k = spectrum.columns.index(axis)
        scale = scale_of(spectrum.quantity, axis)
        sides = (("measured", spectrum.measured, TARGET), ("model", spectrum.model, ACHIEVED))
        curves = [Curve(n, f[inside], scale.factor * np.sqrt(power[inside, k]), line) for n, power, line in sides]
        curves = [
            Curve(c.name, np.asarray(c.x)[np.asarray(c.y) > 0], np.asarray(c.y)[np.asarray(c.y) > 0], c.style)
            for c in curves
        ]
        ratios = ", ".join(
            f"{low:g}–{high:g} Hz {percent(ratio)}"
            for low, high, ratio in zip(edges[:-1], edges[1:], spectrum.ratio[:, k], strict=True)
            if np.isfinite(ratio)
        )
        words = f"Model over measured: {ratios}." if ratios else "No band exceeds the noise."
        words += " Noise of the recorded spools excites the oil columns of the model." * (phase.number == 2)
        panel = Panel(f"Spectral density [{scale.unit}/√Hz]", curves, log=True)
        over = XAxis("Frequency [Hz]", log=True, span=SHOWN, ticks=TICKS)
        marks = [expected[axis]] if axis in expected else []
        name = f"spectrum{phase.number}-{phase.test}-{axis}"
        drawings.append(figure(chart_figure(name, axis_title(axis), words, [panel], over, row_height=200, marks=marks)))
    return [grid(*drawings, pairs=True)] if drawings else []


def valve_block(valves: Valves) -> Markup:
    """Return gain and phase of spools over their commands, actuators of a kind in one figure, and the model's."""
    inside = (valves.frequency > 0.0) & (valves.frequency <= SHOWN[1])
    f, ends = valves.frequency[inside], np.array([0.0, SHOWN[1]])
    over = XAxis("Frequency [Hz]", span=(0.0, SHOWN[1]))
    drawings = []
    for own in kinds(valves.columns):
        gains, phases, late = [], [], float(valves.model[own[0]])
        for k, line in zip(own, palette(len(own)), strict=True):
            response, name = valves.response[inside, k], valves.columns[k]
            off = np.degrees(np.angle(response * np.exp(2j * np.pi * f * late)))
            gains.append(Curve(name, f, np.abs(response), line))
            phases.append(Curve(name, f, off - 360.0 * f * late, line))
        phases.append(Curve("model", ends, -360.0 * ends * late, {"color": "#000000", "width": 1.6, "dash": "dash"}))
        first, last = valves.columns[own[0]], valves.columns[own[-1]]
        title = f"Spool over command, {first} to {last}" if len(own) > 1 else f"Spool over command, {first}"
        words = f"In test {valves.test}, where coherent. The model's phase is that of {number(1e3 * late)} ms."
        panels = [Panel("Gain [1]", gains, span=(0.0, 1.5)), Panel("Phase [deg]", phases)]
        drawings.append(figure(chart_figure(f"valves-{first}", title, words, panels, over)))
    return grid(*drawings, pairs=True)


def _over_time(
    name: str, title: str, words: str, phase: Phase, rows: Sequence[Row], buckets: int = BUCKETS, row_height: int = ROW
) -> Figure:
    step = float(phase.time[1] - phase.time[0])
    return time_figure(name, title, words, rows, start=0.0, step=step, buckets=buckets, row_height=row_height)


def _traces(pair: ComparedQuantity, k: int) -> list[Trace]:
    return [Trace("measured", pair.measured[:, k], TARGET), Trace("model", pair.model[:, k], ACHIEVED)]


# -------------------------------------------------------------------------------------- force against motion
def _grid(
    name: str,
    title: str,
    words: str,
    phase: Phase,
    motion: Phase | None,
    rows: Sequence[tuple[str, str]],
    axes: Sequence[str],
) -> Figure:
    """Return forces over time or motion, a row each, a column for every axis."""
    pairs = {what: phase.pair(what) for what, _ in rows}
    against = {q: motion.pair(q) if motion else None for q in ("displacement", "velocity")}
    rows = [(what, over) for what, over in rows if pairs[what] and (over == "time" or against[over])]

    def plot(what: str, over: str, axis: str) -> Plot:
        word = _FORCES[what] if axis not in AXES[3:] else _FORCES[what].replace("force", "moment")
        unit = "s" if over == "time" else scale_of(over, axis).unit
        curves = []
        for side, line in (("measured", TARGET), ("model", ACHIEVED)):
            x, y = _loop(phase, pairs[what], against.get(over), side, axis, over, own=motion is phase)
            curves.append(Curve(side, x, y, line))
        return Plot(f"{word}, {axis} [{scale_of(what, axis).unit}]", f"{over.capitalize()} [{unit}]", curves)

    plots = [[plot(what, over, axis) for axis in axes] for what, over in rows]
    return grid_figure(name, title, words, plots, cell=CELL, gap=0.10)


def _loop(
    phase: Phase,
    force: ComparedQuantity | None,
    motion: ComparedQuantity | None,
    side: str,
    axis: str,
    over: str,
    *,
    own: bool,
) -> tuple[Array, Array]:
    """Return time, that side's own motion or that which was measured, and that side's force over it."""
    assert force is not None
    k = force.columns.index(axis)
    y = getattr(force, side)[:, k]
    if motion is None:
        x, factor, kept = phase.time, 1.0, envelope(y, BUCKETS)
    else:
        x = getattr(motion, side if own else "measured")[:, motion.columns.index(axis)]
        n = min(len(x), len(y))
        x, y, factor = x[:n], y[:n], scale_of(over, axis).factor
        kept = np.arange(0, n, -(-n // LOOP))
    return x[kept] * factor, y[kept] * scale_of(force.quantity, axis).factor
