"""Calibration results as tables for a terminal."""

import numpy as np
from rich.markup import escape
from rich.table import Table

from ..core.console import make_console
from ..identification.calibration import Calibration
from ..identification.calibration.calibration_summary import (
    contradiction_summary,
    correlation_summary,
    cut_strokes,
    range_summary,
)
from ..identification.calibration.verdicts import beyond, far, stated_range, verdict_on
from ..identification.residuals import RESIDUALS

__all__ = ["make_table", "print_calibration"]


def print_calibration(calibration: Calibration) -> None:
    """Print parameters, significant sensor errors, misfits and convergence."""
    console = make_console()
    console.print(_parameters(calibration))
    console.print(_sensors(calibration))
    console.print(_misfits(calibration))
    for said in (*cut_strokes(calibration), correlation_summary(calibration), contradiction_summary(calibration)):
        if said:
            console.print(escape(said))
    rounds = f"{calibration.rounds} round{'s' * (calibration.rounds != 1)}"
    console.print(
        f"converged after {rounds}"
        if calibration.converged
        else f"[bold red]not converged[/] in {rounds}: the tests carry too little information; add tests or excite more"
    )


def _parameters(calibration: Calibration) -> Table:
    table = make_table("Parameters", "name", "nominal", "estimate", "unit", "90 % interval", "sd/prior", "verdict")
    for i, parameter in enumerate(calibration.parameters):
        low, high = calibration.interval(i)
        estimate = parameter.at(float(calibration.estimate[i]))
        interval = f"{low:.5g} to {high:.5g}" if calibration.converged else "none"
        numbers = f"{parameter.value:.5g}", f"{estimate:.5g}", parameter.unit, interval
        table.add_row(escape(parameter.name), *numbers, _share(calibration, i), verdict_on(calibration, i))
    return table


def _sensors(calibration: Calibration) -> Table:
    first, distance = len(calibration.parameters), far(calibration)
    order = sorted(range(first, len(distance)), key=lambda i: -abs(distance[i]))
    outside, allowed = beyond(calibration), stated_range(calibration)
    found = [i for i in order if outside[i]]
    title = f"Errors of the sensors: {len(found)} of {len(order)} significant, {range_summary(calibration)}"
    table = make_table(title, "error", "estimate", "unit", "of its range", "deviations", "sd/prior")
    for i in found:
        unknown, share = calibration.unknowns[i - first], abs(calibration.estimate[i]) / allowed[i]
        numbers = f"{calibration.estimate[i]:.4g}", unknown.unit, f"{share:.0%}", f"{distance[i]:+.1f}"
        table.add_row(escape(unknown.name), *numbers, _share(calibration, i))
    return table


def _misfits(calibration: Calibration) -> Table:
    kinds = [k for k, after in enumerate(calibration.misfit_after.T) if np.isfinite(after).any()]
    title = "Misfit before, after; 1 is sensor noise alone"
    table = make_table(title, "test", *(RESIDUALS[k] for k in kinds))
    for test, before, after in zip(calibration.tests, calibration.misfit_before, calibration.misfit_after, strict=True):
        table.add_row(escape(test), *(f"{before[k]:.3g}, {after[k]:.3g}" for k in kinds))
    return table


def _share(calibration: Calibration, i: int) -> str:
    return f"{calibration.sd[i] / calibration.prior[i]:.2g}"


def make_table(title: str, *heads: str, left: int = 1) -> Table:
    """Empty table whose first columns, `left` of them, are flush left."""
    table = Table(title=escape(title), title_justify="left")
    for n, head in enumerate(heads):
        table.add_column(escape(head), justify="right" if n >= left else "left")
    return table
