"""The command line `lhpost6`.

Exit codes: 0 done, 1 a run stopped on the way or a check found errors, 2 the input cannot be used or a file cannot be
read or written, 130 interrupted.
"""

import logging
import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .errors import LhpostError, MotionError, ParameterError, RecordError, SimulationError
from .files import refuse_folder

if TYPE_CHECKING:
    import xarray as xr
    from rich.console import Console

    from .machine import Machine
    from .motions import GroundMotion
    from .simulate import Run

__all__ = ["app", "main"]

app = typer.Typer(
    help="The UC San Diego LHPOST6 shake table, modelled from first principles on Pinocchio.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)

MachineName = Annotated[str, typer.Option("--machine", help="Shipped machine name, or a TOML file.")]
Override = Annotated[Path | None, typer.Option("--override", help="TOML file with parameters to replace.")]
Scheme = Annotated[str, typer.Option(help="Integration scheme: semi_implicit, euler or rk4.")]
Rate = Annotated[int, typer.Option(help="Model steps per second, a multiple of 2048.")]
EngineName = Annotated[str, typer.Option("--engine", help="pinocchio (per step) or fused (one compiled loop).")]
SpecimenName = Annotated[
    str | None, typer.Option("--specimen", help="Specimen bolted to the platen: shipped name, or a URDF file.")
]
SpecimenAt = Annotated[
    str | None,
    typer.Option("--specimen-at", help="Its root on the platen's top: x,y,z [m], or with r,p,y [rad]."),
]
Locked = Annotated[bool, typer.Option("--locked", help="Lock the specimen's joints: one rigid body.")]
Out = Annotated[Path | None, typer.Option(help="Folder for the results.")]


def main() -> None:
    """Entry point: errors that a user can act on are printed without a traceback."""
    from rich.logging import RichHandler

    handler = RichHandler(console=_stderr(), show_path=False, show_time=False)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[handler])
    try:
        app()
    except LhpostError as error:
        _fail(str(error))
    except OSError as error:  # disk full, no permission, a file where a folder should be
        where = f"cannot read or write {error.filename}" if error.filename else "cannot read or write a file"
        _fail(f"{where}: {os.strerror(error.errno) if error.errno else error}")
    except SystemExit as end:
        if end.code == _INTERRUPTED:
            _stderr().print("interrupted; nothing half-written is left behind")
        raise


_INTERRUPTED = 130
"""Exit code that typer gives to Ctrl-C."""


def _fail(message: str) -> None:
    _stderr().print("[bold red]error:[/] ", end="")
    _stderr().print(message, markup=False, highlight=False)
    sys.exit(2)


@cache
def _stderr() -> "Console":
    """One console for errors, warnings and progress, so that they do not overwrite each other."""
    from rich.console import Console

    return Console(stderr=True, soft_wrap=True)


@app.command()
def doctor() -> None:
    """Say what is installed, whether compiled code is kept, and which optional parts are there."""
    from .doctor import print_doctor

    print_doctor()


@app.command()
def info(machine: MachineName = "lhpost6", override: Override = None) -> None:
    """Print a machine as a table: every number with unit and source, assumed values marked."""
    from .tables import print_machine

    print_machine(_machine(machine, override))


@app.command()
def capacity(machine: MachineName = "lhpost6", override: Override = None) -> None:
    """Compare what the model can give with Table 2.2, and print the oil-column modes."""
    from .tables import print_capacity, print_modes

    table = _machine(machine, override)
    if "table_2_2.force_actuators" in table.parameters:
        print_capacity(table)
    print_modes(table)


@app.command()
def motions(name: Annotated[str | None, typer.Argument(help="One of them, to see its options.")] = None) -> None:
    """List the ground motions and tests known by name."""
    from .tables import print_motions

    print_motions(name)


@app.command()
def check(
    file: Annotated[Path, typer.Argument(help="Record to look into.")],
    machine: MachineName = "lhpost6",
    override: Override = None,
) -> None:
    """Say what is in a record and what is wrong with it; forces are held against pressures times areas."""
    from .check import check_record
    from .tables import print_findings

    areas = {a.name: (a.area_a, a.area_b or 0.0) for a in _machine(machine, override).actuators}
    findings = check_record(file, areas)
    print_findings(str(file), findings)
    if any(f.severity == "error" for f in findings):
        raise typer.Exit(1)


