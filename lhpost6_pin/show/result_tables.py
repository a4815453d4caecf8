"""Results of commands in a terminal: the tables of their reports."""

from ..discovery import Discovery
from ..identification.calibration import Calibration
from ..identification.calibration.calibration_summary import (
    contradiction_summary,
    correlation_summary,
    cut_strokes,
    range_summary,
)
from ..identification.decompose import Decomposed, WrenchAgreement
from ..identification.validation import PHASES, Phase, Validation
from ..tuning.iterate import Iterated
from ..tuning.sine import SineTest
from ..tuning.tune import Tuning
from .report.calibrate_sections import misfit_table, parameter_table, sensor_table
from .report.control_blocks import gain_table
from .report.decompose_report import match_tables, residual_tables
from .report.discover_report import discovery_tables, verdict_sentence
from .report.iterate_report import iteration_tables
from .report.page import Table
from .report.scales import percent, si_unit
from .report.sine_report import sine_table
from .report.tune_report import tuning_tables
from .terminal import print_blocks

__all__ = [
    "print_agreement",
    "print_calibration",
    "print_discovery",
    "print_iterations",
    "print_sine",
    "print_tuning",
    "print_validation",
]


def print_tuning(tuning: Tuning) -> None:
    """Print bands and margins before and after, and the settings that changed."""
    changed, _ = gain_table(tuning.before, tuning.after, [axis.axis for axis in tuning.axes])
    limits = [f"{axis.axis}: {axis.limited_by}" for axis in tuning.axes]
    stable = "stable" if tuning.doubled else "unstable"
    doubled = f"With all master gains doubled, without dry friction: {stable}"
    print_blocks(*tuning_tables(tuning), changed, *limits, doubled)


def print_iterations(result: Iterated) -> None:
    """Print the errors of every iteration, and the stopping criterion."""
    print_blocks(*iteration_tables(result), f"stopped: {result.reason}")


def print_sine(test: SineTest) -> None:
    """Print amplitude, phase and distortion without and with cancellers."""
    print_blocks(
        f"{test.amplitude:g} {si_unit(test.axis)} at {test.frequency:g} Hz in {test.axis}; distortion over all "
        "harmonics to 33 Hz",
        sine_table(test),
    )


def print_calibration(calibration: Calibration) -> None:
    """Print parameters, significant sensor errors, misfits and convergence."""
    off, rounds = sensor_table(calibration), f"{calibration.rounds} round{'s' * (calibration.rounds != 1)}"
    print_blocks(
        parameter_table(calibration),
        off,
        f"{len(off.rows)} of {len(calibration.unknowns)} sensor errors are significant, {range_summary(calibration)}",
        misfit_table(calibration),
        *cut_strokes(calibration),
        correlation_summary(calibration),
        contradiction_summary(calibration),
        f"converged after {rounds}"
        if calibration.converged
        else f"not converged in {rounds}: the tests carry too little information; add tests or excite more",
    )


def print_agreement(found: Decomposed, agreement: WrenchAgreement) -> None:
    """Print the residual with its expected size, and errors of the modelled forces, axis by axis."""
    print_blocks(*residual_tables(found, agreement), *match_tables(found, agreement))


def print_discovery(found: Discovery) -> None:
    """Print the verdict, the effects with their parameters, and the errors on held-out tests."""
    print_blocks(verdict_sentence(found), *discovery_tables(found))


def print_validation(found: Validation) -> None:
    """Print the largest RRMSE of every quantity, by test and phase, with its column."""
    quantities = ("wrench", "displacement", "velocity", "acceleration", "spool_command")
    heads = ("test", "phase", "force", *(q.replace("_", " ") for q in quantities[1:]))
    judged = [p for p in found.phases if not p.reason]
    rows = [(p.test, PHASES[p.number], *(_largest(p, quantity) for quantity in quantities)) for p in judged]
    words = []
    if (spread := found.residual_over_noise) is not None:
        words.append(f"Residual of inverse dynamics: {spread[0]:.2g} to {spread[1]:.2g} times the sensors' noise")
    open_loops = [p for p in found.phases if p.number == 2]
    drifts = [(abs(a.drift), p.test, a.column) for p in open_loops for a in p.of("displacement") if a.unit == "m"]
    if drifts:
        rate, test, column = max(drifts)
        words.append(f"Drift of the open loop: at most {1e3 * rate:.3g} mm/s ({test}, {column})")
    skipped: dict[str, list[str]] = {}
    for phase in found.phases:
        if phase.reason:
            skipped.setdefault(f"no {PHASES[phase.number]}: {phase.reason}", []).append(phase.test)
    words += [f"{', '.join(tests)}: {reason}" for reason, tests in skipped.items()]
    print_blocks(Table("Largest RRMSE of columns that move, delay removed", heads, rows), *words)


def _largest(phase: Phase, quantity: str) -> str:
    worst = max((a for a in phase.of(quantity) if a.moves), key=lambda a: a.rrmse_aligned, default=None)
    return "-" if worst is None else f"{percent(worst.rrmse_aligned)} ({worst.column})"
