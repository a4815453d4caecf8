"""Commands of the virtual 469D: tune, iterate, sine."""

from typing import Annotated

import typer

from .app import app, progress_bar, tell
from .completion import complete_axis
from .options import (
    Axes,
    Beyond,
    HighPass,
    Json,
    Locked,
    LowPass,
    MachineName,
    Motion,
    Out,
    Override,
    Scale,
    Set,
    SettingsName,
    SpecimenAt,
    SpecimenName,
    Valves,
    find_settings,
    find_table,
    find_target,
    folder_for,
)
from .runs import repeating_command

__all__ = ["iterate", "sine", "tune"]


@app.command()
def tune(
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
    """Tune the three-variable controller for a machine and specimen; writes controller.toml and report.html."""
    from dataclasses import replace

    from ..control import save_controller
    from ..show.report import write_tune_report
    from ..show.result_tables import print_tuning
    from ..show.results import tuning_entries
    from ..tuning.tune import tune as tune_controller

    table = find_table(machine, override, valves, specimen, specimen_at, locked)
    settings = find_settings(controller, table)
    load = table.specimen.name if table.specimen else "bare"
    folder = folder_for(out, f"tune_{table.name}")
    with progress_bar(f"tuning {table.name}") as progress:
        found = tune_controller(table, settings, progress=progress)
    named = replace(found.after, name=f"tuned for {table.name}, {load}")
    save_controller(named, folder / "controller.toml", f"lhpost6 tune on {table.name}, {load}")
    write_tune_report(found, folder / "report.html", command=repeating_command())
    files = [folder / name for name in ("controller.toml", "report.html")]
    tell(json, lambda: tuning_entries(found), lambda: print_tuning(found), files)
    if not found.doubled:
        raise typer.Exit(1)


@app.command()
def iterate(
    motion: Motion,
    scale: Scale = 1.0,
    axes: Axes = None,
    most: Annotated[int | None, typer.Option(min=1, help="Iterations after the first run.")] = None,
    gain: Annotated[float | None, typer.Option(min=0.0, max=1.0, help="Gain of the drive's update.")] = None,
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    controller: SettingsName = None,
    valves: Valves = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    high_pass: HighPass = None,
    low_pass: LowPass = None,
    set_: Set = None,
    beyond: Beyond = False,
    json: Json = False,
) -> None:
    """Iterate the drive of a motion until its tracking error is least; writes drive.nc, inverse.nc and report.html."""
    from dataclasses import replace

    from ..control.inverse import save_inverse
    from ..mechanics.plant import make_plant
    from ..show.report import write_iterate_report
    from ..show.result_tables import print_iterations
    from ..show.results import iteration_entries
    from ..simulation.rehearse import target_within_limits
    from ..tuning.drives import circumstances, save_drive
    from ..tuning.iterate import iterate as iterate_drive

    table = find_table(machine, override, valves, specimen, specimen_at, locked)
    target = find_target(motion, set_, table, scale=scale, axes=axes, high_pass=high_pass, low_pass=low_pass)
    settings = find_settings(controller, table)
    name = target.reference.motion.replace("/", "_")
    folder = folder_for(out, f"{name}_iterated")
    if not beyond:
        target_within_limits(make_plant(table), target)
    with progress_bar(f"iterating {name} on {table.name}") as progress:
        result = iterate_drive(table, target, settings, most=most, gain=gain, progress=progress)
    facts = circumstances(table, settings.name)
    save_drive(result.drive, settings.mode, target, folder / "drive.nc", {**facts, "iteration": result.best})
    save_inverse(replace(result.table.inverse, made_with=facts), folder / "inverse.nc")
    write_iterate_report(result, folder / "report.html", command=repeating_command())
    files = [folder / name for name in ("drive.nc", "inverse.nc", "report.html")]
    tell(json, lambda: iteration_entries(result), lambda: print_iterations(result), files)


@app.command()
def sine(
    amplitude: Annotated[float, typer.Option(min=0.0, help=r"Amplitude \[m, or rad].")] = 0.75,
    frequency: Annotated[float, typer.Option(min=0.0, help="Frequency [Hz].")] = 0.5,
    axis: Annotated[str, typer.Option(help="Axis: x y z roll pitch or yaw.", autocompletion=complete_axis)] = "x",
    out: Out = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    controller: SettingsName = None,
    valves: Valves = 0,
    specimen: SpecimenName = None,
    specimen_at: SpecimenAt = None,
    locked: Locked = False,
    beyond: Beyond = False,
    json: Json = False,
) -> None:
    """Run a sine without and with amplitude-phase control and harmonic cancellation; writes report.html."""
    from ..mechanics.plant import make_plant
    from ..show.report import write_sine_report
    from ..show.result_tables import print_sine
    from ..show.results import sine_entries
    from ..simulation.rehearse import target_within_limits
    from ..tuning.sine import axis_row, sine_target, sine_test

    table = find_table(machine, override, valves, specimen, specimen_at, locked)
    plant = make_plant(table)
    axis_row(plant, axis)
    settings = find_settings(controller, table)
    folder = folder_for(out, f"sine_{axis}_{amplitude:g}_{frequency:g}Hz")
    if not beyond:
        target_within_limits(plant, sine_target(axis, amplitude, frequency)[0])
    with progress_bar(f"sine in {axis} on {table.name}") as progress:
        found = sine_test(table, settings, axis=axis, amplitude=amplitude, frequency=frequency, progress=progress)
    report = write_sine_report(found, folder / "report.html", command=repeating_command())
    tell(json, lambda: sine_entries(found), lambda: print_sine(found), [report])
