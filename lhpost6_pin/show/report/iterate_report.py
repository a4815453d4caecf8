"""The report of a drive iteration: the error of every iteration, and the best drive."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import LhpostError
from ...core.names import AXES
from ...mechanics.pose import PlatenMotion
from ...simulation.motion_limits import judge_motion
from ...tuning.identify import tuning_numbers
from ...tuning.iterate import Iterated, Iteration
from .charts import Curve, Panel, XAxis, chart_figure
from .control_blocks import AXIS_LINES, assumption_blocks, load_of, loop_sentence
from .iterate_plots import compare, drive_blocks, motion_blocks, spectrum_blocks, table_blocks
from .page import Block, Figure, Headline, Level, Page, Section, Table, details, number, save_page
from .run_limits import demand_table
from .scales import milliseconds, percent

__all__ = ["iterate_verdict", "iteration_tables", "target_demands", "write_iterate_report"]

# Judgement, not physics: largest acceleration RRMSE of an axis, and its share of the error before iterating.
REACHED = 0.05
REMAINING = 0.5
# Numbers of `tuning.toml` that identify the table and iterate on it.
NUMBERS = ("noise.rms", "noise.rotation_radius", "noise.low", "noise.high", "noise.segment", "iteration")


def write_iterate_report(
    result: Iterated, path: Path | str, command: str = "", loop: Mapping[str, Any] | None = None
) -> Path:
    """Write the self-contained HTML report of an iteration to `path` and return the path.

    loop: stability of the control loop, see `loop_sentence`.
    """
    verdict, level = iterate_verdict(result, loop or {})
    reference, machine = result.target.reference, result.first_run.plant.machine
    high = tuning_numbers().number("iteration.high")
    found = compare(result, high)
    acceleration, delays, displacement = iteration_tables(result)
    tables: list[Block] = [acceleration, delays, details("Displacement RRMSE", displacement)]
    page = Page(
        kind="Iteration report · simulated",
        title=f"{reference.motion}, iterated",
        purpose=(
            f"Find the drive with which {load_of(machine)}, under “{result.settings.name}”, reproduces "
            f"{reference.title} on {', '.join(_moved(result))}: "
            f"{number(float(result.target.time[-1]))} s, judged from 0 to {high:g} Hz with the delay removed."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(result),
        sections=[
            Section("errors", "Error per iteration", [_errors(result), _stop(result), *tables]),
            Section("motion", "Target and achieved", motion_blocks(found)),
            Section("spectra", "Spectra of the error", spectrum_blocks(found)),
            Section("drive", "Drive and reference", drive_blocks(result, found)),
            Section("table", "Transfer function of the table", table_blocks(result.table)),
            Section("limits", "Demand of the target over capacity", [target_demands(result)]),
            Section("assumptions", "Assumptions and sources", assumption_blocks(machine, NUMBERS)),
        ],
        command=command,
    )
    return save_page(page, path)


def _moved(result: Iterated) -> list[str]:
    """Names of the axes that the target moves."""
    return [axis for axis, error in zip(AXES, result.history[0].acceleration, strict=True) if not np.isnan(error)]


def _by_axis(result: Iterated, iteration: Iteration, quantity: str = "acceleration") -> dict[str, float]:
    """A quantity of an iteration on the axes that the target moves."""
    return {axis: float(getattr(iteration, quantity)[AXES.index(axis)]) for axis in _moved(result)}


def iterate_verdict(result: Iterated, loop: Mapping[str, Any]) -> tuple[str, Level]:
    """Return the verdict, which begins with what its `loop` lacks, and its level."""
    best = result.history[result.best]
    errors, before = _by_axis(result, best), _by_axis(result, result.history[0])
    large = [axis for axis, error in errors.items() if not error <= REACHED]
    little = [axis for axis, error in errors.items() if not error <= REMAINING * before[axis]]
    listed = ", ".join(f"{axis} {percent(errors[axis])}" for axis in large or errors)
    bound = f"{100 * REACHED:g} % after iterating: {listed}."
    words = [
        f"Acceleration RRMSE above {bound}" if large else f"Acceleration RRMSE of every axis is at most {bound}",
        f"More than half of the initial error remains in {', '.join(little)}."
        if little
        else "At most half of the initial error remains in every axis.",
    ]
    if result.best == 0:
        words.insert(0, "No iteration improved on the reference as drive.")
    unsteady, unstable = loop_sentence(loop)
    if unsteady:
        words.insert(0, unsteady)
    if best.clipped:
        words.append(f"{best.clipped} spool commands of the best drive were clipped at their limit.")
    if best.clipped or unstable:
        return " ".join(words), "bad"
    return " ".join(words), "attention" if large or little or result.best == 0 or unsteady else "good"


def _headlines(result: Iterated) -> list[Headline]:
    best = result.history[result.best]
    errors = _by_axis(result, best)
    worst = max(errors, key=errors.__getitem__)
    before = _by_axis(result, result.history[0])[worst]
    return [
        Headline(
            percent(errors[worst]),
            "Worst acceleration RRMSE after iterating",
            f"axis {worst}; initially {percent(before)}",
            "good" if errors[worst] <= min(REACHED, REMAINING * before) else "attention",
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


def _errors(result: Iterated) -> Figure:
    numbers = [i.number for i in result.history]
    panels = []
    for quantity in ("acceleration", "displacement"):
        history = [_by_axis(result, i, quantity) for i in result.history]
        curves = [
            Curve(axis, numbers, [100.0 * errors[axis] for errors in history], AXIS_LINES[axis], "lines+markers")
            for axis in _moved(result)
        ]
        lines = {f"{100 * REACHED:g} % (criterion)": 100.0 * REACHED} if quantity == "acceleration" else {}
        panels.append(Panel(f"{quantity.capitalize()} RRMSE [%]", curves, log=True, lines=lines))
    words = (
        "Iteration 0 uses the reference as drive, 1 the reference through the inverse; later ones correct the drive "
        f"by the remaining error. The dotted line marks the best, {result.best}."
    )
    over, title = XAxis("Iteration", span=(-0.2, numbers[-1] + 0.2), ticks=numbers), "Error per iteration and axis"
    return chart_figure("errors", title, words, panels, over, row_height=210, marks=[result.best])


def iteration_tables(result: Iterated) -> list[Table]:
    """Return the acceleration errors with the use of the valves, the delays removed, and the displacement errors."""
    names = [f"{i.number}{' (best)' if i.number == result.best else ''}" for i in result.history]

    def rows(quantity: str, shown: Callable[[float], str]) -> list[tuple[str, ...]]:
        values = [_by_axis(result, i, quantity).values() for i in result.history]
        return [(name, *map(shown, own)) for name, own in zip(names, values, strict=True)]

    spools = [(percent(i.peak_spool), i.clipped) for i in result.history]
    errors = [(*row, *use) for row, use in zip(rows("acceleration", percent), spools, strict=True)]
    header = ("Iteration", *_moved(result))
    band = f"to {tuning_numbers().number('iteration.high'):g} Hz, delay removed"
    return [
        Table(f"Acceleration RRMSE {band}", (*header, "Largest spool command", "Commands clipped"), errors),
        Table(
            "Delay removed, of the acceleration (negative: ahead of its target)", header, rows("delay", milliseconds)
        ),
        Table(f"Displacement RRMSE {band}", header, rows("displacement", percent)),
    ]


def target_demands(result: Iterated) -> Table | str:
    """Return the demand of the target (not of the achieved motion) on every limit, or why there is none."""
    target = result.target
    motion = PlatenMotion(target.displacement, target.velocity, target.acceleration)
    try:
        return demand_table(judge_motion(result.first_run.plant, motion).peaks)
    except LhpostError as error:
        return f"{error}."


def _stop(result: Iterated) -> Block:
    return (
        f"Stopped after iteration {result.history[-1].number}: {result.reason}. The objective, the mean square of the "
        f"acceleration errors of all axes, is least in iteration {result.best}, whose drive is the result."
    )
