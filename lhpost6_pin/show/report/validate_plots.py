"""Figures of a validation, in the kind of the report's Figures 6.1 to 6.37: measured and model's, overlaid."""

from collections.abc import Iterator, Sequence

import numpy as np

from ...core.arrays import Array
from ...data.metrics import kinds
from ...identification.validation import ComparedQuantity, Phase, Valves
from ...identification.validation.phase_agreement import MOTIONS
from .charts import Curve, Panel, XAxis, chart_figure, spectra_figure
from .force_grid import FORCES, SIX_ROWS, force_grid
from .page import Block, Figure, Markup, grid, number
from .plots import ACHIEVED, TARGET, Row, Trace, palette, time_figure
from .scales import SCALES, Scale, axis_scale, axis_title, force_scale, percent

__all__ = ["actuator_blocks", "force_figure", "motion_blocks", "scale_of", "spectrum_blocks", "valve_figures"]


BUCKETS = 320  # stretches of a channel over time, each drawn by its least and greatest sample
FEW = 160  # the same where many actuators share a figure
POINTS = 1600  # of a curve in a grid of forces
ROW, SMALL_ROW = 130, 84  # [CSS px]
SHOWN = (0.2, 80.0)  # [Hz] of spectra
_SCALES = {"actuator_force": "force", "chamber_pressure_a": "pressure", "chamber_pressure_b": "pressure"}
_WORDS = {
    "actuator_force": "Actuator forces",
    "chamber_pressure_a": "Pressures in chambers A",
    "chamber_pressure_b": "Pressures in chambers B",
    "spool_command": "Fourth-stage spool commands",
    "spool_command_b": "Fourth-stage spool commands of servovalves B",
}


def scale_of(quantity: str, column: str) -> Scale:
    """Display scale of a compared quantity."""
    if quantity in MOTIONS:
        return axis_scale(column, quantity)
    if quantity in FORCES:
        return force_scale(column)
    return SCALES[_SCALES.get(quantity, "ratio")]


def force_figure(phase: Phase, motion: Phase | None, axes: Sequence[str], loops: bool = False) -> Figure:
    """Return Section 6.1's six rows, or with `loops` force against displacement alone, a column for every axis.

    Each side is drawn over its own motion where `phase` compares it; else both over the motion measured in `motion`, or
    without one over time only.
    """
    rows = [("wrench", "displacement")] if loops else SIX_ROWS
    over = {q: motion.pair(q) if motion else None for q in ("displacement", "velocity")}
    rows = [(force, x) for force, x in rows if phase.pair(force) and (x == "time" or over[x])]

    def sides(what: str, against: str, axis: str) -> Iterator[tuple[str, Array, Array]]:
        force, moved = phase.pair(what), over.get(against)
        assert force is not None
        for side in ("measured", "model"):
            y, x = getattr(force, side)[:, force.columns.index(axis)], phase.time
            if moved is not None:
                x = getattr(moved, side if motion is phase else "measured")[:, moved.columns.index(axis)]
            n = min(len(x), len(y))
            yield side, x[:n], y[:n]

    words = "At the centre of the platen's top (C), platen axes; grey: measured, blue: required."
    name, title = f"forces-{phase.test}", "Forces by inverse dynamics"
    if loops:
        words = "At the centre of the platen's top (C), each over its own displacement; grey: measured, blue: model."
        name, title = f"loops-{phase.test}", "Forces against displacement"
    return force_grid(name, title, words, rows, axes, sides, points=POINTS)


