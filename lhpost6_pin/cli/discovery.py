"""The command that identifies missing effects: discover."""

from pathlib import Path
from typing import Annotated

import typer

from .app import app, progress_bar, tell
from .options import Json, MachineName, Out, SensorsName, find_machine, folder_for, refuse_no_jobs
from .runs import repeating_command

__all__ = ["discover"]


@app.command()
def discover(
    campaign: Annotated[Path, typer.Argument(help="Campaign: a directory of records of one machine in one state.")],
    model: Annotated[
        Path | None,
        typer.Option("--model", "--override", help="TOML file of parameters and effects to replace."),
    ] = None,
    hold_out: Annotated[
        list[str] | None,
        typer.Option(help="Held-out test, excluded from the search; may be repeated. none: hold out no test."),
    ] = None,
    out: Out = None,
    machine: MachineName = "lhpost6",
    sensors: SensorsName = "lhpost6",
    seed: Annotated[int, typer.Option(help="Seed of the simulated sensor noise.")] = 0,
    jobs: Annotated[int, typer.Option(help="Threads; -1: all cores.")] = -1,
    json: Json = False,
) -> None:
    """Identify effects missing from the model, add them, test them on held-out data.

    Writes verdict.json, model.toml and report.html. An interrupted search resumes from its last checkpoint.
    """
    from ..data.campaign import load_campaign
    from ..data.sensors import load_sensors
    from ..discovery import discover as search
    from ..discovery import verdict_entries
    from ..show.report.discover_report import save_discovery
    from ..show.result_tables import print_discovery

    refuse_no_jobs(jobs)
    table = find_machine(machine, model)
    known, tests = load_sensors(sensors), load_campaign(campaign, table)
    held = None if hold_out is None else [] if hold_out == ["none"] else hold_out
    folder = folder_for(out, f"{tests.name}_discovery")
    with progress_bar(f"searching {tests.name} for what {table.name} lacks") as progress:
        found = search(table, tests, known, hold_out=held, seed=seed, jobs=jobs, unfinished=folder, progress=progress)
    command = repeating_command()
    title = f"{table.name} with what was found in campaign {tests.name}; {command}"
    paths = save_discovery(found, folder, title, command)
    tell(json, lambda: verdict_entries(found), lambda: print_discovery(found), paths)
