"""The report of any result as a page: as the last line of a notebook's cell it is shown there."""

import tempfile
from functools import singledispatch
from pathlib import Path
from typing import Any

import xarray as xr

from ..core.errors import LhpostError
from ..core.files import shipped
from ..discovery import Discovery
from ..identification.calibration import Calibration
from ..identification.decompose import Decomposed, find_agreement, find_work
from ..identification.validation import Validation
from ..machine.machine import Machine, load_machine
from ..machine.recorded_changes import changes_summary
from ..mechanics.plant import make_plant
from ..simulation.rehearse import SimulatedTest
from ..tuning.iterate import Iterated
from ..tuning.sine import SineTest
from ..tuning.tune import Tuning
from .report.calibrate_report import write_calibrate_report
from .report.decompose_report import write_decompose_report
from .report.discover_report import write_discover_report
from .report.iterate_report import write_iterate_report
from .report.page_summary import summary_only, summary_text
from .report.run_report import write_run_report
from .report.sine_report import write_sine_report
from .report.tune_report import write_tune_report
from .report.validate_report import write_validate_report
from .run_results import notes_of_run, run_remarks, write_test_report
from .viewer import Picture

__all__ = ["show_report", "show_summary", "show_text"]

HEIGHT = 800  # in a notebook [CSS px]
SUMMARY_HEIGHT = 420  # of a summary [CSS px]


def show_report(result: Any) -> Picture:
    """Return the report of a record, or of the result of a run, a tuning or an analysis.

    A record is judged by the shipped machine that it names. `save` of the report writes one HTML file. Raises TypeError
    for anything else, and what the report of its kind raises.
    """
    return Picture(_page(result), HEIGHT)


def show_summary(result: Any) -> Picture:
    """Return the head of the report of a result: verdict, key figures and remarks. Raises as `show_report`."""
    return Picture(summary_only(_page(result)), SUMMARY_HEIGHT)


def show_text(result: Any) -> str:
    """Return the head of the report of a result as plain text of a few lines. Raises as `show_report`."""
    return summary_text(_page(result))


def _page(result: Any) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "report.html"
        _write(result, path)
        return path.read_text(encoding="utf-8")


@singledispatch
def _write(result: Any, path: Path) -> Any:
    raise TypeError(f"{type(result).__name__} has no report; give a record or the result of an analysis")


@_write.register
def _(result: xr.Dataset, path: Path) -> Any:
    machine = _recorded_machine(result)
    if machine is None:
        return write_run_report(result, path)
    shown = f"Limits are those of the shipped {machine.name}; the record was"
    notes = [f"{shown} {change}." for change in changes_summary(result.attrs)]
    return write_test_report(make_plant(machine), result, path, notes)


def _recorded_machine(record: xr.Dataset) -> Machine | None:
    """The shipped machine that a record names, with the specimen and valves that it states; None if there is none."""
    name = str(record.attrs.get("machine", "")).lower()
    if name not in shipped():
        return None
    try:
        return load_machine(name).as_tested(record.attrs, "the record")
    except LhpostError:  # its specimen is not here
        return None


@_write.register
def _(result: SimulatedTest, path: Path) -> Any:
    return write_test_report(result.run.plant, result.record, path, notes_of_run(result.run, run_remarks(result)))


@_write.register
def _(result: Decomposed, path: Path) -> Any:
    return write_decompose_report(result, find_agreement(result), find_work(result), path)


_write.register(Calibration, write_calibrate_report)
_write.register(Validation, write_validate_report)
_write.register(Discovery, write_discover_report)
_write.register(Tuning, write_tune_report)
_write.register(Iterated, write_iterate_report)
_write.register(SineTest, write_sine_report)
