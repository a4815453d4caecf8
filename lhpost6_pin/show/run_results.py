"""The report of a test on a plant and the notes of a run in it: of `run`, `link` and notebooks alike."""

from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from ..data.metrics import channel
from ..mechanics.plant import Plant
from ..mechanics.specimen_joints import joints_beyond, specimen_doubts
from ..simulation.coupling import DOUBTFUL
from ..simulation.limit_use import plant_limits
from ..simulation.rehearse import SimulatedTest
from ..simulation.simulate import Run
from ..simulation.trouble import run_doubts
from ..tuning.interaction import Interaction
from .capacity_tables import judged, performance_loads
from .report.run_report import RunSummary, write_run_report
from .tables import machine_rows

__all__ = ["notes_of_run", "run_remarks", "write_test_report"]


def run_remarks(test: SimulatedTest) -> list[str]:
    """Remarks on a run that has not diverged: joints beyond their limits, low pressures, ends of strokes."""
    run, record = test
    if run.diverged:
        return []
    joints = joints_beyond(run.plant, run.time, run.q)
    return [*joints, *run_doubts(run, channel(record, "actuator_displacement"))]


def notes_of_run(run: Run, remarks: Sequence[str]) -> list[str]:
    """Trouble of a run, remarks on it (`run_remarks`), and doubts of its specimen and of the exchange with it."""
    exchange = run.coupling
    doubts = [exchange.summary] if exchange and abs(exchange.energy_error) > DOUBTFUL else []
    return [*filter(None, [run.trouble]), *remarks, *doubts, *specimen_doubts(run.plant)]


def write_test_report(
    plant: Plant,
    record: xr.Dataset,
    path: Path | None,
    notes: Sequence[str],
    *,
    command: str | None = None,
    interaction: Interaction | None = None,
) -> RunSummary:
    """Write the report of a test on a plant, with its limits and what its motion demands; returns its summary.

    Without a path only the summary is made, without what the page alone shows.
    """
    demands, fits = judged(plant, record)
    return write_run_report(
        record,
        path,
        limits=plant_limits(plant),
        notes=notes,
        command=command,
        machine_table=machine_rows(plant.machine),
        interaction=interaction,
        demands=demands,
        loads=[] if path is None else performance_loads(plant.machine, payload=False),
        fits=fits,
    )
