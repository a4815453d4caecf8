"""Commands that run the virtual table: run, replay, open-loop."""

import logging
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import RecordError, SimulationError
from .app import app, progress_bar, tell
from .live_view import Amplify, Change, Live, NoOpen, watched
from .options import (
    Axes,
    Beyond,
    ControllerName,
    EngineName,
    HighPass,
    Json,
    Locked,
    LowPass,
    MachineName,
    Motion,
    Out,
    Override,
    Rate,
    Scale,
    Scheme,
    Set,
    SettingsName,
    SpecimenAt,
    SpecimenName,
    Valves,
    find_controller,
    find_settings,
    find_table,
    find_target,
    folder_for,
    refuse_stepping,
)

if TYPE_CHECKING:
    import xarray as xr

    from ..machine.machine import Machine
    from ..simulation.simulate import Run

log = logging.getLogger(__name__)

__all__ = ["open_loop", "repeating_command", "replay", "run"]


@app.command()
def run(
    motion: Motion,
    scale: Scale = 1.0,
    axes: Axes = None,
    scheme: Scheme = "semi_implicit",
    rate: Rate = 8192,
    engine: EngineName = "pinocchio",
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    controller: ControllerName = None,
    aic: Annotated[
        Path | None, typer.Option(help="Condition the drive with this inverse (inverse.nc of `lhpost6 iterate`).")
    ] = None,
    valves: Valves = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    high_pass: HighPass = None,
    low_pass: LowPass = None,
    set_: Set = None,
    beyond: Beyond = False,
    record_rate: Annotated[int, typer.Option(help="Samples per second of the record, a divisor of 2048.")] = 2048,
    live: Live = False,
    amplify: Amplify = 1.0,
    force_change: Change = False,
    no_open: NoOpen = False,
    json: Json = False,
) -> None:
    """Run a motion in closed loop on the virtual table; writes record.nc and report.html."""
    from ..control import ControllerSettings
    from ..control.inverse import load_inverse
    from ..core.names import SAMPLE_RATE
    from ..mechanics.plant import make_plant
    from ..simulation.rehearse import rehearse, target_within_limits
    from ..tuning.drives import check_circumstances

    if record_rate < 1 or SAMPLE_RATE % record_rate:
        raise SimulationError(f"--record-rate {record_rate} does not divide {SAMPLE_RATE}")
    table = find_table(machine, override, valves, specimen, specimen_at, locked)
    target = find_target(motion, set_, table, scale=scale, axes=axes, high_pass=high_pass, low_pass=low_pass)
    chosen = find_controller(controller, table)
    refuse_stepping(table, scheme, rate, engine, chosen)
    inverse = load_inverse(aic) if aic else None
    if inverse is not None:
        if not isinstance(chosen, ControllerSettings):
            raise SimulationError(f"--aic is for the 469D's drive, which --controller {controller} does without")
        check_circumstances(str(aic), inverse.made_with, table, chosen.name)
    name = target.reference.motion.replace("/", "_")
    folder = folder_for(out, name)
    if not beyond:
        target_within_limits(make_plant(table), target)
    title = f"{name} at scale {scale:g} on {table.name}"
    with (
        watched(live, table, title, amplify=amplify, change=force_change, open_it=not no_open, err=json) as watch,
        progress_bar(f"{name} on {table.name}") as progress,
    ):
        run_, record = rehearse(
            table,
            target,
            chosen,
            attrs={"test": name, "title": title},
            inverse=inverse,
            scheme=scheme,
            steps_per_second=rate,
            engine=engine,
            record_every=SAMPLE_RATE // record_rate,
            beyond_limits=True,
            progress=progress,
            watch=watch,
        )
    _save(table, run_, record, folder, json)


