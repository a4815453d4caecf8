"""The command that animates a record: view."""

from pathlib import Path
from typing import Annotated

import typer

from .app import app, tell
from .live_view import Amplify, Change, NoOpen, show_address
from .options import Json, Locked, MachineName, Override, SpecimenAt, SpecimenName, find_table

__all__ = ["view"]


@app.command()
def view(
    record: Annotated[Path, typer.Argument(help="Test record (netCDF).")],
    others: Annotated[list[Path] | None, typer.Argument(help="Further records, overlaid as outlines.")] = None,
    export: Annotated[
        Path | None, typer.Option(help="Write a self-contained HTML file instead of opening a browser.")
    ] = None,
    amplify: Amplify = 1.0,
    gap: Annotated[float, typer.Option(help="Factor that enlarges the deviation of the outlines.")] = 1.0,
    change: Change = False,
    fps: Annotated[float, typer.Option(min=1.0, max=240.0, help="Frames per second.")] = 30.0,
    no_open: NoOpen = False,
    machine: MachineName = "lhpost6",
    override: Override = None,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    json: Json = False,
) -> None:
    """Animate a test in a browser or in one HTML file: platen, actuators, struts and force arrows."""
    import threading

    from ..data.records import load_record
    from ..show.viewer import Look, live_animation, show_record

    table = find_table(machine, override, 0, specimen, specimen_at, locked)
    test, over = load_record(record), [load_record(path) for path in others or []]
    look = Look(fps, amplify, gap, change)
    if export is not None:
        show_record(table, test, over, look).save(export)
        size = export.stat().st_size / 1e6
        tell(json, dict, lambda: typer.echo(f"{size:.1f} MB, which any browser plays"), [export])
        return
    with live_animation(table, test, over, look) as window:
        show_address(window.url, f"{record} on this computer only; Ctrl-C ends", not no_open)
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            typer.echo("ended")
