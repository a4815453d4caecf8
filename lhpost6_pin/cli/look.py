"""Commands that show a record, a machine and an installation: view, info, capacity, doctor."""

import logging
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import ParameterError, RecordError
from .app import command, print_result, repeating_command
from .live_view import ViewOptions, show_address
from .options import Json, MachineOptions, SpecimenOptions, Valves, folder_for

if TYPE_CHECKING:
    import xarray as xr

    from ..machine.machine import Machine
    from ..show.viewer import Look, Overlay

log = logging.getLogger(__name__)

__all__ = ["capacity", "doctor", "info", "view"]


@command()
def view(
    record: Annotated[Path, typer.Argument(help="Test record (netCDF).")],
    machine: SpecimenOptions,
    options: ViewOptions,
    others: Annotated[list[Path] | None, typer.Argument(help="Further records, overlaid as outlines.")] = None,
    export: Annotated[
        Path | None, typer.Option(help="Write a self-contained HTML file instead of opening a browser.")
    ] = None,
    gap: Annotated[float, typer.Option(help="Factor that enlarges the deviation of the outlines.")] = 1.0,
    fps: Annotated[float, typer.Option(min=1.0, max=240.0, help="Frames per second.")] = 30.0,
    json: Json = False,
) -> None:
    """Animate a test in a browser or in one HTML file: platen, actuators, struts and force arrows.

    Without --specimen, the one that the record states is mounted, where its file is there.
    """
    from ..data.records import load_record
    from ..show.viewer import Look, live_animation, show_record

    if export is not None and export.suffix.lower() not in (".html", ".htm"):
        raise ParameterError(f"--export {export}: a page of HTML is written; name it {export.stem or 'view'}.html")
    test, over = load_record(record), [load_record(path) for path in others or []]
    table = _mounted(machine, test, record)
    look = Look(fps, options.amplify, gap, options.force_change)
    if export is not None:
        show_record(table, test, over, look).save(export)
        overlay = _overlay(test, over, [record, *(others or [])], look)
        size = export.stat().st_size / 1e6
        print_result(json, overlay.entries, lambda: typer.echo(f"{size:.1f} MB, which any browser plays"), [export])
        return
    with live_animation(table, test, over, look) as window:
        _overlay(test, over, [record, *(others or [])], look)
        show_address(window.url, f"{record} on this computer only; Ctrl-C ends", not options.no_open)
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            typer.echo("ended")


def _overlay(test: "xr.Dataset", over: "list[xr.Dataset]", paths: list[Path], look: "Look") -> "Overlay":
    """What records shown together leave out, and which are of another test; a warning of each."""
    from ..show.viewer import compare_overlaid

    found = compare_overlaid(test, over, [str(path) for path in paths], 1.0 / look.rate)
    for sentence in found.sentences:
        log.warning("%s", sentence)
    return found


def _mounted(machine: SpecimenOptions, test: "xr.Dataset", record: Path) -> "Machine":
    """The table with the chosen specimen or the one that a record states; a warning if that cannot be drawn."""
    bare = machine.load_bare()
    try:
        table = machine.onto_for(bare, [test])
    except RecordError as error:
        log.warning("%s; it is not drawn", error)
        return bare
    if table.specimen is None and (carried := str(test.attrs.get("specimen", "none"))) != "none":
        log.warning(
            "%s was made with specimen %r, and its place is not stated: it is not drawn; mount it with --specimen",
            record, carried,
        )  # fmt: skip
    return table


@command()
def info(machine: MachineOptions, json: Json = False) -> None:
    """Print a machine: every number with unit, uncertainty and source; assumed values are marked.

    With --bodies full also the moving parts, and where they differ from their lump.
    """
    from ..show.moving_tables import moving_parts_entries, print_moving_parts
    from ..show.results import machine_entries
    from ..show.tables import print_machine

    table = machine.load()
    bodies = table.bodies == "full"

    def show() -> None:
        print_machine(table)
        if bodies:
            print_moving_parts(table)

    print_result(json, lambda: {**machine_entries(table), **(moving_parts_entries(table) if bodies else {})}, show)


@command()
def capacity(
    machine: SpecimenOptions,
    valves: Valves = 0,
    out: Annotated[Path | None, typer.Option(help="Directory of report.html with the performance curves.")] = None,
    json: Json = False,
) -> None:
    """Print what the table gives with what is mounted, beside Table 2.2, which limits govern, and its modes."""
    from ..show.capacity_tables import capacity_tables, judged_by, machine_capacity
    from ..show.report.capacity_report import write_capacity_report
    from ..show.results import capacity_entries
    from ..show.tables import print_modes
    from ..show.terminal import print_blocks

    found, files = machine_capacity(machine.load(), valves), []
    table = found.machine
    tables = capacity_tables(found)
    if out is not None:
        load = table.specimen.name if table.specimen else "bare"
        path = folder_for(out, "capacity", "report.html") / "report.html"
        title, remark = f"{table.name}, {load}", judged_by(found)
        files.append(write_capacity_report(path, title, found.loads, tables[:-1], remark, command=repeating_command()))

    def show() -> None:
        print_blocks(*tables, judged_by(found))
        print_modes(table)

    print_result(json, lambda: capacity_entries(found), show, files)


@command()
def doctor(json: Json = False) -> None:
    """Print versions, the cache of compiled code and optional dependencies."""
    from .doctor import examine, print_doctor

    found = examine()
    print_result(json, lambda: found, lambda: print_doctor(found))
