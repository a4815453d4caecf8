"""The command for force decomposition: decompose."""

from pathlib import Path
from typing import Annotated

import typer

from .app import app, tell
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
)
from .runs import repeating_command

__all__ = ["decompose"]


@app.command()
def decompose(
    record: Annotated[Path, typer.Argument(help="Record of a test, measured or simulated.")],
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    sensors: SensorsName = "lhpost6",
    cutoff: Annotated[float | None, typer.Option(help="Low-pass of all forces [Hz]; default: 33.")] = None,
    no_align: Annotated[bool, typer.Option("--no-align", help="Do not correct skews between channels.")] = False,
    json: Json = False,
) -> None:
    """Decompose the forces of a test, effect by effect, by inverse dynamics; writes ledger.nc and report.html."""
    from ..data.records import load_record
    from ..data.sensors import load_sensors
    from ..identification.decompose import decompose_record, find_agreement, find_work, save_ledger
    from ..show.report import write_decompose_report
    from ..show.result_tables import print_agreement
    from ..show.results import agreement_entries

    table = find_table(machine, override, 0, specimen, specimen_at, locked)
    measured = load_record(record)
    name = record.stem if record.stem != "record" else str(measured.attrs.get("test", "record")).replace("/", "_")
    folder = folder_for(out, f"{name}_forces")
    found = decompose_record(table, measured, load_sensors(sensors), cutoff=cutoff, align=not no_align)
    agreement, work = find_agreement(found), find_work(found)
    save_ledger(found, folder / "ledger.nc", work, str(record))
    report = write_decompose_report(found, agreement, work, folder / "report.html", command=repeating_command())
    files = [folder / "ledger.nc", report]
    tell(json, lambda: agreement_entries(found, agreement), lambda: print_agreement(found, agreement), files)
