"""The report of a drive iteration: the error of every iteration, and the best drive."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.names import AXES
from ...tuning.identify import tuning_numbers
from ...tuning.iterate import Iterated, Iteration
from .charts import Curve, Panel, XAxis, chart_figure
from .control_blocks import AXIS_LINES, assumption_blocks, load_of
from .iterate_plots import AxisIteration, compare, drive_blocks, motion_blocks, spectrum_blocks, table_blocks
from .page import (
    Figure,
    Headline,
    Level,
    Markup,
    Page,
    Section,
    details,
    figure,
    number,
    paragraph,
    save_page,
    table,
)
from .plots import SCALES
from .run_motion import percent, shown_as

__all__ = ["write_iterate_report"]

# Judgement, not physics: largest acceleration RRMSE of an axis, and its share of the error before iterating.
REACHED = 0.05
REMAINING = 0.5
# Numbers of `tuning.toml` that identify the table and iterate on it.
NUMBERS = ("noise.rms", "noise.rotation_radius", "noise.low", "noise.high", "noise.segment", "iteration")


def write_iterate_report(result: Iterated, path: Path | str, command: str = "") -> Path:
    """Write the self-contained HTML report of an iteration to `path` and return the path."""
    verdict, level = _judge(result)
    reference, plant = result.target.reference, result.first_run.plant
    high = tuning_numbers().number("iteration.high")
    page = Page(
        kind="Iteration report · simulated",
        title=f"{reference.motion}, iterated",
        asked=(
            f"Find the drive with which {load_of(plant.machine)}, under “{result.settings.name}”, reproduces "
            f"{reference.motion} at scale {number(reference.scale)} on {', '.join(_moved(result))}: "
            f"{number(float(result.target.time[-1]))} s, judged from 0 to {high:g} Hz with the delay removed."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(result),
        sections=_sections(result, compare(result, high)),
        command=command,
    )
    return save_page(page, path)


def _moved(result: Iterated) -> list[str]:
    """Names of the axes that the target moves."""
    return [axis for axis, error in zip(AXES, result.history[0].acceleration, strict=True) if not np.isnan(error)]


def _judge(result: Iterated) -> tuple[str, Level]:
    first, best = result.history[0], result.history[result.best]
    level: Level = "good"
    words = []
    if result.best == 0:
        words.append("No iteration improved on the reference as drive.")
        level = "attention"
    errors = dict(zip(AXES, best.acceleration, strict=True))
    large = [axis for axis in _moved(result) if not errors[axis] <= REACHED]
    said = ", ".join(f"{axis} {percent(errors[axis])}" for axis in large or _moved(result))
    if large:
        words.append(f"Acceleration RRMSE above {100 * REACHED:g} % after iterating: {said}.")
        level = "attention"
    else:
        words.append(f"Acceleration RRMSE of every axis is at most {100 * REACHED:g} % after iterating: {said}.")
    before = dict(zip(AXES, first.acceleration, strict=True))
    little = [axis for axis in _moved(result) if not errors[axis] <= REMAINING * before[axis]]
    if little:
        words.append(f"More than half of the initial error remains in {', '.join(little)}.")
        level = "attention"
    else:
        words.append("At most half of the initial error remains in every axis.")
    if best.clipped:
        words.append(f"{best.clipped} spool commands of the best drive were clipped at their limit.")
        level = "bad"
    return " ".join(words), level


def _headlines(result: Iterated) -> list[Headline]:
    first, best = result.history[0], result.history[result.best]
    moved = _moved(result)
    worst = max(moved, key=lambda axis: best.acceleration[AXES.index(axis)])
    errors = best.acceleration[AXES.index(worst)], first.acceleration[AXES.index(worst)]
    return [
        Headline(
            percent(errors[0]),
            "Worst acceleration RRMSE after iterating",
            f"axis {worst}; initially {percent(errors[1])}",
            "good" if errors[0] <= min(REACHED, REMAINING * errors[1]) else "attention",
        ),
        Headline(
            f"{result.best} of {result.history[-1].number}",
            "Best iteration",
            f"stopped: {result.reason}",
            "good" if result.best else "attention",
        ),
        Headline(
            percent(best.peak_spool),
            "Largest spool command",
            f"of the stroke, best drive; {best.clipped} commands clipped",
            "bad" if best.clipped else "good",
        ),
    ]


def _sections(result: Iterated, found: Sequence[AxisIteration]) -> list[Section]:
    machine = result.first_run.plant.machine
    return [
        Section("errors", "Error per iteration", [figure(_errors(result)), _why(result), *_history(result)]),
        Section("motion", "Target and achieved", motion_blocks(found)),
        Section("spectra", "Spectra of the error", spectrum_blocks(found)),
        Section("drive", "Drive and reference", drive_blocks(result, found)),
        Section("table", "Transfer function of the table", table_blocks(result.table)),
        Section("assumptions", "Assumptions and sources", assumption_blocks(machine, NUMBERS)),
    ]


def _errors(result: Iterated) -> Figure:
    numbers = [i.number for i in result.history]
    panels = []
    for quantity in ("acceleration", "displacement"):
        curves = [
            Curve(axis, numbers, 100.0 * _of(result.history, quantity, axis), AXIS_LINES[axis], "lines+markers")
            for axis in _moved(result)
        ]
        lines = {f"{100 * REACHED:g} % (criterion)": 100.0 * REACHED} if quantity == "acceleration" else {}
        panels.append(Panel(f"{quantity.capitalize()} RRMSE [%]", curves, log=True, lines=lines))
    words = (
        "Iteration 0 uses the reference as drive, 1 the reference through the inverse; later ones correct the drive "
        f"by the remaining error. The dotted line marks the best, {result.best}."
    )
    over = XAxis("Iteration", span=(-0.2, numbers[-1] + 0.2), ticks=numbers)
    return chart_figure(
        "errors", "Error per iteration and axis", words, panels, over, row_height=210, marks=[result.best]
    )


def _of(history: Sequence[Iteration], quantity: str, axis: str) -> NDArray[np.float64]:
    return np.array([getattr(i, quantity)[AXES.index(axis)] for i in history])


def _history(result: Iterated) -> list[Markup]:
    """Return tables of the errors, the delays removed, and the use of the valves."""
    moved = _moved(result)
    names = [f"{i.number}{' (best)' if i.number == result.best else ''}" for i in result.history]
    rows = [
        (name, *_shares(i.acceleration, moved), percent(i.peak_spool), i.clipped)
        for name, i in zip(names, result.history, strict=True)
    ]
    header = ("Iteration", *moved, "Largest spool command", "Commands clipped")
    shifts = [
        (name, *(shown_as(i.delay[AXES.index(axis)], SCALES["time"]) for axis in moved))
        for name, i in zip(names, result.history, strict=True)
    ]
    displaced = [(name, *_shares(i.displacement, moved)) for name, i in zip(names, result.history, strict=True)]
    return [
        table("Acceleration RRMSE, delay removed", header, rows),
        table("Delay removed, of the acceleration", header[: len(moved) + 1], shifts),
        details("Displacement RRMSE", table("Displacement RRMSE, delay removed", header[: len(moved) + 1], displaced)),
    ]


def _shares(errors: NDArray[np.float64], axes: Sequence[str]) -> list[str]:
    return [percent(errors[AXES.index(axis)]) for axis in axes]


def _why(result: Iterated) -> Markup:
    last = result.history[-1].number
    return paragraph(
        f"Stopped after iteration {last}: {result.reason}. The objective, the mean square of the acceleration errors "
        f"of all axes, is least in iteration {result.best}, whose drive is the result."
    )
