"""What a terminal shows of a validation."""

from rich.markup import escape
from rich.table import Table

from ...core.console import make_console
from .phases import PHASES, Phase
from .validate import Validation

__all__ = ["print_validation"]


def print_validation(found: Validation) -> None:
    """Print the worst RRMSE of every quantity, by test and phase, with the column where it is."""
    console = make_console()
    table = Table(title="Worst RRMSE, delay removed, of what moves", title_justify="left")
    quantities = ("wrench", "displacement", "velocity", "acceleration", "spool_command")
    for head in ("test", "phase", "force", *quantities[1:]):
        table.add_column(escape(head.replace("_", " ")))
    skipped: dict[str, list[str]] = {}
    for phase in found.phases:
        if phase.reason:
            skipped.setdefault(f"no {PHASES[phase.number]}: {phase.reason}", []).append(phase.test)
        else:
            cells = (_worst(phase, quantity) for quantity in quantities)
            table.add_row(escape(phase.test), PHASES[phase.number], *cells)
    console.print(table)
    spread = found.residual_over_noise
    if spread is not None:
        console.print(
            f"Residual of inverse dynamics: {spread[0]:.2g} to {spread[1]:.2g} times the noise of the sensors"
        )
    slides = [
        (abs(a.drift), p.test, a.column)
        for p in found.phases
        if p.number == 2
        for a in p.of("displacement")
        if a.unit == "m"
    ]
    if slides:
        rate, test, column = max(slides)
        console.print(f"Drift of the open loop: at most {1e3 * rate:.3g} mm/s ({test}, {column})", markup=False)
    for words, tests in skipped.items():
        console.print(f"{', '.join(tests)}: {words}", markup=False, highlight=False, soft_wrap=True)


def _worst(phase: Phase, quantity: str) -> str:
    rows = [a for a in phase.of(quantity) if a.moves]
    if not rows:
        return "-"
    one = max(rows, key=lambda a: a.rrmse_aligned)
    return f"{100 * one.rrmse_aligned:.3g} % ({one.column})"