@app.command()
def run(
    motion: Annotated[list[str], typer.Argument(help="Name (see `lhpost6 motions`), file(s), or name and file(s).")],
    scale: Annotated[float, typer.Option(help="Factor on the motion.")] = 1.0,
    axes: Annotated[str | None, typer.Option(help="Axes to use, such as xyz, x, x=y.")] = None,
    scheme: Scheme = "semi_implicit",
    rate: Rate = 8192,
    engine: EngineName = "pinocchio",
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    controller: Annotated[
        str | None, typer.Option(help="Controller settings: name or TOML file; or your own, FILE.py:NAME.")
    ] = None,
    valves: Annotated[
        int, typer.Option(min=0, max=2, help="Open servovalves on each horizontal actuator; 0: as the machine says.")
    ] = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    high_pass: Annotated[float | None, typer.Option(help="High-pass corner of the motion [Hz].")] = None,
    low_pass: Annotated[float | None, typer.Option(help="Low-pass corner of the motion [Hz].")] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", help="Option of a generated motion, key=value.")] = None,
    beyond: Annotated[
        bool, typer.Option("--beyond-limits", help="Run a motion that is more than the table can give.")
    ] = False,
    record_rate: Annotated[int, typer.Option(help="Samples per second of the record, a divisor of 2048.")] = 2048,
) -> None:
    """Reproduce an earthquake on the virtual table; leaves record.nc and report.html."""
    from .control import load_controller
    from .control.plug import is_plugged, load_plugged
    from .motions import make_target
    from .plant import make_plant
    from .rehearse import rehearse, target_within_limits, with_valves
    from .simulate import SAMPLE_RATE

    if record_rate < 1 or SAMPLE_RATE % record_rate:
        raise SimulationError(f"--record-rate {record_rate} does not divide {SAMPLE_RATE}")
    table = _mount(with_valves(_machine(machine, override), valves), specimen, specimen_at, locked)
    ground = _motion(motion, set_ or [])
    target = make_target(
        ground,
        scale=scale,
        axes=axes or (None if table.motion == "free" else table.motion),
        high_pass=high_pass,
        low_pass=low_pass,
        rate=float(SAMPLE_RATE),
    )
    chosen = controller or table.controller
    if not chosen:
        raise ParameterError(f"{machine} names no controller; give one with --controller")
    settings = load_plugged(chosen) if is_plugged(chosen) else load_controller(chosen)
    name = ground.name.replace("/", "_")
    folder = out or Path("out") / name
    refuse_folder(folder)
    if not beyond:
        target_within_limits(make_plant(table), target)
    with _progress(f"{name} on {table.name}") as progress:
        run_, record = rehearse(
            table,
            target,
            settings,
            attrs={"test": name, "title": f"{name} x {scale:g} on {table.name}"},
            scheme=scheme,
            steps_per_second=rate,
            engine=engine,
            record_every=SAMPLE_RATE // record_rate,
            beyond_limits=True,
            progress=progress,
        )
    _save(table, run_, record, folder, report=True)


@app.command("open-loop")
def open_loop(
    record: Annotated[Path, typer.Argument(help="Record whose spool positions drive the plant.")],
    scheme: Scheme = "semi_implicit",
    rate: Rate = 8192,
    engine: EngineName = "pinocchio",
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
) -> None:
    """Drive the plant with a record's spools from its first sample's pressures; leaves record.nc."""
    from .records import load_record
    from .rehearse import replay
    from .tables import print_comparison

    table = _mount(_machine(machine, override), specimen, specimen_at, locked)
    measured = load_record(record, {"actuator": table.actuator_names})
    test = record.stem if record.stem != "record" else str(measured.attrs.get("test", "record"))
    name = f"{test}_open_loop"
    folder = out or Path("out") / name
    if (folder / "record.nc").resolve() == record.resolve():
        raise RecordError(f"{record} would be replaced by its own replay; choose another folder with --out")
    refuse_folder(folder)
    with _progress(f"{name} on {table.name}") as progress:
        run_, simulated = replay(
            table,
            measured,
            attrs={"test": name, "title": f"{test}, open loop", "source": f"spools of {record}"},
            scheme=scheme,
            steps_per_second=rate,
            engine=engine,
            progress=progress,
        )
    print_comparison(measured, simulated)
    _save(table, run_, simulated, folder, report=False)


