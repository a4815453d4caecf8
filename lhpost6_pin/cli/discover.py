"""Commands that identify missing effects: discover, and demo, which shows it in a minute."""

import webbrowser
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from .app import command, print_result, progress_bar, repeating_command
from .live_view import NoOpen
from .options import (
    CampaignFolder,
    Jobs,
    Json,
    MachineName,
    MountOptions,
    Out,
    ResumedOut,
    SensorsName,
    folder_for,
    measuring,
)

__all__ = ["demo", "discover"]


@command()
def discover(
    campaign: CampaignFolder,
    mount: MountOptions,
    model: Annotated[
        Path | None,
        typer.Option("--model", "--override", help="TOML file of parameters and effects to replace."),
    ] = None,
    hold_out: Annotated[
        list[str] | None,
        typer.Option(help="Held-out test, excluded from the search; may be repeated. none: hold out no test."),
    ] = None,
    out: ResumedOut = None,
    machine: MachineName = "lhpost6",
    sensors: SensorsName = None,
    seed: Annotated[int, typer.Option(help="Seed of the simulated sensor noise.")] = 0,
    jobs: Jobs = -1,
    json: Json = False,
) -> None:
    """Identify effects missing from the model, add them, test them on held-out data.

    Writes verdict.json, model.toml and report.html. An interrupted search resumes from its last checkpoint.
    """
    from ..data.campaign import load_campaign
    from ..data.measured_sensors import find_sensors
    from ..discovery import discover as search
    from ..discovery import verdict_entries
    from ..identification.calibration import usable_tests
    from ..machine.machine import load_machine
    from ..show.report.discover_report import save_discovery
    from ..show.result_tables import print_discovery

    bare = load_machine(machine, model)
    tests = usable_tests(load_campaign(campaign, bare))
    table = mount.onto_for(bare, tests.records)
    known = find_sensors(table, tests.records, sensors, measuring(campaign, machine))
    held = None if hold_out is None else [] if hold_out == ["none"] else hold_out
    folder = folder_for(out, f"{tests.name}_discovery", "verdict.json", "model.toml", "report.html")
    with progress_bar(f"searching {tests.name} for effects that {table.name} lacks") as progress:
        found = search(table, tests, known, hold_out=held, seed=seed, jobs=jobs, unfinished=folder, progress=progress)
    command_line = repeating_command()
    title = f"{table.name} with what was found in campaign {tests.name}; {command_line}"
    paths = save_discovery(found, folder, title, command_line)
    print_result(json, lambda: verdict_entries(found), lambda: print_discovery(found), paths)


@command()
def demo(
    out: Out = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of sensor noise and sensor errors.")] = 5,
    jobs: Jobs = -1,
    no_open: NoOpen = False,
    json: Json = False,
) -> None:
    """Hide an effect in simulated measurements, identify it, add it, and show the error shrink on a real earthquake."""
    from ..data.campaign import save_campaign
    from ..data.sensors import load_sensors
    from ..discovery import verdict_entries
    from ..discovery.demonstration import earthquake, hidden_effect, measured_tests, open_loops, searched
    from ..machine.library import find_family
    from ..machine.machine import load_machine
    from ..show.report.discover_report import save_discovery
    from ..show.result_tables import print_discovery
    from ..show.viewer import Look, show_record

    machine, sensors = load_machine(), load_sensors()
    folder = folder_for(out, "demo", "verdict.json", "model.toml", "report.html", "view.html")
    measured = folder / "measured"
    name, component, numbers = hidden_effect()
    seconds, scale = earthquake()
    family = find_family(name)
    units = {shape.name: shape.unit for shape in family.shapes}
    what = ", ".join(f"{key} {value:g} {units[key]}" for key, value in numbers.items())
    echo = partial(typer.echo, err=json)
    echo(
        f"1. A table with an effect that its model lacks: {family.title} ({component}), {what}.\n"
        f"   The virtual 469D runs two short tests on it, and the first {seconds:g} s of a real earthquake,\n"
        f"   before its strong part, at {scale:g} times its size (Ridgecrest 2019, CCC: at most 0.03 g);\n"
        "   sensors with noise, gains, offsets and skews record them."
    )
    with progress_bar("three tests") as progress:
        tests = measured_tests(machine, sensors, seed=seed, progress=progress)
    measured.mkdir(exist_ok=True, parents=True)
    for path in save_campaign(tests, measured):
        echo(f"   wrote {path}")
    echo("2. The search uses the model and the two short tests; the earthquake is held out.")
    with progress_bar("searching for the missing effect") as progress:
        found = searched(machine, tests, sensors, seed=seed, jobs=jobs, progress=progress)
    if not json:
        print_discovery(found)
    echo("3. The earthquake's measured spools drive the model without the controller (open loop):")
    loops = open_loops(machine, found.fitted, tests)
    before, after = loops.apart()
    echo(
        f"   the final position of C deviates from the measured one by {1e3 * before:.1f} mm with the original model,\n"
        f"   by {1e3 * after:.1f} mm with the effect identified."
    )
    title = f"{machine.name} with what `lhpost6 demo` found"
    *_, model, report = save_discovery(found, folder, title, repeating_command())
    view = folder / "view.html"
    show_record(machine, loops.measured, [loops.delivered, loops.found], Look(gap=10.0)).save(view)
    echo(
        "4. Results:\n"
        f"   {report}: the residual, the reason for the effect identified, the error before and after\n"
        f"   {view}: the measured earthquake; both models as outlines, deviations enlarged ten times\n"
        f"   {model}: the machine with the effect, for --machine in any command"
    )
    if json:
        entries = verdict_entries(found) | {"open_loop_end_apart_m": {"delivered": before, "found": after}}
        print_result(True, lambda: entries, lambda: None, [report, view, model])
    if not no_open:
        for page in (report, view):
            webbrowser.open(page.resolve().as_uri())
