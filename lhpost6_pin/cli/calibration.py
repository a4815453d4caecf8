"""The command that fits parameters to measured campaigns: calibrate."""

from pathlib import Path
from typing import Annotated

import typer

from .app import app, progress_bar, tell
from .options import (
    Json,
    Locked,
    MachineName,
    Out,
    Override,
    SensorsName,
    SpecimenAt,
    SpecimenName,
    find_table,
    folder_for,
    refuse_no_jobs,
)
from .runs import repeating_command

__all__ = ["calibrate"]


@app.command()
def calibrate(
    campaign: Annotated[Path, typer.Argument(help="Campaign: a directory of records of one machine in one state.")],
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    sensors: SensorsName = "lhpost6",
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulated sensor noise behind the weights.")] = 0,
    jobs: Annotated[int, typer.Option(help="Threads; -1: all cores.")] = -1,
    json: Json = False,
) -> None:
    """Calibrate parameters and sensors on measured tests; writes override.toml and report.html."""
    from ..data.campaign import load_campaign
    from ..data.sensors import load_sensors
    from ..identification.calibration import calibrate as calibrate_machine
    from ..identification.calibration.override import save_override
    from ..show.report import write_calibrate_report
    from ..show.result_tables import print_calibration
    from ..show.results import calibration_entries

    refuse_no_jobs(jobs)
    table = find_table(machine, override, 0, specimen, specimen_at, locked)
    known = load_sensors(sensors)
    tests = load_campaign(campaign, table)
    folder = folder_for(out, f"{tests.name}_calibration")
    with progress_bar(f"calibrating {table.name} by {tests.name}") as progress:
        found = calibrate_machine(
            table, tests.records, known, campaign=tests.name, seed=seed, jobs=jobs, progress=progress
        )
    paths = [
        save_override(found, folder / "override.toml"),
        write_calibrate_report(found, folder / "report.html", command=repeating_command()),
    ]
    tell(json, lambda: calibration_entries(found), lambda: print_calibration(found), paths)
    if not found.converged:
        raise typer.Exit(1)
