"""Commands that print tables: doctor, info, capacity, motions, check."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .app import app, tell
from .completion import complete_motion
from .options import Json, MachineName, Override, SensorsName, find_machine

if TYPE_CHECKING:
    from ..data.consistency import ConsistencyFinding
    from ..machine.machine import Machine

__all__ = ["capacity", "check", "doctor", "info", "motions"]


@app.command()
def doctor(json: Json = False) -> None:
    """Print versions, the cache of compiled code and optional dependencies."""
    from .doctor import examine, print_doctor

    found = examine()
    tell(json, found._asdict, lambda: print_doctor(found))


@app.command()
def info(machine: MachineName = "lhpost6", override: Override = None, json: Json = False) -> None:
    """Print a machine: every number with unit, uncertainty and source; assumed values are marked."""
    from ..show.results import machine_entries
    from ..show.tables import print_machine

    table = find_machine(machine, override)
    tell(json, lambda: machine_entries(table), lambda: print_machine(table))


@app.command()
def capacity(machine: MachineName = "lhpost6", override: Override = None, json: Json = False) -> None:
    """Compare the capacity of the model with Table 2.2, and print the oil-column modes."""
    from ..mechanics.capacity import has_printed_capacity
    from ..show.results import capacity_entries
    from ..show.tables import print_capacity, print_modes

    table = find_machine(machine, override)

    def show() -> None:
        if has_printed_capacity(table):
            print_capacity(table)
        print_modes(table)

    tell(json, lambda: capacity_entries(table), show)


@app.command()
def motions(
    name: Annotated[
        str | None, typer.Argument(help="A motion, to print its options.", autocompletion=complete_motion)
    ] = None,
    json: Json = False,
) -> None:
    """List ground motions and tests by name."""
    from ..show.results import motion_entries
    from ..show.tables import print_motions

    tell(json, lambda: motion_entries(name), lambda: print_motions(name))


@app.command()
def check(
    file: Annotated[Path, typer.Argument(help="Record, or a campaign: a directory of records.")],
    machine: MachineName = "lhpost6",
    override: Override = None,
    sensors: SensorsName = "lhpost6",
    json: Json = False,
) -> None:
    """Check records: layout, values, and the agreement of redundant sensors."""
    from ..data.check import check_record
    from ..show.results import finding_entries
    from ..show.tables import print_findings, print_sensor_findings

    table = find_machine(machine, override)
    files = sorted(file.glob("*.nc")) or [file]
    found = {str(path): check_record(path, table) for path in files}
    wrong = any(f.severity == "error" for findings in found.values() for f in findings)
    compared = None if wrong else _check_sensors(table, files, sensors)

    def show() -> None:
        for path, findings in found.items():
            print_findings(path, findings)
        if compared is not None:
            print_sensor_findings(compared)

    tell(json, lambda: {**finding_entries(found), "sensors": compared}, show)
    if wrong:
        raise typer.Exit(1)


def _check_sensors(table: "Machine", files: list[Path], sensors: str) -> "list[ConsistencyFinding] | None":
    """Compare redundant sensors in measured records of this machine; noise-free simulated records are skipped."""
    from ..data.consistency import check_sensors
    from ..data.records import is_measured, load_record
    from ..data.sensors import load_sensors
    from ..mechanics.plant import make_plant

    records = [load_record(path) for path in files]
    labels = {"actuator": table.actuator_names, "strut": table.strut_names}
    measured = [
        r
        for r in records
        if is_measured(r)
        and all([str(x) for x in r[dim].values] == list(names) for dim, names in labels.items() if dim in r.coords)
    ]
    return list(check_sensors(make_plant(table), measured, load_sensors(sensors))) if measured else None
