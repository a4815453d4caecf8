"""Results of commands in a terminal: the tables of their reports."""

from collections.abc import Mapping
from typing import Any

from ..data.campaign import skipped_summary
from ..discovery import Discovery
from ..identification.calibration import Calibration
from ..identification.calibration.calibration_summary import (
    command_note,
    contradiction_summary,
    convergence_summary,
    correlation_summary,
    cut_strokes,
    delay_summary,
    friction_summary,
    interval_summary,
    range_summary,
)
from ..identification.calibration.scale import scale_summary
from ..identification.decompose import Decomposed, WrenchAgreement
from ..identification.validation import Validation
from ..tuning.iterate import Iterated
from ..tuning.sine import SineTest
from ..tuning.tune import Tuning
from .report.calibrate_sections import misfit_table, parameter_table, ratio_tables, sensor_table
from .report.control_blocks import gain_table
from .report.decompose_report import match_tables, residual_tables
from .report.discover_report import discovery_tables, verdict_sentence
from .report.friction_section import friction_table
from .report.interface_section import interface_table
from .report.iterate_report import iterate_verdict, iteration_tables, target_demands
from .report.page import Table
from .report.scales import axis_scale, shown_as
from .report.sine_report import sine_table, sine_verdict
from .report.tune_report import losses, measuring_doubts, specimen_limits, trades, tuning_tables
from .report.validate_machine import drift_blocks
from .report.validate_report import validation_notes, validation_verdict
from .report.validate_sections import summary_blocks
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
    before = [] if tuning.was_stable else [f"Unstable with the settings before, {tuning.before.name}"]
    remarks = *specimen_limits(tuning), *losses(tuning), *trades(tuning), *measuring_doubts(tuning)
    print_blocks(*before, *tuning_tables(tuning), changed, *limits, doubled, *remarks)


def print_iterations(result: Iterated, loop: Mapping[str, Any]) -> None:
    """Print the verdict, the errors of every iteration, and the stopping criterion."""
    verdict, _ = iterate_verdict(result, loop)
    print_blocks(verdict, *iteration_tables(result), target_demands(result), f"stopped: {result.reason}")


def print_sine(test: SineTest, loop: Mapping[str, Any]) -> None:
    """Print the verdict, amplitude, phase and distortion without and with cancellers."""
    amplitude = shown_as(test.amplitude, axis_scale(test.axis, "displacement"))
    what = f"{amplitude} at {test.frequency:g} Hz in {test.axis}"
    print_blocks(sine_verdict(test, loop)[0], what, sine_table(test))


def print_calibration(calibration: Calibration) -> None:
    """Print parameters, significant sensor errors, misfits, forms of friction and convergence."""
    off, friction = sensor_table(calibration), friction_table(calibration)
    print_blocks(
        parameter_table(calibration),
        interval_summary(calibration),
        command_note(calibration),
        off,
        f"{len(off.rows)} of {len(calibration.unknowns)} sensor errors are significant, {range_summary(calibration)}",
        delay_summary(calibration),
        misfit_table(calibration),
        *cut_strokes(calibration),
        correlation_summary(calibration),
        contradiction_summary(calibration),
        skipped_summary(calibration.skipped),
        scale_summary(calibration.scale),
        *ratio_tables(calibration),
        *((friction, friction_summary(calibration)) if friction else ()),
        convergence_summary(calibration),
    )


def print_agreement(found: Decomposed, agreement: WrenchAgreement) -> None:
    """Print a specimen's interface wrench, the residual with its expected size, and errors of the modelled forces."""
    how = f"Modelled against measured forces up to {found.comparison.band.high:g} Hz"
    interface = [] if agreement.interface is None else [interface_table(agreement.interface)]
    print_blocks(*interface, how, *residual_tables(found, agreement), *match_tables(found, agreement), found.slip)


def print_discovery(found: Discovery) -> None:
    """Print the verdict, the effects with their parameters, and the errors on held-out tests."""
    print_blocks(verdict_sentence(found), *discovery_tables(found))


def print_validation(found: Validation) -> None:
    """Print the verdict, errors by phase, test and axis, the drift of the open loop, and why phases are missing."""
    blocks = (*summary_blocks(found), *drift_blocks(found))
    tables = (block for block in blocks if isinstance(block, Table))
    print_blocks(validation_verdict(found)[0], *tables, *validation_notes(found))
