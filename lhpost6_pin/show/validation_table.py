"""Terminal table of a validation."""

from rich.markup import escape

from ..core.console import make_console
from ..identification.validation import PHASES, Phase, Validation
from .calibration_table import make_table

__all__ = ["print_validation"]


def print_validation(found: Validation) -> None:
    """Print the largest RRMSE of every quantity, by test and phase, with its column."""
    console = make_console()
    quantities = ("wrench", "displacement", "velocity", "acceleration", "spool_command")
    heads = ("test", "phase", "force", *(q.replace("_", " ") for q in quantities[1:]))
    table = make_table("Largest RRMSE of columns that move, delay removed", *heads, left=len(heads))
    skipped: dict[str, list[str]] = {}
    for phase in found.phases:
        if phase.reason:
            skipped.setdefault(f"no {PHASES[phase.number]}: {phase.reason}", []).append(phase.test)
        else:
            table.add_row(escape(phase.test), PHASES[phase.number], *(_largest(phase, q) for q in quantities))
    console.print(table)
    if (spread := found.residual_over_noise) is not None:
        console.print(f"Residual of inverse dynamics: {spread[0]:.2g} to {spread[1]:.2g} times the sensors' noise")
    open_loops = [p for p in found.phases if p.number == 2]
    drifts = [(abs(a.drift), p.test, a.column) for p in open_loops for a in p.of("displacement") if a.unit == "m"]
    if drifts:
        rate, test, column = max(drifts)
        console.print(f"Drift of the open loop: at most {1e3 * rate:.3g} mm/s ({test}, {column})", markup=False)
    for reason, tests in skipped.items():
        console.print(f"{', '.join(tests)}: {reason}", markup=False, highlight=False, soft_wrap=True)


def _largest(phase: Phase, quantity: str) -> str:
    rows = [a for a in phase.of(quantity) if a.moves]
    if not rows:
        return "-"
    one = max(rows, key=lambda a: a.rrmse_aligned)
    return f"{100 * one.rrmse_aligned:.3g} % ({one.column})"
