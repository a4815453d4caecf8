"""Commands that connect the virtual table to other programs: serve, link, export-fmu."""

from pathlib import Path
from typing import Annotated

import typer

from .app import app, progress_bar, stderr, tell
from .live_view import Amplify, Change, NoOpen, watched
from .options import (
    Axes,
    ControllerName,
    Json,
    Locked,
    MachineName,
    Motion,
    Out,
    Override,
    Scale,
    Set,
    SpecimenAt,
    SpecimenName,
    Valves,
    find_controller,
    find_table,
    find_target,
    folder_for,
)

__all__ = ["export_fmu", "link", "serve"]


@app.command("export-fmu")
def export_fmu(
    out: Annotated[Path, typer.Option(help="File to write, ending in .fmu.")] = Path("lhpost6.fmu"),
    machine: MachineName = "lhpost6",
    override: Override = None,
    valves: Valves = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    json: Json = False,
) -> None:
    """Export the plant as an FMU (FMI 2.0, co-simulation) for Simulink, Modelica and other tools."""
    from ..interfaces.fmi import export_fmu as write_fmu

    write_fmu(find_table(machine, override, valves, specimen, specimen_at, locked), out)
    tell(json, dict, lambda: None, [out])


@app.command()
def serve(
    mode: Annotated[str, typer.Option(help="lock-step, real-time, or free (as fast as possible).")] = "lock-step",
    host: Annotated[str, typer.Option(help="Address to listen on; default: this computer only.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="UDP port; 0: any free one.")] = 46946,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="Duration [s]; default: until Ctrl-C.")] = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    valves: Valves = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    live: Annotated[bool, typer.Option("--live", help="Show the table in a browser as it moves.")] = False,
    amplify: Amplify = 1.0,
    force_change: Change = False,
    no_open: NoOpen = False,
    json: Json = False,
) -> None:
    """Serve the virtual table over UDP, to be driven by a controller in another process or on another computer."""
    from ..interfaces.link import ServedPlant, find_mode, open_socket
    from ..interfaces.link import serve as serve_link
    from ..interfaces.link.link_summary import link_entries, print_link
    from ..mechanics.equilibrium import find_equilibrium
    from ..mechanics.plant import make_plant

    chosen = find_mode(mode)
    table = find_table(machine, override, valves, specimen, specimen_at, locked)
    with open_socket(host, port) as sock:
        plant = make_plant(table)
        served = ServedPlant(plant, find_equilibrium(plant), chosen)
        address, at = sock.getsockname()
        typer.echo(f"{table.name} listens at {address}:{at}, {mode}; Ctrl-C ends", err=json)
        title = f"{table.name} at {address}:{at}"
        with watched(
            live, table, title, amplify=amplify, change=force_change, open_it=not no_open, err=json, apart=True
        ) as served.watcher:
            timing = serve_link(sock, served, seconds=seconds)
    times = {"lateness of samples": timing.lateness, "work per sample": timing.work}
    times |= {"answer of the client": served.answer_time}
    title, counts = f"{table.name}, {mode}", served.counts
    tell(json, lambda: link_entries(counts, times), lambda: print_link(title, counts, times))


@app.command()
def link(
    motion: Motion,
    host: Annotated[str, typer.Option(help="Host of `lhpost6 serve`.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="UDP port of `lhpost6 serve`.")] = 46946,
    scale: Scale = 1.0,
    axes: Axes = None,
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    controller: ControllerName = None,
    valves: Valves = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    set_: Set = None,
    json: Json = False,
) -> None:
    """Run the virtual 469D, or your own controller, against a table behind `lhpost6 serve`; writes record.nc."""
    from ..control import ControllerSettings, make_controller
    from ..data.records import save_record
    from ..interfaces.link import LinkClient, record_of_link_run, run_over_link
    from ..interfaces.link.link_summary import link_entries, print_link
    from ..mechanics.equilibrium import find_equilibrium
    from ..mechanics.plant import make_plant
    from ..simulation.rehearse import target_within_limits
    from ..simulation.simulate import ClosedLoop, PluggedLoop

    table = find_table(machine, override, valves, specimen, specimen_at, locked)
    target = find_target(motion, set_, table, scale=scale, axes=axes)
    chosen = find_controller(controller, table)
    moved = target.reference.motion
    name = moved.replace("/", "_") + "_link"
    folder = folder_for(out, name)
    plant = make_plant(table)
    target_within_limits(plant, target)
    rest = find_equilibrium(plant)
    wanted = (target.displacement, target.velocity, target.acceleration)
    loop: ClosedLoop | PluggedLoop
    if isinstance(chosen, ControllerSettings):
        virtual = make_controller(plant, rest, chosen)
        loop = ClosedLoop(virtual, virtual.drive_for(*wanted), rest)
    else:
        loop = PluggedLoop(chosen, *wanted, rest)
    with LinkClient(host, port) as client, progress_bar(f"{name} at {host}:{port}") as progress:
        done = run_over_link(client, plant, loop, progress=progress)
        counts = dict(client.close())
    counts |= {"resent": client.resent, "sensors_lost": client.sensors_lost, "ignored": client.ignored}
    counts["unanswered"] = int((~done.answered).sum())
    attrs = {"test": name, "title": f"{moved} at scale {scale:g} over the link", "link_mode": client.mode.label}
    save_record(record_of_link_run(done, plant, {**attrs, **counts}), folder / "record.nc")
    times = {"command to sensors": client.round_trip}
    title = f"{name}, {client.mode.label}"
    tell(
        json,
        lambda: {**link_entries(counts, times), "tripped": done.tripped},
        lambda: print_link(title, counts, times),
        [folder / "record.nc"],
    )
    if done.tripped:
        stderr().print("the plant tripped: a leg left its stroke, or the run diverged; the server says which")
        raise typer.Exit(1)
