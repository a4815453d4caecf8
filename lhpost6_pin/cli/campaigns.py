"""The command that simulates a campaign: campaign."""

from typing import Annotated

import typer

from ..core.errors import ParameterError
from .app import app, progress_bar, tell
from .options import (
    Json,
    Locked,
    MachineName,
    Out,
    Override,
    SensorsName,
    SettingsName,
    SpecimenAt,
    SpecimenName,
    find_settings,
    find_table,
    folder_for,
)

__all__ = ["campaign"]


@app.command()
def campaign(
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    controller: SettingsName = None,
    sensors: SensorsName = "lhpost6",
    tests: Annotated[str | None, typer.Option(help="Tests of the campaign, such as TX,WN; default: all.")] = None,
    scale: Annotated[float, typer.Option(help="Scale factor of all motions, e.g. for a smaller table.")] = 1.0,
    errors: Annotated[bool, typer.Option(help="Draw random gains, offsets and skews of the sensors.")] = True,
    seed: Annotated[int, typer.Option(min=0, help="Seed of sensor noise and sensor errors.")] = 0,
    json: Json = False,
) -> None:
    """Simulate a campaign of tests, recorded through sensors with noise and errors: to plan a real one."""
    from ..data.campaign import save_campaign
    from ..data.sensors import load_sensors
    from ..simulation.simulated_campaign import simulate_campaign

    table = find_table(machine, override, 0, specimen, specimen_at, locked)
    settings, known = find_settings(controller, table), load_sensors(sensors)
    wanted = tuple(word.strip() for word in tests.split(",")) if tests is not None else None
    if wanted is not None and len(set(wanted)) < len(wanted):
        raise ParameterError(f"--tests {tests}: names a test twice")
    folder = folder_for(out, "campaign")
    if any(folder.glob("*.nc")):
        raise ParameterError(f"--out {folder}: holds records already, which would count as tests; name another folder")
    name = folder.resolve().name
    with progress_bar(f"a campaign on {table.name}") as progress:
        made = simulate_campaign(
            table, settings, known, seed=seed, errors=errors, tests=wanted, scale=scale, name=name, progress=progress
        )
    tests_made = [str(r.attrs["test"]) for r in made.records]
    tell(json, lambda: {"campaign": name, "tests": tests_made}, lambda: None, save_campaign(made, folder))
