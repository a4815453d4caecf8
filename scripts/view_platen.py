"""Look at a record: platen, actuators and struts follow it in a browser, or in one HTML file that plays off line.

python scripts/view_platen.py record.nc
python scripts/view_platen.py record.nc --export record.html --amplify 10
"""

import threading
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from lhpost6_pin.errors import LhpostError
from lhpost6_pin.machine import load_machine
from lhpost6_pin.records import load_record
from lhpost6_pin.viewer import live_animation, save_animation


def view(
    record: Annotated[Path, typer.Argument(help="test record (netCDF)")],
    export: Annotated[Path | None, typer.Option(help="write this HTML file instead of opening a browser")] = None,
    amplify: Annotated[float, typer.Option(help="draw the motion this many times as large")] = 1.0,
    machine: Annotated[str, typer.Option(help="machine file, by shipped name or path")] = "lhpost6",
    fps: Annotated[float, typer.Option(min=1.0, max=240.0, help="frames a second")] = 30.0,
    no_open: Annotated[bool, typer.Option("--no-open", help="print the address, open no browser")] = False,
) -> None:
    """Show RECORD in three dimensions."""
    try:
        table, test = load_machine(machine), load_record(record)
        if export is not None:
            save_animation(table, test, export, rate=fps, amplify=amplify)
            typer.echo(f"{export}: {export.stat().st_size / 1e6:.1f} MB, opens in any browser")
            return
        with live_animation(table, test, rate=fps, amplify=amplify) as window:
            typer.echo(f"{window.url} shows {record} on this computer only; Ctrl-C ends it")
            if not no_open:
                webbrowser.open(window.url)
            threading.Event().wait()
    except KeyboardInterrupt:
        typer.echo("ended")
    except (LhpostError, OSError) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(1) from None


def main() -> None:
    """Run the command."""
    typer.run(view)


if __name__ == "__main__":
    main()
