"""Sections of a sine report: harmonics, the last cycles, convergence of the error, spool commands."""

from itertools import pairwise

import numpy as np

from ...core.arrays import Array
from ...core.names import AXES, SAMPLE_RATE
from ...data.distortion import Harmonics
from ...mechanics.pose import platen_motion
from ...tuning.sine import SineResult, SineTest
from .charts import Curve, Panel, XAxis, chart_figure
from .page import Block, Figure, Table, details, grid, number
from .plots import AFTER, BEFORE, TARGET, Row, Trace, time_figure
from .run_spools import spool_figure
from .scales import axis_scale, percent

__all__ = [
    "convergence_figure",
    "error_per_cycle",
    "harmonic_blocks",
    "history_figure",
    "motion_error",
    "percent_of_fundamental",
    "spool_blocks",
]

STEP = 1.0 / SAMPLE_RATE
FLOOR = 1e-4  # [%] of the fundamental below which harmonics are not drawn
QUIET = 0.02  # share of the stroke below which a spool counts as quiet
CYCLES = 2  # that are drawn


def _results(test: SineTest) -> tuple[tuple[str, SineResult, dict[str, object]], ...]:
    """Name, result and line of both runs."""
    return ("controller alone", test.before, BEFORE), ("with cancellers", test.after, AFTER)


def motion_error(test: SineTest, found: SineResult, quantity: str = "acceleration") -> Array:
    """Return achieved minus target motion (n,) over the whole test, SI."""
    achieved, k = platen_motion(found.run.plant, found.run.q, found.run.v, found.run.a), AXES.index(test.axis)
    return np.asarray((getattr(achieved, quantity) - getattr(test.target, quantity))[:, k])


def harmonic_blocks(test: SineTest) -> list[Block]:
    """Return bars of all harmonics relative to the fundamental, and their table, collapsed."""
    frequency = test.before.acceleration.frequency
    if len(frequency) < 2:
        return ["No harmonic of this frequency is within the band of the table."]
    panels, columns, header = [], [], ["Harmonic", "Frequency"]
    for quantity in ("acceleration", "displacement"):
        curves = []
        for name, found, line in _results(test):
            share = _shares(getattr(found, quantity))
            columns.append(share)
            header.append(f"{quantity.capitalize()}, {name}")
            curves.append(Curve(name, np.arange(2, len(share) + 1), np.maximum(share[1:], FLOOR), line, "bar"))
        top = max(float(column[1:].max()) for column in columns[-2:])
        title = f"{quantity.capitalize()} [% of the fundamental, logarithmic axis]"
        panels.append(Panel(title, curves, log=True, span=(FLOOR, max(2.0 * top, 1.0))))
    words = f"Amplitudes of the harmonics of {number(test.frequency)} Hz relative to the fundamental."
    title = "Harmonics relative to the fundamental"
    rows = [
        (str(n + 1), f"{number(float(frequency[n]))} Hz", *(percent_of_fundamental(c[n]) for c in columns))
        for n in range(1, len(frequency))
    ]
    return [
        chart_figure("harmonics", title, words, panels, XAxis("Harmonic"), row_height=200),
        details(f"All harmonics ({len(rows)})", Table("Relative to the fundamental", header, rows)),
    ]


def history_figure(test: SineTest) -> Figure:
    """Return target and achieved displacement and acceleration of the last cycles, and the errors."""
    rows = []
    for quantity in ("displacement", "acceleration"):
        target, scale = getattr(test.target, quantity)[:, AXES.index(test.axis)], axis_scale(test.axis, quantity)
        errors = [Trace(name, motion_error(test, found, quantity), line) for name, found, line in _results(test)]
        achieved = [Trace(e.name, target + e.values, e.line) for e in errors]
        rows.append(Row(quantity.capitalize(), [Trace("target", target, TARGET), *achieved], scale))
        rows.append(Row(f"Error of the {quantity}", errors, scale))
    words = f"The last {CYCLES} cycles measured, every sample, no delay removed."
    window = _last_cycles(test)
    return time_figure("cycles", "Target and achieved", words, rows, start=0.0, step=STEP, window=window)


