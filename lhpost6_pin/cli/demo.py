"""The command that demonstrates discovery in a minute: demo."""

from typing import Annotated

import typer

from .app import app, progress_bar, tell
from .live_view import NoOpen
from .options import Json, Out, folder_for, refuse_no_jobs
from .runs import repeating_command

__all__ = ["demo"]


@app.command()
def demo(
    out: Out = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of sensor noise and sensor errors.")] = 5,
    jobs: Annotated[int, typer.Option(help="Threads; -1: all cores.")] = -1,
    no_open: NoOpen = False,
    json: Json = False,
) -> None:
    """Hide an effect in simulated measurements, identify it, add it, and show the error shrink on a real earthquake."""
    import webbrowser
    from functools import partial

    from ..data.campaign import save_campaign
    from ..data.sensors import load_sensors
    from ..discovery import verdict_entries
    from ..discovery.demonstration import hidden_effect, measured_tests, open_loops, searched
    from ..machine.library import find_family
    from ..machine.machine import load_machine
    from ..show.report.discover_report import save_discovery
    from ..show.result_tables import print_discovery
    from ..show.viewer import Look, show_record

    refuse_no_jobs(jobs)
    machine, sensors = load_machine(), load_sensors()
    folder = folder_for(out, "demo")
    measured = folder / "measured"
    name, component, numbers = hidden_effect()
    family = find_family(name)
    units = {shape.name: shape.unit for shape in family.shapes}
    what = ", ".join(f"{key} {value:g} {units[key]}" for key, value in numbers.items())
    say = partial(typer.echo, err=json)
    say(
        f"1. A table that has what its model lacks: {family.title} ({component}), {what}.\n"
        "   The virtual 469D runs two short tests on it, and half of a real earthquake (Ridgecrest 2019, CCC);\n"
        "   sensors with noise, gains, offsets and skews record them."
    )
    with progress_bar("three tests") as progress:
        tests = measured_tests(machine, sensors, seed=seed, progress=progress)
    measured.mkdir(exist_ok=True, parents=True)
    for path in save_campaign(tests, measured):
        say(f"   wrote {path}")
    say("2. The search knows the model and these tests, and keeps the earthquake for the proof.")
    with progress_bar("what does the model lack?") as progress:
        found = searched(machine, tests, sensors, seed=seed, jobs=jobs, progress=progress)
    if not json:
        print_discovery(found)
    say("3. The earthquake's measured spools drive the model without the controller (open loop):")
    loops = open_loops(machine, found.fitted, tests)
    before, after = loops.apart()
    say(
        f"   C ends {1e3 * before:.1f} mm from where it was measured with the model as delivered,\n"
        f"   {1e3 * after:.1f} mm with what was found."
    )
    title = f"{machine.name} with what `lhpost6 demo` found"
    _, model, report = save_discovery(found, folder, title, repeating_command())
    view = folder / "view.html"
    show_record(machine, loops.measured, [loops.delivered, loops.found], Look(gap=10.0)).save(view)
    say(
        "4. Look at it:\n"
        f"   {report}: where the gap was, why this name, the gap shrinking\n"
        f"   {view}: the earthquake as measured; the outlines of both models, their gaps ten times as large\n"
        f"   {model}: the machine with the effect, for --machine in any command"
    )
    if json:
        entries = verdict_entries(found) | {"open_loop_end_apart_m": {"delivered": before, "found": after}}
        tell(True, lambda: entries, lambda: None, [report, view, model])
    if not no_open:
        for page in (report, view):
            webbrowser.open(page.resolve().as_uri())
