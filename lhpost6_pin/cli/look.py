"""Commands to look at things: doctor, info, capacity, motions, check."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .app import app
from .options import MachineName, Override, SensorsName, find_machine

if TYPE_CHECKING:
    from ..machine import Machine

__all__ = ["capacity", "check", "doctor", "info", "motions"]


@app.command()
def doctor() -> None:
    """Say what is installed, whether compiled code is kept, and which optional parts are there."""
    from ..doctor import print_doctor

    print_doctor()


@app.command()
def info(machine: MachineName = "lhpost6", override: Override = None) -> None:
    """Print a machine as a table: every number with unit and source, assumed values marked."""
    from ..tables import print_machine

    print_machine(find_machine(machine, override))


@app.command()
def capacity(machine: MachineName = "lhpost6", override: Override = None) -> None:
    """Compare what the model can give with Table 2.2, and print the oil-column modes."""
    from ..tables import print_capacity, print_modes

    table = find_machine(machine, override)
    if "table_2_2.force_actuators" in table.parameters:
        print_capacity(table)
    print_modes(table)


@app.command()
def motions(name: Annotated[str | None, typer.Argument(help="One of them, to see its options.")] = None) -> None:
    """List the ground motions and tests known by name."""
    from ..tables import print_motions

    print_motions(name)


@app.command()
def check(
    file: Annotated[Path, typer.Argument(help="Record to look into, or a campaign: a folder of records.")],
    machine: MachineName = "lhpost6",
    override: Override = None,
    sensors: SensorsName = "lhpost6",
) -> None:
    """Say what is in records and what is wrong with them, and whether the sensors of measured ones agree."""
    from ..check import check_record
    from ..tables import print_findings

    table = find_machine(machine, override)
    areas = {a.name: (a.area_a, a.area_b or 0.0) for a in table.actuators}
    files = sorted(file.glob("*.nc")) or [file]
    wrong = False
    for path in files:
        findings = check_record(path, areas)
        print_findings(str(path), findings)
        wrong = wrong or any(f.severity == "error" for f in findings)
    if wrong:
        raise typer.Exit(1)
    _check_sensors(table, files, sensors)


def _check_sensors(table: "Machine", files: list[Path], sensors: str) -> None:
    """Compare the sensors of measured records of this machine; what was simulated without noise has none."""
    from ..consistency import check_sensors
    from ..plant import make_plant
    from ..records import is_measured, load_record
    from ..sensors import load_sensors
    from ..tables import print_sensor_findings

    records = [load_record(path) for path in files]
    labels = {"actuator": table.actuator_names, "strut": table.strut_names}
    measured = [
        r
        for r in records
        if is_measured(r)
        and all([str(x) for x in r[dim].values] == list(names) for dim, names in labels.items() if dim in r.coords)
    ]
    if measured:
        print_sensor_findings(check_sensors(make_plant(table), measured, load_sensors(sensors)))