def convergence_figure(test: SineTest) -> Figure:
    """Return the RMS error of every cycle of the test, relative to the target sine."""
    panels = []
    for quantity, fundamental in (("displacement", 1.0), ("acceleration", (2.0 * np.pi * test.frequency) ** 2)):
        size = test.amplitude * fundamental / np.sqrt(2.0)
        curves = []
        for name, found, line in _results(test):
            time, rms = error_per_cycle(motion_error(test, found, quantity), test.frequency)
            share = 100.0 * rms / size
            drawn = share >= FLOOR  # not while nothing moves yet
            curves.append(Curve(name, time[drawn], share[drawn], line, "lines+markers"))
        panels.append(Panel(f"Error of the {quantity} [%]", curves, log=True))
    words = (
        "RMS of achieved minus target over each cycle, no delay removed, relative to the RMS of the full sine. The "
        "dotted lines mark the measured interval; the sine then fades out."
    )
    measured = test.target.time[test.measured] - test.target.time[0]
    ends = float(measured[0]), float(measured[-1])
    title, over = "Error of every cycle", XAxis("Time [s]")
    return chart_figure("convergence", title, words, panels, over, row_height=200, marks=ends)


def spool_blocks(test: SineTest) -> list[Block]:
    """Return the spool commands of all actuators over the last cycles against the limits ±1."""
    known = [(name, found.run.command, line) for name, found, line in _results(test) if found.run.command is not None]
    if not known:
        return ["The runs have no spool commands."]
    window = _last_cycles(test)
    rows: list[list[str]] = []
    working: list[Figure] = []
    quiet: list[Figure] = []
    for i, label in enumerate(test.before.run.plant.machine.actuator_names):
        sizes = [np.abs(command[test.measured, i]) for _, command, _ in known]
        rows.append([label, *(percent(float(x)) for size in sizes for x in (size.max(), np.mean(size >= 1.0)))])
        traces = [Trace(name, command[:, i], line) for name, command, line in known]
        full = np.abs(traces[-1].values) >= 1.0
        share = float(full[slice(*window)].mean())
        words = f"At its limit {percent(share)} of the time." if share else "Within its limits."
        drawing = spool_figure(
            f"spool-{i + 1}", label, words, traces, full, start=0.0, step=STEP, window=window, row_height=140
        )
        used = max(float(np.abs(trace.values[slice(*window)]).max()) for trace in traces) >= QUIET
        (working if used else quiet).append(drawing)
    header = ["Actuator", *(f"{what}, {name}" for name, *_ in known for what in ("Largest", "At the limit"))]
    how = (
        "Commands to the fourth-stage spools as a fraction of their stroke over the last cycles, on one scale, with "
        "the limits ±1, where the valve saturates. Shaded: a command of the run with cancellers is at its limit."
    )
    blocks: list[Block] = [Table("Commands over the measured cycles", header, rows), how, grid(*working, pairs=True)]
    if quiet:
        title = f"Actuators below {100 * QUIET:g} % of the spool stroke ({len(quiet)})"
        blocks.append(details(title, grid(*quiet, pairs=True)))
    return blocks


def percent_of_fundamental(share: float) -> str:
    """Return an amplitude [% of the fundamental]; below the plotted floor as an inequality."""
    return f"< {FLOOR:.4f}\N{NO-BREAK SPACE}%" if share <= FLOOR else percent(share / 100.0)


def error_per_cycle(error: Array, frequency: float) -> tuple[Array, Array]:
    """Return middle [s] and RMS of every whole cycle of an error (n,) from its start."""
    edges = np.round(np.arange(0.0, len(error) * STEP * frequency) / frequency / STEP).astype(int)
    pairs = list(pairwise(edges[edges <= len(error)].tolist()))
    rms = [float(np.sqrt(np.mean(error[a:b] ** 2))) for a, b in pairs]
    return np.array([0.5 * (a + b) * STEP for a, b in pairs]), np.array(rms)


def _last_cycles(test: SineTest) -> tuple[int, int]:
    """First and last sample of the last cycles measured."""
    stop = min(test.measured.stop, len(test.target.time))
    return max(stop - round(CYCLES / test.frequency * SAMPLE_RATE), test.measured.start), stop


def _shares(found: Harmonics) -> Array:
    """Amplitudes over the fundamental's [%]; zero where there is none."""
    first = found.amplitude[0]
    return 100.0 * found.amplitude / first if first > 0.0 else np.zeros(len(found.amplitude))
