"""The command that compares the model with measured campaigns: validate."""

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import ParameterError
from .app import app, progress_bar, tell
from .completion import complete_controller
from .options import (
    Json,
    Locked,
    MachineName,
    Out,
    Override,
    SensorsName,
    SpecimenAt,
    SpecimenName,
    find_settings,
    find_table,
    folder_for,
    refuse_no_jobs,
)
from .runs import repeating_command

__all__ = ["validate"]


@app.command()
def validate(
    campaign: Annotated[Path, typer.Argument(help="Campaign: a directory of records of one machine in one state.")],
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    sensors: SensorsName = "lhpost6",
    controller: Annotated[
        str | None,
        typer.Option(
            help="Controller settings for phase 3: name or TOML file; default: those named in the records.",
            autocompletion=complete_controller,
        ),
    ] = None,
    phases: Annotated[str, typer.Option(help="Phases: 1 inverse dynamics, 2 open loop, 3 closed loop.")] = "1,2,3",
    jobs: Annotated[int, typer.Option(help="Tests in parallel (threads); -1: all cores.")] = -1,
    json: Json = False,
) -> None:
    """Validate the model on measured tests in three phases; writes report.html and metrics.json."""
    from ..data.campaign import load_campaign
    from ..data.sensors import load_sensors
    from ..identification.validation import metrics, save_metrics
    from ..identification.validation import validate as validate_campaign
    from ..show.report.validate_report import write_validate_report
    from ..show.result_tables import print_validation

    refuse_no_jobs(jobs, "tests at a time")
    wanted = _phases(phases)
    table = find_table(machine, override, 0, specimen, specimen_at, locked)
    settings = find_settings(controller, table) if controller else None
    known, tests = load_sensors(sensors), load_campaign(campaign, table)
    folder = folder_for(out, f"{tests.name}_validation")
    with progress_bar(f"validating {table.name} on {tests.name}") as progress:
        found = validate_campaign(
            table, tests, sensors=known, settings=settings, phases=wanted, jobs=jobs, progress=progress
        )
    save_metrics(found, folder / "metrics.json")
    report = write_validate_report(found, folder / "report.html", command=repeating_command())
    tell(json, lambda: metrics(found), lambda: print_validation(found), [folder / "metrics.json", report])


def _phases(text: str) -> tuple[int, ...]:
    words = [word.strip() for word in text.split(",")]
    if not words or not set(words) <= {"1", "2", "3"}:
        raise ParameterError(f"--phases {text}: write some of 1,2,3 with commas between them")
    return tuple(sorted({int(word) for word in words}))
