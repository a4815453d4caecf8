"""Write the URDF of a machine: python scripts/make_urdf.py [MACHINE] [--out FILE]."""

from pathlib import Path
from typing import Annotated

import typer

from lhpost6_pin.core.errors import LhpostError
from lhpost6_pin.core.files import models_folder, write_whole
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.show.urdf import urdf_text


def make(
    machine: Annotated[str, typer.Argument(help="machine file, by shipped name or path")] = "lhpost6",
    out: Annotated[Path | None, typer.Option(help="file to write; without it beside the shipped machines")] = None,
) -> None:
    """Write bodies and joints of MACHINE as a URDF."""
    target = out or models_folder() / f"{Path(machine).stem}.urdf"
    try:
        text = urdf_text(load_machine(machine))
        with write_whole(target) as path:
            path.write_text(text, encoding="utf-8", newline="\n")
    except (LhpostError, OSError) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(1) from None
    typer.echo(str(target))


def main() -> None:
    """Run the command."""
    typer.run(make)


if __name__ == "__main__":
    main()