def motion_blocks(phase: Phase, axes: Sequence[str]) -> list[Block]:
    """Return motion and total force of every axis over time, and in open loop force against displacement."""
    drawings = []
    for axis in axes:
        rows, errors = [], []
        for quantity in (*MOTIONS, *(["wrench"] if phase.number == 2 else [])):
            pair = phase.pair(quantity)
            if pair is None:
                continue
            word = FORCES.get(quantity, quantity.capitalize())
            rows.append(Row(word, _traces(pair, pair.columns.index(axis)), scale_of(quantity, axis)))
            one = next(a for a in phase.of(quantity) if a.column == axis)
            if one.moves:
                errors.append(f"{word.lower()} {percent(one.rrmse_aligned)}")
        words = f"RRMSE, delay removed: {', '.join(errors)}." if errors else "Almost at rest."
        name = f"motion{phase.number}-{phase.test}-{axis}"
        drawings.append(_over_time(name, axis_title(axis), words, phase, rows, BUCKETS, ROW))
    blocks: list[Block] = [grid(*drawings, pairs=True)]
    if phase.number == 2 and phase.pair("wrench") is not None:
        blocks.append(force_figure(phase, phase, axes, loops=True))
    return blocks


def actuator_blocks(phase: Phase, quantity: str) -> list[Markup]:
    """Return a quantity of every actuator over time, a row each, actuators of a kind in one figure."""
    pair = phase.pair(quantity)
    if pair is None:
        return []
    drawings = []
    for own in kinds(pair.columns):
        rows = [Row(pair.columns[k], _traces(pair, k), scale_of(quantity, pair.columns[k])) for k in own]
        name = f"{quantity}{phase.number}-{phase.test}-{pair.columns[own[0]]}"
        title = f"{_WORDS[quantity]}, {_span(pair.columns, own)}"
        drawings.append(_over_time(name, title, "Grey: measured, blue: model.", phase, rows, FEW, SMALL_ROW))
    return [grid(*drawings, pairs=True)]


def spectrum_blocks(phase: Phase, axes: Sequence[str], edges: Sequence[float]) -> list[Block]:
    """Return amplitude spectral densities of both sides, with the oil columns of the linear model marked."""
    spectrum = phase.spectrum
    if spectrum is None:
        return []
    expected = {r.column: r.expected for r in phase.resonances}
    drawings = []
    for axis in axes:
        k = spectrum.columns.index(axis)
        ratios = ", ".join(
            f"{low:g}–{high:g} Hz {percent(ratio)}"
            for low, high, ratio in zip(edges[:-1], edges[1:], spectrum.ratio[:, k], strict=True)
            if np.isfinite(ratio)
        )
        words = f"Model over measured: {ratios}." if ratios else "No band exceeds the noise."
        words += " Noise of the recorded spools excites the oil columns of the model." * (phase.number == 2)
        drawings.append(
            spectra_figure(
                f"spectrum{phase.number}-{phase.test}-{axis}",
                axis_title(axis),
                words,
                [("measured", spectrum.measured[:, k], TARGET), ("model", spectrum.model[:, k], ACHIEVED)],
                spectrum.frequency,
                scale_of(spectrum.quantity, axis),
                SHOWN,
                row_height=200,
                marks=[expected[axis]] if axis in expected else [],
            )
        )
    return [grid(*drawings, pairs=True)] if drawings else []


def valve_figures(valves: Valves) -> Markup:
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
        title = f"Spool over command, {_span(valves.columns, own)}"
        words = f"In test {valves.test}, where coherent. The model's phase is that of {number(1e3 * late)} ms."
        panels = [Panel("Gain [1]", gains, span=(0.0, 1.5)), Panel("Phase [deg]", phases)]
        drawings.append(chart_figure(f"valves-{valves.columns[own[0]]}", title, words, panels, over))
    return grid(*drawings, pairs=True)


def _span(names: Sequence[str], own: Sequence[int]) -> str:
    return f"{names[own[0]]} to {names[own[-1]]}" if len(own) > 1 else names[own[0]]


def _over_time(
    name: str, title: str, words: str, phase: Phase, rows: Sequence[Row], buckets: int, row_height: int
) -> Figure:
    step = float(phase.time[1] - phase.time[0])
    return time_figure(name, title, words, rows, start=0.0, step=step, buckets=buckets, row_height=row_height)


def _traces(pair: ComparedQuantity, k: int) -> list[Trace]:
    return [Trace("measured", pair.measured[:, k], TARGET), Trace("model", pair.model[:, k], ACHIEVED)]
