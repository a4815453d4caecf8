"""The panel by which the table is driven by hand: panel."""

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import LinkError, ParameterError
from .app import command, print_result
from .completion import completing, effect_names
from .live_view import NoOpen, show_address
from .options import Json, SettingsName, SpecimenOptions, Valves, find_settings
from .results_folder import folder_for

__all__ = ["panel"]


@command()
def panel(
    machine: SpecimenOptions,
    out: Annotated[Path | None, typer.Option(help="Directory of recordings and journal; default: out/panel.")] = None,
    controller: SettingsName = None,
    sensors: Annotated[
        str | None, typer.Option(help="Sensors whose noise recordings have, such as lhpost6; default: none.")
    ] = None,
    valves: Valves = 0,
    server: Annotated[
        str | None, typer.Option(help="HOST:PORT of `lhpost6 serve --mode real-time`; default: a plant of its own.")
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen on; default: this computer only.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0: any free one.")] = 0,
    trainer: Annotated[
        bool, typer.Option("--trainer", help="Offer faults, to be switched on while the table is driven.")
    ] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="A fault to offer, as entrained_air@H1; repeat for more.", autocompletion=completing(effect_names)
        ),
    ] = None,
    pace: Annotated[
        float, typer.Option(help="Speed of the table's clock; below 1 for a computer that is too slow for real time.")
    ] = 1.0,
    no_open: NoOpen = False,
    json: Json = False,
) -> None:
    """Drive the table by hand from a page in a browser: start-up, setpoints, waves, motions, interlocks, recordings.

    With another --host the page is open to others, who need the token in the address that is printed.
    """
    import tempfile
    from concurrent.futures import ThreadPoolExecutor

    from ..data.sensors import load_sensors
    from ..interfaces.link import make_faults
    from ..machine.user_specimen import UserSpecimen
    from ..panel.session import Options, Session
    from ..panel.web import PanelServer
    from ..panel.worker import Setup, panel_numbers

    table = machine.load(valves)
    if isinstance(table.specimen, UserSpecimen):
        raise ParameterError(
            f"--specimen {table.specimen.source}: the panel's own plant takes no program; start it with "
            "`lhpost6 serve --mode real-time` and this specimen, and give its address with --server"
        )
    settings = find_settings(controller, table)
    there, known = _address(server), load_sensors(sensors) if sensors else None
    if not 0.0 < pace <= 1.0:
        raise ParameterError(f"--pace {pace:g}: give a number above 0 and up to 1, which is real time")
    offered = fault or (str(panel_numbers().words["trainer.faults"]).split(", ") if trainer else [])
    make_faults(table, offered)  # a wrong name is refused here
    folder = folder_for(out, "panel")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(2) as work:
        facts = {"controller": settings.name}
        setup = Setup(table, settings, Path(scratch) / "ring", pace)
        session = Session(setup, folder, work, facts, Options(there, offered, pace, known))
        try:
            try:
                page = PanelServer(session, host, port, trainer=trainer or bool(fault))
            except OSError as error:
                raise LinkError(f"cannot listen on {host}:{port}: {error}; choose another --host or --port") from error
            show_address(page.url, f"the panel of {table.name}; Ctrl-C ends", not no_open, err=json)
            page.serve()
        finally:
            session.close()
    files = [Path(path) for path in session.recordings]
    time = session.time
    print_result(json, lambda: {"samples": time.answered, "late": time.missed + time.late}, lambda: None, files)


def _address(text: str | None) -> tuple[str, int] | None:
    if text is None:
        return None
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isdigit() and 0 < int(port) < 65536):
        raise ParameterError(f"--server {text}: write HOST:PORT, such as 127.0.0.1:46946")
    return host, int(port)