@app.command()
def replay(
    drive: Annotated[Path, typer.Argument(help="Drive file written by `lhpost6 iterate`.")],
    scheme: Scheme = "semi_implicit",
    rate: Rate = 8192,
    engine: EngineName = "pinocchio",
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    controller: SettingsName = None,
    valves: Valves = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    json: Json = False,
) -> None:
    """Replay a drive file in closed loop, compared with its target motion; writes record.nc and report.html."""
    from ..simulation.rehearse import rehearse
    from ..tuning.drives import check_circumstances, load_drive

    table = find_table(machine, override, valves, specimen, specimen_at, locked)
    settings = find_settings(controller, table)
    refuse_stepping(table, scheme, rate, engine)
    found = load_drive(drive)
    check_circumstances(str(drive), found.attrs, table, settings.name)
    if found.mode != settings.mode:
        raise SimulationError(
            f"{drive} is for reference generators in {found.mode} mode; {settings.name} has {settings.mode} mode"
        )
    name = f"{found.target.reference.motion.replace('/', '_')}_replay"
    folder = folder_for(out, name)
    with progress_bar(f"{name} on {table.name}") as progress:
        run_, record = rehearse(
            table,
            found.target,
            settings,
            attrs={"test": name, "title": f"{name} on {table.name}", "drive": str(drive)},
            drive=found.values,
            scheme=scheme,
            steps_per_second=rate,
            engine=engine,
            beyond_limits=True,
            progress=progress,
        )
    _save(table, run_, record, folder, json)


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
    json: Json = False,
) -> None:
    """Drive the plant in open loop with recorded spool positions, from the recorded pressures; writes record.nc."""
    from ..data.records import load_record
    from ..simulation.rehearse import replay as replay_spools

    table = find_table(machine, override, 0, specimen, specimen_at, locked)
    refuse_stepping(table, scheme, rate, engine)
    measured = load_record(record, table.labels)
    test = record.stem if record.stem != "record" else str(measured.attrs.get("test", "record"))
    name = f"{test}_open_loop"
    if ((out or Path("out") / name) / "record.nc").resolve() == record.resolve():
        raise RecordError(f"{record} would be replaced by its own replay; choose another folder with --out")
    folder = folder_for(out, name)
    with progress_bar(f"{name} on {table.name}") as progress:
        run_, simulated = replay_spools(
            table,
            measured,
            attrs={"test": name, "title": f"{test}, open loop", "source": f"spools of {record}"},
            scheme=scheme,
            steps_per_second=rate,
            engine=engine,
            progress=progress,
        )
    _save(table, run_, simulated, folder, json, against=measured)


def repeating_command() -> str:
    """Command line that repeats this run."""
    return shlex.join(["lhpost6", *sys.argv[1:]])


def _save(
    table: "Machine",
    run_: "Run",
    record: "xr.Dataset",
    folder: Path,
    as_json: bool,
    *,
    against: "xr.Dataset | None" = None,
) -> None:
    """Write the record and, unless it is compared `against` a measured test, the report; print a summary."""
    from ..data.records import save_record
    from ..mechanics.specimen_joints import joints_beyond, specimen_doubts
    from ..show.results import run_entries
    from ..show.tables import compare, machine_rows, print_comparison, print_run, report_limits

    save_record(record, folder / "record.nc")
    files, summary = [folder / "record.nc"], None
    beyond = joints_beyond(run_.plant, run_.time, run_.q)
    for word in beyond:
        log.warning("%s", word)
    if against is None:
        from ..show.report import write_run_report

        summary = write_run_report(
            record,
            folder / "report.html",
            limits=report_limits(run_.plant),
            notes=[*filter(None, [run_.trouble]), *specimen_doubts(run_.plant), *beyond],
            command=repeating_command(),
            machine_table=machine_rows(table),
        )
        files.append(folder / "report.html")
    compared = [] if against is None else compare(against, record)

    def show() -> None:
        if compared:
            print_comparison(compared)
        print_run(run_, summary)

    def entries() -> dict[str, Any]:
        return run_entries(run_, summary) | ({} if against is None else {"against_record": compared})

    tell(as_json, entries, show, files)
    if run_.trouble:
        raise typer.Exit(1)
