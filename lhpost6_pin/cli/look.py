"""Commands to look at things: doctor, info, capacity, motions, check."""

from pathlib import Path
from typing import Annotated

import typer

from .app import app
from .options import MachineName, Override, find_machine

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
    file: Annotated[Path, typer.Argument(help="Record to look into.")],
    machine: MachineName = "lhpost6",
    override: Override = None,
) -> None:
    """Say what is in a record and what is wrong with it; forces are held against pressures times areas."""
    from ..check import check_record
    from ..tables import print_findings

    areas = {a.name: (a.area_a, a.area_b or 0.0) for a in find_machine(machine, override).actuators}
    findings = check_record(file, areas)
    print_findings(str(file), findings)
    if any(f.severity == "error" for f in findings):
        raise typer.Exit(1)