@app.command("export-fmu")
def export_fmu(
    out: Annotated[Path, typer.Option(help="File to write, ending in .fmu.")] = Path("lhpost6.fmu"),
    machine: MachineName = "lhpost6",
    override: Override = None,
    valves: Annotated[
        int, typer.Option(min=0, max=2, help="Open servovalves on each horizontal actuator; 0: as the machine says.")
    ] = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
) -> None:
    """Export the plant as an FMU (FMI 2.0, co-simulation) for Simulink, Modelica and other tools."""
    from .fmi import export_fmu as write_fmu
    from .rehearse import with_valves

    write_fmu(_mount(with_valves(_machine(machine, override), valves), specimen, specimen_at, locked), out)
    typer.echo(f"wrote {out}")


@app.command()
def serve(
    mode: Annotated[str, typer.Option(help="lock-step, real-time, or free: as fast as the plant goes.")] = "lock-step",
    host: Annotated[str, typer.Option(help="Address to listen at; others than this computer only if given.")] = (
        "127.0.0.1"
    ),
    port: Annotated[int, typer.Option(min=0, max=65535, help="UDP port; 0: any free one.")] = 46946,
    seconds: Annotated[float | None, typer.Option(help="End after so long; without it Ctrl-C ends.")] = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    valves: Annotated[
        int, typer.Option(min=0, max=2, help="Open servovalves on each horizontal actuator; 0: as the machine says.")
    ] = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
) -> None:
    """Let a controller in another process or on another computer drive the virtual table over UDP."""
    from dataclasses import asdict

    from .equilibrium import find_equilibrium
    from .link import ServedPlant, find_mode, open_socket
    from .link import serve as serve_link
    from .link.summary import print_link
    from .plant import make_plant
    from .rehearse import with_valves

    chosen = find_mode(mode)
    table = _mount(with_valves(_machine(machine, override), valves), specimen, specimen_at, locked)
    with open_socket(host, port) as sock:
        plant = make_plant(table)
        served = ServedPlant(plant, find_equilibrium(plant), chosen)
        address, at = sock.getsockname()
        typer.echo(f"{table.name} listens at {address}:{at}, {mode}; Ctrl-C ends")
        timing = serve_link(sock, served, seconds=seconds)
    times = {"lateness of samples": timing.lateness, "work per sample": timing.work}
    print_link(f"{table.name}, {mode}", asdict(served.counts), {**times, "answer of the client": served.answer_time})


