"""Commands of the virtual 469D: tune, iterate, replay, sine."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.errors import MotionError, SimulationError
from ..core.names import AXES
from ..core.units import numbers_in
from . import options as opt
from .app import command, print_result, progress_bar, repeating_command
from .completion import completing
from .loop_check import checked_loop, interaction_of, loop_entries, loop_facts
from .motion_options import MotionOptions
from .quantities import quantity_option
from .rehearse import save_run
from .results_folder import RUN_FILES

__all__ = ["iterate", "replay", "sine", "tune"]


@command()
def tune(
    machine: opt.SpecimenOptions,
    out: opt.Out = None,
    controller: opt.SettingsName = None,
    valves: opt.Valves = 0,
    json: opt.Json = False,
) -> None:
    """Tune the three-variable controller for a machine and specimen; writes controller.toml and report.html."""
    from ..control import save_controller
    from ..show.report.tune_report import write_tune_report
    from ..show.result_tables import print_tuning
    from ..show.results import tuning_entries
    from ..tuning.tune import tune as tune_controller

    table = machine.load(valves)
    settings = opt.find_settings(controller, table)
    load = table.specimen.name if table.specimen else "bare"
    folder = opt.folder_for(out, f"tune_{table.name}", "controller.toml", "report.html")
    with progress_bar(f"tuning {table.name}") as progress:
        found = tune_controller(table, settings, progress=progress)
    named = replace(found.after, name=f"tuned for {table.name}, {load}")
    files = [folder / name for name in ("controller.toml", "report.html")]
    save_controller(named, files[0], f"lhpost6 tune on {table.name}, {load}")
    write_tune_report(found, files[1], command=repeating_command())
    print_result(json, lambda: tuning_entries(found), lambda: print_tuning(found), files)
    if not found.doubled:
        raise typer.Exit(1)


@command()
def iterate(
    motion: MotionOptions,
    machine: opt.SpecimenOptions,
    most: Annotated[int | None, typer.Option(min=1, help="Iterations after the first run.")] = None,
    gain: Annotated[float | None, typer.Option(min=0.0, max=1.0, help="Gain of the drive's update.")] = None,
    out: opt.Out = None,
    controller: opt.SettingsName = None,
    valves: opt.Valves = 0,
    beyond: opt.Beyond = False,
    json: opt.Json = False,
) -> None:
    """Iterate the drive of a motion until its tracking error is least; writes drive.nc, inverse.nc and report.html."""
    from ..control.inverse import save_inverse
    from ..show.report.iterate_report import write_iterate_report
    from ..show.result_tables import print_iterations
    from ..show.results import iteration_entries
    from ..tuning.drives import circumstances, save_drive
    from ..tuning.iterate import iterate as iterate_drive

    table = machine.load(valves)
    settings = opt.find_settings(controller, table)
    target = motion.target(table, beyond)
    name = target.reference.motion.replace("/", "_")
    folder = opt.folder_for(out, f"{name}_iterated", "drive.nc", "inverse.nc", "report.html")
    loop = loop_facts(checked_loop(table, settings, machine), machine)
    with progress_bar(f"iterating {name} on {table.name}") as progress:
        result = iterate_drive(table, target, settings, most=most, gain=gain, progress=progress)
    facts = circumstances(table, settings.name)
    files = [folder / name for name in ("drive.nc", "inverse.nc", "report.html")]
    save_drive(result.drive, settings.mode, target, files[0], {**facts, "iteration": result.best})
    save_inverse(replace(result.table.inverse, made_with=facts), files[1])
    write_iterate_report(result, files[2], command=repeating_command(), loop=loop)
    print_result(
        json, lambda: iteration_entries(result) | loop_entries(loop), lambda: print_iterations(result, loop), files
    )


@command()
def replay(
    drive: Annotated[Path, typer.Argument(help="Drive file written by `lhpost6 iterate`.")],
    steps: opt.StepOptions,
    machine: opt.SpecimenOptions,
    scale: Annotated[
        float, quantity_option("--scale", "1", "50%", "Factor of the drive and of its target motion.")
    ] = 1.0,
    beyond: opt.Beyond = False,
    out: opt.Out = None,
    controller: opt.SettingsName = None,
    valves: opt.Valves = 0,
    json: opt.Json = False,
) -> None:
    """Replay a drive file in closed loop, compared with its target motion; writes record.nc and report.html.

    --scale multiplies both; the table is not linear, so that a drive fits its target best at the scale it was iterated.
    """
    from ..mechanics.plant import make_plant
    from ..simulation.motion_limits import check_motion_limits
    from ..simulation.rehearse import rehearse
    from ..tuning.drives import check_circumstances, load_drive, scaled_drive, scaled_target

    table = machine.load(valves)
    settings = opt.find_settings(controller, table)
    options = steps.checked(table)
    iterated = load_drive(drive)
    found = scaled_drive(iterated, scale)
    check_circumstances(str(drive), found.attrs, table, settings.name)
    if not beyond:
        check_motion_limits(make_plant(table), scaled_target(iterated, scale))
    if found.mode != settings.mode:
        raise SimulationError(
            f"{drive} is for reference generators in {found.mode} mode; {settings.name} has {settings.mode} mode"
        )
    name = f"{found.target.reference.motion.replace('/', '_')}_replay"
    folder = opt.folder_for(out, name, *RUN_FILES)
    facts = loop_facts(checked_loop(table, settings, machine), machine)
    attrs = {"test": name, "title": f"{name} on {table.name}", "drive": str(drive), **facts}
    with progress_bar(f"{name} on {table.name}") as progress:
        test = rehearse(
            table,
            found.target,
            settings,
            attrs=attrs,
            drive=found.values,
            beyond_limits=True,
            progress=progress,
            **options,
        )
    save_run(test, folder, json, interaction=interaction_of(table, settings, settings, None))


@command()
def sine(
    machine: opt.SpecimenOptions,
    amplitude: Annotated[
        str | None,
        typer.Option(
            metavar="<quantity>", help=r"Amplitude \[m, or rad], or with a unit: 50mm; default: half of what fits."
        ),
    ] = None,
    frequency: Annotated[float, quantity_option("--frequency", "Hz", "2Hz", r"Frequency \[Hz].")] = 0.5,
    axis: Annotated[
        str, typer.Option(help="Axis: x y z roll pitch or yaw.", autocompletion=completing(lambda: AXES))
    ] = "x",
    out: opt.Out = None,
    controller: opt.SettingsName = None,
    valves: opt.Valves = 0,
    beyond: opt.Beyond = False,
    json: opt.Json = False,
) -> None:
    """Run a sine without and with amplitude-phase control and harmonic cancellation; writes report.html."""
    from ..core.rounding import rounded_down
    from ..mechanics.plant import make_plant
    from ..show.report.sine_report import sine_verdict, write_sine_report
    from ..show.result_tables import print_sine
    from ..show.results import sine_entries
    from ..simulation.motion_limits import check_motion_limits
    from ..tuning.sine import axis_row, default_amplitude, sine_target, sine_test

    table = machine.load(valves)
    plant = make_plant(table)
    axis_row(plant, axis)
    size = default_amplitude(plant, axis, frequency) if amplitude is None else _amplitude(amplitude, axis)
    settings = opt.find_settings(controller, table)
    folder = opt.folder_for(out, f"sine_{axis}_{size:g}_{frequency:g}Hz", "report.html")
    if not beyond:
        target, unit = sine_target(axis, size, frequency)[0], _unit(axis)
        check_motion_limits(
            plant, target, size=lambda s: f"--amplitude that fits is {rounded_down(size * s, 3):g}{unit}"
        )
    loop = loop_facts(checked_loop(table, settings, machine), machine)
    with progress_bar(f"sine in {axis} on {table.name}") as progress:
        found = sine_test(table, settings, axis=axis, amplitude=size, frequency=frequency, progress=progress)
    report = write_sine_report(found, folder / "report.html", command=repeating_command(), loop=loop)

    def entries() -> dict[str, Any]:
        words, level = sine_verdict(found, loop)
        return {"verdict": words, "level": level, **sine_entries(found), **loop_entries(loop)}

    print_result(json, entries, lambda: print_sine(found, loop), [report])


def _unit(axis: str) -> str:
    """Unit of an amplitude."""
    return "m" if axis in AXES[:3] else "rad"


def _amplitude(text: str, axis: str) -> float:
    """Amplitude on an axis [m, rad], as a user wrote it."""
    unit = _unit(axis)
    numbers = numbers_in(text, unit)
    if numbers is None or len(numbers) > 1 or not numbers[0] > 0.0:
        example = "50mm" if unit == "m" else "1deg"
        what = f"give one number above zero, in {unit} or with a unit of the same kind, as {example}"
        raise MotionError(f"--amplitude {text}: {what}")
    return numbers[0]
