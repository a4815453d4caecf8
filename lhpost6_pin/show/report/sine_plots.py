"""Sections of a sine report: harmonics, the last cycles, convergence of the error, spool commands."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.names import AXES, SAMPLE_RATE
from ...data.distortion import Harmonics
from ...mechanics.pose import PlatenMotion, platen_motion
from ...tuning.sine import SineResult, SineTest
from .charts import Curve, Panel, XAxis, chart_figure
from .page import Figure, Markup, details, figure, grid, number, paragraph, table
from .plots import AFTER, BEFORE, SCALES, TARGET, VERMILLION, Row, Trace, time_figure
from .run_motion import axis_scale, percent

__all__ = [
    "achieved_motion",
    "convergence_block",
    "error_per_cycle",
    "harmonic_blocks",
    "history_block",
    "percent_of_fundamental",
    "spool_blocks",
]

STEP = 1.0 / SAMPLE_RATE
FLOOR = 1e-4  # [%] of the fundamental below which harmonics are not drawn
QUIET = 0.02  # share of the stroke below which a spool counts as quiet
CYCLES = 2  # that are drawn
ALONE, CANCELLED = "controller alone", "with cancellers"
LIMITS = {"+1": 1.0, "−1": -1.0}
SPAN = (-1.2, 1.2)

Array = NDArray[np.float64]


def harmonic_blocks(test: SineTest) -> list[Markup]:
    """Return bars of all harmonics relative to the fundamental, and their table, collapsed."""
    count = len(test.before.acceleration.amplitude)
    if count < 2:
        return [paragraph("No harmonic of this frequency is within the band of the table.")]
    panels, columns = [], []
    for quantity in ("acceleration", "displacement"):
        curves = []
        for name, found, line in ((ALONE, test.before, BEFORE), (CANCELLED, test.after, AFTER)):
            share = _shares(getattr(found, quantity))
            columns.append(share)
            curves.append(Curve(name, np.arange(2, len(share) + 1), np.maximum(share[1:], FLOOR), line, "bar"))
        top = max(float(column[1:].max()) for column in columns[-2:])
        title = f"{quantity.capitalize()} [% of the fundamental]"
        panels.append(Panel(title, curves, log=True, span=(FLOOR, max(2.0 * top, 1.0))))
    words = f"Amplitudes of the harmonics of {number(test.frequency)} Hz relative to the fundamental."
    drawing = chart_figure(
        "harmonics", "Harmonics relative to the fundamental", words, panels, XAxis("Harmonic"), row_height=200
    )
    rows = [
        (
            str(n + 1),
            f"{number(float(test.before.acceleration.frequency[n]))} Hz",
            *(percent_of_fundamental(c[n]) for c in columns),
        )
        for n in range(1, count)
    ]
    header = (
        "Harmonic",
        "Frequency",
        *(f"{q}, {n}" for q in ("Acceleration", "Displacement") for n in (ALONE, CANCELLED)),
    )
    return [
        figure(drawing),
        details(f"All harmonics ({len(rows)})", table("Relative to the fundamental", header, rows)),
    ]


def history_block(test: SineTest) -> Markup:
    """Return wanted and achieved displacement and acceleration of the last cycles, and the errors."""
    part, first = _last_cycles(test)
    k = AXES.index(test.axis)
    motions = {ALONE: (achieved_motion(test.before), BEFORE), CANCELLED: (achieved_motion(test.after), AFTER)}
    rows, errors = [], []
    for quantity in ("displacement", "acceleration"):
        wanted = getattr(test.target, quantity)[part, k]
        achieved = [(name, getattr(m, quantity)[part, k], line) for name, (m, line) in motions.items()]
        scale = axis_scale(test.axis, quantity)
        traces = [Trace("wanted", wanted, TARGET), *(Trace(name, x, line) for name, x, line in achieved)]
        rows.append(Row(quantity.capitalize(), traces, scale))
        errors.append(Row(f"Error of the {quantity}", [Trace(n, x - wanted, line) for n, x, line in achieved], scale))
    rows = [rows[0], errors[0], rows[1], errors[1]]
    words = f"The last {CYCLES} cycles measured, every sample, no delay removed."
    length = part.stop - part.start
    return figure(
        time_figure("cycles", "Wanted and achieved", words, rows, start=first, step=STEP, buckets=length, alone=True)
    )


def convergence_block(test: SineTest) -> Markup:
    """Return the RMS error of every cycle of the test, relative to the target sine."""
    k = AXES.index(test.axis)
    panels = []
    for quantity, fundamental in (("displacement", 1.0), ("acceleration", (2.0 * np.pi * test.frequency) ** 2)):
        wanted = getattr(test.target, quantity)[:, k]
        size = test.amplitude * fundamental / np.sqrt(2.0)
        curves = []
        for name, found, line in ((ALONE, test.before, BEFORE), (CANCELLED, test.after, AFTER)):
            time, rms = error_per_cycle(getattr(achieved_motion(found), quantity)[:, k] - wanted, test.frequency)
            share = 100.0 * rms / size
            drawn = share >= FLOOR  # not while nothing moves yet
            curves.append(Curve(name, time[drawn], share[drawn], line, "lines+markers"))
        panels.append(Panel(f"Error of the {quantity} [%]", curves, log=True))
    words = (
        "RMS of achieved minus wanted over each cycle, no delay removed, relative to the RMS of the full sine. The "
        "dotted lines mark the measured interval; the sine then fades out."
    )
    measured = test.target.time[test.measured] - test.target.time[0]
    ends = float(measured[0]), float(measured[-1])
    over = XAxis("Time [s]")
    return figure(chart_figure("convergence", "Error of every cycle", words, panels, over, row_height=200, marks=ends))


def spool_blocks(test: SineTest) -> list[Markup]:
    """Return the spool commands of all actuators over the last cycles against the limits ±1."""
    names = test.before.run.plant.machine.actuator_names
    runs = {ALONE: (test.before.run.command, BEFORE), CANCELLED: (test.after.run.command, AFTER)}
    known = {name: (command, line) for name, (command, line) in runs.items() if command is not None}
    if not known:
        return [paragraph("The runs have no spool commands.")]
    part, first = _last_cycles(test)
    rows: list[list[str]] = []
    working: list[Markup] = []
    quiet: list[Markup] = []
    for i, label in enumerate(names):
        cells = [label]
        for command, _ in known.values():
            size = np.abs(command[test.measured, i])
            cells += [percent(float(size.max())), percent(float(np.mean(size >= 1.0)))]
        rows.append(cells)
        commands = {name: command[part, i] for name, (command, _) in known.items()}
        used = max(float(np.abs(values).max()) for values in commands.values()) >= QUIET
        (working if used else quiet).append(figure(_spool(label, i, commands, first)))
    header = ["Actuator", *(f"{what}, {name}" for name in known for what in ("Largest", "At the limit"))]
    how = (
        "Commands to the fourth-stage spools as a fraction of their stroke over the last cycles, on one scale, with "
        "the limits ±1, where the valve saturates. Shaded: a command of the run with cancellers is at its limit."
    )
    blocks = [table("Commands over the measured cycles", header, rows), paragraph(how), grid(*working, pairs=True)]
    if quiet:
        words = f"Actuators below {100 * QUIET:g} % of the spool stroke ({len(quiet)})"
        blocks.append(details(words, grid(*quiet, pairs=True)))
    return blocks


def _spool(label: str, i: int, commands: dict[str, Array], first: float) -> Figure:
    lines = {ALONE: BEFORE, CANCELLED: AFTER}
    traces = [Trace(name, values, lines[name]) for name, values in commands.items()]
    full = np.abs(traces[-1].values) >= 1.0
    edges = np.flatnonzero(np.diff(full, prepend=False, append=False)).reshape(-1, 2)
    bands = [(first + begin * STEP, first + end * STEP) for begin, end in edges.tolist()]
    words = f"At its limit {percent(float(full.mean()))} of the time." if full.any() else "Within its limits."
    return time_figure(
        f"spool-{i + 1}",
        f"Spool {label}",
        words,
        [Row("Fraction of the stroke", traces, SCALES["ratio"], LIMITS, SPAN)],
        start=first,
        step=STEP,
        buckets=len(full),
        bands=bands,
        band_color=VERMILLION,
        alone=True,
        row_height=140,
    )


def achieved_motion(found: SineResult) -> PlatenMotion:
    """Return the platen motion of a run."""
    return platen_motion(found.run.plant, found.run.q, found.run.v, found.run.a)


def percent_of_fundamental(share: float) -> str:
    """Return an amplitude [% of the fundamental]; below the plotted floor as an inequality."""
    return f"< {FLOOR:.4f}\N{NO-BREAK SPACE}%" if share <= FLOOR else percent(share / 100.0)


def _last_cycles(test: SineTest) -> tuple[slice, float]:
    """Samples of the last cycles measured, and the time of the first [s]."""
    stop = min(test.measured.stop, len(test.target.time))
    start = max(stop - round(CYCLES / test.frequency * SAMPLE_RATE), test.measured.start)
    return slice(start, stop), start * STEP


def error_per_cycle(error: Array, frequency: float) -> tuple[Array, Array]:
    """Middle [s] and RMS of every whole cycle of an error (n,) from its start."""
    edges = np.round(np.arange(0.0, len(error) * STEP * frequency) / frequency / STEP).astype(int)
    edges = edges[edges <= len(error)]
    pairs = list(pairwise(edges.tolist()))
    rms = [float(np.sqrt(np.mean(error[a:b] ** 2))) for a, b in pairs]
    return np.array([0.5 * (a + b) * STEP for a, b in pairs]), np.array(rms)


def _shares(found: Harmonics) -> Array:
    """Amplitudes over the fundamental's [%]; zero where there is none."""
    first = found.amplitude[0]
    return 100.0 * found.amplitude / first if first > 0.0 else np.zeros(len(found.amplitude))