@app.command()
def link(
    motion: Annotated[list[str], typer.Argument(help="Name (see `lhpost6 motions`), file(s), or name and file(s).")],
    host: Annotated[str, typer.Option(help="Where `lhpost6 serve` listens.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="And its UDP port.")] = 46946,
    scale: Annotated[float, typer.Option(help="Factor on the motion.")] = 1.0,
    axes: Annotated[str | None, typer.Option(help="Axes to use, such as xyz, x, x=y.")] = None,
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    controller: Annotated[
        str | None, typer.Option(help="Controller settings: name or TOML file; or your own, FILE.py:NAME.")
    ] = None,
    valves: Annotated[
        int, typer.Option(min=0, max=2, help="Open servovalves on each horizontal actuator; 0: as the machine says.")
    ] = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    set_: Annotated[list[str] | None, typer.Option("--set", help="Option of a generated motion, key=value.")] = None,
) -> None:
    """Run the virtual 469D, or your own controller, here and the table behind `lhpost6 serve`; leaves record.nc."""
    from .control import load_controller, make_controller
    from .control.plug import is_plugged, load_plugged
    from .equilibrium import find_equilibrium
    from .link import LinkClient, record_of_link_run, run_over_link
    from .link.summary import print_link
    from .motions import make_target
    from .plant import make_plant
    from .records import save_record
    from .rehearse import target_within_limits, with_valves
    from .simulate import SAMPLE_RATE, ClosedLoop, PluggedLoop

    table = _mount(with_valves(_machine(machine, override), valves), specimen, specimen_at, locked)
    ground = _motion(motion, set_ or [])
    own_axes = None if table.motion == "free" else table.motion
    target = make_target(ground, scale=scale, axes=axes or own_axes, rate=float(SAMPLE_RATE))
    chosen = controller or table.controller
    if not chosen:
        raise ParameterError(f"{machine} names no controller; give one with --controller")
    name = ground.name.replace("/", "_") + "_link"
    folder = out or Path("out") / name
    refuse_folder(folder)
    plant = make_plant(table)
    target_within_limits(plant, target)
    rest = find_equilibrium(plant)
    wanted = (target.displacement, target.velocity, target.acceleration)
    loop: ClosedLoop | PluggedLoop
    if is_plugged(chosen):
        loop = PluggedLoop(load_plugged(chosen), *wanted, rest)
    else:
        virtual = make_controller(plant, rest, load_controller(chosen))
        loop = ClosedLoop(virtual, virtual.drive_for(*wanted), rest)
    with LinkClient(host, port) as client, _progress(f"{name} at {host}:{port}") as progress:
        done = run_over_link(client, plant, loop, progress=progress)
        counts = dict(client.close())
    counts |= {"resent": client.resent, "sensors_lost": client.sensors_lost, "ignored": client.ignored}
    counts["unanswered"] = int((~done.answered).sum())
    attrs = {"test": name, "title": f"{ground.name} x {scale:g} over the link", "link_mode": client.mode.label}
    save_record(record_of_link_run(done, plant, {**attrs, **counts}), folder / "record.nc")
    print_link(f"{name}, {client.mode.label}", counts, {"command to sensors": client.round_trip})
    typer.echo(f"wrote {folder / 'record.nc'}")
    if done.tripped:
        _stderr().print("the plant tripped: a leg left its stroke, or the run diverged; the server says which")
        raise typer.Exit(1)


def _machine(name: str, override: Path | None) -> "Machine":
    from .machine import load_machine

    return load_machine(name, override)


def _mount(table: "Machine", specimen: str | None, at: str | None, locked: bool) -> "Machine":
    """Machine with the specimen that the options name, if any."""
    if specimen is None:
        if locked or at:
            raise ParameterError("--locked and --specimen-at are about a specimen; name it with --specimen")
        return table
    try:
        place = [float(x) for x in at.split(",")] if at else [0.0] * 3
    except ValueError:
        place = []
    if len(place) not in (3, 6):
        raise ParameterError(f"--specimen-at {at}: write x,y,z in metres, or x,y,z,roll,pitch,yaw with radians")
    x, y, z, roll, pitch, yaw = (*place, 0.0, 0.0, 0.0)[:6]
    return table.with_specimen(specimen, (x, y, z), (roll, pitch, yaw), locked=locked)


def _motion(names: list[str], settings: list[str]) -> "GroundMotion":
    """Motion by name, from one file or three component files, or by name from such files."""
    from .motions import find_motion, load_motion

    options: dict[str, Any] = {}
    for item in settings:
        key, equals, value = item.partition("=")
        if not equals:
            raise MotionError(f"--set {item}: write key=value")
        options[key.strip()] = _number_or_text(value.strip())
    first, *files = names
    if not _is_file(first) and files and not any(map(_is_file, files)):
        raise MotionError(f"one motion at a time; got {', '.join(names)}, none of which is a file")
    try:
        return load_motion(names, **options) if _is_file(first) else find_motion(first, files, **options)
    except (AttributeError, TypeError, ValueError) as error:  # an option of the wrong kind
        raise MotionError(f"{' '.join(names)}: --set {' --set '.join(settings)}: {error}") from error


def _is_file(name: str) -> bool:
    return bool(Path(name).suffix) or Path(name).is_file()


def _number_or_text(text: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _save(table: "Machine", run_: "Run", record: "xr.Dataset", folder: Path, *, report: bool) -> None:
    from .records import save_record
    from .tables import machine_rows, print_saved, report_limits

    save_record(record, folder / "record.nc")
    summary = None
    if report:
        from .report import write_run_report

        notes = [run_.trouble] if run_.trouble else []
        summary = write_run_report(
            record,
            folder / "report.html",
            limits=report_limits(run_.plant),
            notes=notes,
            command=shlex.join(["lhpost6", *sys.argv[1:]]),
            machine_table=machine_rows(table),
        )
    print_saved(folder, run_, summary)
    if run_.trouble:
        raise typer.Exit(1)


@contextmanager
def _progress(title: str) -> Iterator[Callable[[float], None]]:
    """A progress bar with remaining time on stderr; yields what to call with the share done."""
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    name = TextColumn("{task.description}", markup=False)
    with Progress(
        name, BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn(), console=_stderr()
    ) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda share: bar.update(task, completed=share)
