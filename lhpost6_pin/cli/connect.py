"""Commands that connect the virtual table to other programs: serve, serve-specimen, link, export-fmu."""

import logging
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import ParameterError
from .app import command, print_result, progress_bar, repeating_command, stderr
from .completion import completing, effect_names
from .live_view import LiveOptions, watched
from .motion_options import MotionOptions
from .options import (
    Cancel,
    ControllerName,
    ExchangeOptions,
    Json,
    Out,
    SpecimenOptions,
    Valves,
    find_controller,
)
from .results_folder import RUN_FILES, folder_for

log = logging.getLogger(__name__)

__all__ = ["export_fmu", "link", "serve", "serve_specimen"]


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Let SIGTERM end a server as Ctrl-C does: with its counts, and the files of a specimen closed."""

    def end(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@command("export-fmu")
def export_fmu(
    machine: SpecimenOptions,
    out: Annotated[Path, typer.Option(help="File to write, ending in .fmu.")] = Path("lhpost6.fmu"),
    valves: Valves = 0,
    json: Json = False,
) -> None:
    """Export the plant as an FMU (FMI 2.0, co-simulation) for Simulink, Modelica and other tools."""
    from ..interfaces.fmi import export_fmu as write_fmu

    table = machine.load(valves)
    if out.exists():
        log.warning("%s: an earlier FMU will be replaced; --out names another file", out)
    write_fmu(table, out)
    print_result(json, dict, lambda: None, [out])


@command()
def serve(
    machine: SpecimenOptions,
    view: LiveOptions,
    exchange: ExchangeOptions,
    mode: Annotated[
        str, typer.Option(help="lock-step (waits for each command), real-time, or free (as fast as possible).")
    ] = "lock-step",
    host: Annotated[str, typer.Option(help="Address to listen on; default: this computer only.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="UDP port; 0: any free one.")] = 46946,
    seconds: Annotated[float | None, typer.Option(min=0.0, help=r"Duration \[s]; default: until ended.")] = None,
    parked: Annotated[bool, typer.Option("--parked", help="Start with the platen parked, not raised.")] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="Effect of the library that clients may switch on, one at a time, such as entrained_air@H1; may be "
            "repeated.",
            autocompletion=completing(effect_names),
        ),
    ] = None,
    valves: Valves = 0,
    json: Json = False,
) -> None:
    """Serve the virtual table over UDP, to be driven by a controller in another process or on another computer."""
    from ..interfaces.link import ServedPlant, find_mode, make_faults, open_socket
    from ..interfaces.link import serve as serve_link
    from ..interfaces.link.link_summary import link_entries, print_link
    from ..mechanics.equilibrium import find_equilibrium, parked_pose
    from ..mechanics.plant import make_plant

    chosen = find_mode(mode)
    table = machine.load(valves)
    with open_socket(host, port) as sock:
        plant = make_plant(table)
        rest = find_equilibrium(plant, parked_pose(table) if parked else None)
        served = ServedPlant(plant, rest, chosen, exchange.coupling(table), faults=make_faults(table, fault or ()))
        address, at = sock.getsockname()
        title = f"{table.name} at {address}:{at}"
        typer.echo(f"{table.name} listens at {address}:{at}, {mode}; Ctrl-C ends", err=json)
        with _terminated_as_interrupted(), watched(view, table, title, err=json, apart=True) as served.watcher:
            timing = serve_link(sock, served, seconds=seconds)
    times = {"lateness of samples": timing.lateness, "work per sample": timing.work}
    times |= {"answer of the client": served.answer_time}
    title, counts = f"{table.name}, {mode}", served.counts
    print_result(json, lambda: link_entries(counts, times), lambda: print_link(title, counts, times))


@command("serve-specimen")
def serve_specimen(
    specimen: Annotated[str, typer.Argument(help="FILE.py:NAME, a class or an OpenSees model.")],
    host: Annotated[str, typer.Option(help="Address to listen on; default: this computer only.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="UDP port; 0: any free one.")] = 46947,
    seconds: Annotated[float | None, typer.Option(min=0.0, help=r"Duration \[s]; default: until ended.")] = None,
    json: Json = False,
) -> None:
    """Serve a specimen over UDP to a table in another process or on another computer (`--specimen udp:HOST:PORT`)."""
    from ..core.user_code import is_python
    from ..interfaces.link import ServedSpecimen, open_socket
    from ..interfaces.link import serve_specimen as serve_it
    from ..machine.user_specimen import load_user_specimen
    from ..mechanics.coupled_maker import made_specimen

    if not is_python(specimen):
        raise ParameterError(f"{specimen}: is no FILE.py:NAME; mount any other form at the table, with --specimen")
    described = load_user_specimen(specimen)
    with open_socket(host, port) as sock:
        served = ServedSpecimen(made_specimen(described))
        address, at = sock.getsockname()
        typer.echo(f"{described.name} listens at {address}:{at}: --specimen udp:{address}:{at}; Ctrl-C ends", err=json)
        with _terminated_as_interrupted():
            serve_it(sock, served, seconds=seconds)
    counts = {"rests": served.rests, "steps": served.steps}
    print_result(json, lambda: counts, lambda: typer.echo(f"{served.rests} starts, {served.steps} steps"))


@command()
def link(
    motion: MotionOptions,
    machine: SpecimenOptions,
    host: Annotated[str, typer.Option(help="Host of `lhpost6 serve`.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="UDP port of `lhpost6 serve`.")] = 46946,
    out: Out = None,
    controller: ControllerName = None,
    cancel: Cancel = None,
    valves: Valves = 0,
    json: Json = False,
) -> None:
    """Run the virtual 469D, or your own controller, against `lhpost6 serve`; writes record.nc and report.html."""
    from ..data.records import save_record
    from ..interfaces.link import LinkClient, record_of_link_run, run_over_link
    from ..interfaces.link.link_summary import link_entries, print_link
    from ..mechanics.equilibrium import find_equilibrium
    from ..mechanics.plant import make_plant
    from ..mechanics.pose import PlatenMotion
    from ..mechanics.specimen_joints import specimen_doubts
    from ..show.results import report_entries
    from ..show.run_results import write_test_report
    from ..show.tables import print_summary
    from ..simulation.rehearse import loop_for, test_facts
    from ..tuning.cancel import cancelling

    table = machine.load(valves)
    chosen = find_controller(controller, table)
    target = motion.target(table)
    moved = target.reference.motion
    name = moved.replace("/", "_") + "_link"
    folder = folder_for(out, name, *RUN_FILES, inputs=motion.files)
    plant = make_plant(table)
    loop = loop_for(plant, find_equilibrium(plant), chosen, target)
    loop = loop if cancel is None else cancelling(loop, target, cancel)
    with LinkClient(host, port) as client, progress_bar(f"{name} at {host}:{port}") as progress:
        done = run_over_link(client, plant, loop, progress=progress)
        counts = dict(client.close())
    done = replace(done, holds=counts.get("holds", 0))
    counts |= {"resent": client.resent, "sensors_lost": client.sensors_lost, "ignored": client.ignored}
    counts["unanswered"] = int((~done.answered).sum())
    attrs = {"test": name, "title": f"{target.reference.title} over the link", "link_mode": client.mode.label}
    wanted = PlatenMotion(target.displacement, target.velocity, target.acceleration)
    record = record_of_link_run(done, plant, {**attrs, **test_facts(chosen, target), **counts}, wanted)
    files = [folder / file for file in RUN_FILES]
    save_record(record, files[0], single=True)
    notes = [*filter(None, [done.trouble]), *specimen_doubts(plant)]
    if counts["unanswered"]:
        notes.append(f"{counts['unanswered']} of {len(done.answered)} samples were not answered in time")
    summary = write_test_report(plant, record, files[1], notes, command=repeating_command())
    times = {"command to sensors": client.round_trip}

    def show() -> None:
        print_link(f"{name}, {client.mode.label}", counts, times)
        print_summary(summary)

    outcome = {"tripped": done.tripped, "trouble": done.trouble}
    print_result(json, lambda: {**link_entries(counts, times), **outcome, **report_entries(summary)}, show, files)
    if done.trouble:
        stderr().print(f"the run {done.trouble}", markup=False)
        raise typer.Exit(1)
