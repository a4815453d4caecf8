"""Commands that run the virtual table: run, open-loop, campaign; and the motions that it can run."""

import logging
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.beside import beside, import_all
from ..core.errors import ParameterError, RecordError, SimulationError
from ..core.names import SAMPLE_RATE, SCHEMES
from . import options as opt
from .app import command, print_result, progress_bar, repeating_command
from .completion import complete_motion, complete_sensors
from .live_view import EndedBySignal, LiveOptions, watched
from .loop_check import TUNING_FILES, checked_loop, interaction_of, loop_entries, loop_facts, retuned
from .motion_options import MotionOptions
from .quantities import quantity_option
from .results_folder import RUN_FILES

if TYPE_CHECKING:
    import xarray as xr

    from ..core.arrays import Array
    from ..machine.machine import Machine
    from ..motions import Target
    from ..simulation.loops import ClosedLoop, PluggedLoop
    from ..simulation.rehearse import SimulatedTest
    from ..tuning.interaction import Interaction

log = logging.getLogger(__name__)

TEST_FACTS = ("machine", "motion", "scale", "time_scale", "specimen", "effects", "overrides")
"""Attributes of a record that say what was run on what, for `--json`."""

_AFTER_A_RUN = ("xarray", "lhpost6_pin.data.netcdf", "lhpost6_pin.show.run_results", "lhpost6_pin.show.tables")
"""What record and report need: loaded while the table is simulated."""

__all__ = ["campaign", "motions", "open_loop", "run", "save_run"]


@command()
def run(
    motion: MotionOptions,
    steps: opt.StepOptions,
    machine: opt.SpecimenOptions,
    view: LiveOptions,
    out: opt.Out = None,
    controller: opt.ControllerName = None,
    aic: Annotated[
        Path | None, typer.Option(help="Condition the drive with this inverse (inverse.nc of `lhpost6 iterate`).")
    ] = None,
    cancel: opt.Cancel = None,
    valves: opt.Valves = 0,
    retune: Annotated[
        bool, typer.Option("--retune", help="Tune the controller for this table and specimen first, then run with it.")
    ] = False,
    beyond: opt.Beyond = False,
    record_rate: Annotated[
        int,
        typer.Option(help="Samples per second of the record, a divisor of 2048; the report has all samples."),
    ] = 2048,
    no_record: Annotated[bool, typer.Option("--no-record", help="Write no record (1 MB a second).")] = False,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write no report.")] = False,
    json: opt.Json = False,
) -> None:
    """Run a motion in closed loop on the virtual table; writes record.nc and report.html.

    With --live, Ctrl-C or SIGTERM ends the motion, and what was done is written.
    """
    from ..control import ControllerSettings
    from ..control.inverse import load_inverse
    from ..simulation.compile_ahead import compile_ahead, load_ahead, wait_for
    from ..simulation.rehearse import rehearse

    if record_rate < 1 or SAMPLE_RATE % record_rate:
        raise SimulationError(f"--record-rate {record_rate} does not divide {SAMPLE_RATE}")
    table = machine.load(valves)
    chosen = opt.find_controller(controller, table)
    own = not isinstance(chosen, ControllerSettings)
    options = steps.checked(table, own_controller=own)
    usual = steps.scheme == SCHEMES[0] and not own and options["coupling"] is None
    compiling = compile_ahead(steps.engine) if usual else None
    inverse = load_inverse(aic) if aic else None
    if inverse is not None:
        if not isinstance(chosen, ControllerSettings):
            raise SimulationError(f"--aic is for the 469D's drive, which --controller {controller} does without")
        from ..tuning.drives import check_circumstances

        check_circumstances(str(aic), inverse.made_with, table, chosen.name)
    target = motion.target(table, beyond)
    if usual:
        load_ahead(steps.engine)
    name = target.reference.motion.replace("/", "_")
    asked = (("record.nc", no_record), ("report.html", no_report), ("tuning.html", no_report))
    leave_out = {file for file, no in asked if no}
    written = [file for file in (*RUN_FILES, *(TUNING_FILES if retune else ())) if file not in leave_out]
    folder = opt.folder_for(out, name, *written, inputs=motion.files)
    given = chosen
    more: list[Path] = []
    if retune:
        if inverse is not None:
            raise SimulationError("--aic is an inverse of the controller as it was; --retune changes it")
        chosen, _, more = retuned(table, chosen, folder, leave_out)
    loop = checked_loop(table, chosen, machine, retune=not retune)
    title = f"{target.reference.title} on {table.name}"
    wait_for(compiling)
    beside(import_all, *_AFTER_A_RUN)
    ended = EndedBySignal(view.live)
    with (
        watched(view, table, title, err=json, ended=ended) as watch,
        ended,
        progress_bar(f"{name} on {table.name}") as progress,
    ):
        test = rehearse(
            table,
            target,
            chosen,
            attrs={"test": name, "title": title, **loop_facts(loop, machine)},
            inverse=inverse,
            adapt=_canceller(cancel, target),
            beyond_limits=True,
            progress=progress,
            watch=watch,
            stop=ended if view.live else None,
            **options,
        )
    shown = interaction_of(table, given, chosen, inverse)
    every = SAMPLE_RATE // record_rate
    save_run(test, folder, json, interaction=shown, more=more, leave_out=leave_out, record_every=every)


def _canceller(cancel: str | None, target: "Target") -> "Callable[[ClosedLoop | PluggedLoop], ClosedLoop] | None":
    """What adds the sine cancellers that are asked for to a loop."""
    if cancel is None:
        return None
    from ..tuning.cancel import cancelling

    return lambda loop: cancelling(loop, target, cancel)


@command("open-loop")
def open_loop(
    record: Annotated[Path, typer.Argument(help="Record whose spool positions drive the plant.")],
    steps: opt.StepOptions,
    machine: opt.SpecimenOptions,
    out: opt.Out = None,
    json: opt.Json = False,
) -> None:
    """Drive the plant by recorded spools from recorded pressures (open loop); writes record.nc and report.html.

    At the start seals and pads hold what the balance of measured forces shows. A recording that tripped is used up to
    its trip.
    """
    from ..data.records import load_record
    from ..data.served_samples import cut_notes, part_compared
    from ..simulation.rehearse import replay

    bare = machine.load_bare()
    measured = part_compared(load_record(record, bare.labels))
    table = machine.onto_for(bare, [measured])
    options = steps.checked(table)
    test = opt.record_name(record, measured.attrs)
    name = f"{test}_open_loop"
    folder = opt.folder_for(out, name, *RUN_FILES, inputs=[record])
    attrs = {"test": name, "title": f"{test}, open loop", "source": f"spools of {record}"}
    driving, friction, note = _driving(table, measured)
    with progress_bar(f"{name} on {table.name}") as progress:
        simulated = replay(table, driving, attrs=attrs, friction=friction, progress=progress, **options)
    save_run(simulated, folder, json, against=measured, notes=[*cut_notes(measured), *filter(None, [note])])


def _driving(table: "Machine", record: "xr.Dataset") -> "tuple[xr.Dataset, Array | None, str]":
    """A record with the spools that drive a model, the friction held at its start, and a sentence on that.

    Of a simulated record spools are as they are. What sensors are not known for is a warning.
    """
    from ..data.measured_sensors import find_sensors
    from ..data.quiet_spools import quiet_spools
    from ..data.records import is_measured
    from ..identification.friction_start import start_note, start_of_record
    from ..mechanics.plant import make_plant

    sensors, driving = None, record
    if is_measured(record):
        try:
            sensors = find_sensors(table, [record])
            driving = quiet_spools(record, sensors)
        except RecordError as error:
            log.warning("the noise of the spools is not known, and drives the model with them: %s", error)
            return record, None, ""
    plant = make_plant(table.as_tested(record.attrs, "the record"))
    if plant.flexible:  # its wrench is not known
        return driving, None, ""
    try:
        friction = start_of_record(plant, record, sensors)
    except RecordError as error:
        log.warning("what seals and pads hold at the start is not known, nothing is assumed: %s", error)
        return driving, None, ""
    return driving, friction, start_note(plant, friction)


@command()
def campaign(
    machine: opt.SpecimenOptions,
    out: Annotated[
        Path | None, typer.Option(help="Directory of the records, without any so far; default: out/campaign.")
    ] = None,
    controller: opt.SettingsName = None,
    sensors: Annotated[
        str | None,
        typer.Option(
            help="Noise and errors of the sensors: shipped name, or a TOML file; default: those that the machine file "
            "names, else the LHPOST6's.",
            autocompletion=complete_sensors,
        ),
    ] = None,
    tests: Annotated[str | None, typer.Option(help="Tests of the campaign, such as TX,WN; default: all.")] = None,
    scale: Annotated[
        float, quantity_option("--scale", "1", "50%", "Scale factor of all motions, e.g. for a smaller table.")
    ] = 1.0,
    valves: opt.Valves = 0,
    beyond: opt.Beyond = False,
    errors: Annotated[bool, typer.Option(help="Draw random gains, offsets and skews of the sensors.")] = True,
    seed: Annotated[int, typer.Option(min=0, help="Seed of sensor noise and sensor errors.")] = 0,
    json: opt.Json = False,
) -> None:
    """Simulate a campaign of tests, recorded through sensors with noise and errors: to plan a real one."""
    from ..data.campaign import save_campaign
    from ..data.sensors import load_sensors
    from ..data.summary import summarise_records
    from ..show.check_tables import campaign_entries, print_tests
    from ..simulation.simulated_campaign import check_campaign, simulate_campaign

    table = machine.load(valves)
    named = sensors or table.sensors
    if not named:
        log.warning("%s names no sensors file: tests are recorded with the noise of the LHPOST6's sensors", table.name)
    settings, known = opt.find_settings(controller, table), load_sensors(named or "lhpost6")
    chosen = tuple(word.strip() for word in tests.split(",")) if tests is not None else None
    if chosen is not None and len(set(chosen)) < len(chosen):
        raise ParameterError(f"--tests {tests}: names a test twice")
    if scale == 0.0:
        raise ParameterError("--scale 0: nothing would move; a campaign needs motion")
    folder = opt.folder_for(out, "campaign")
    if any(folder.glob("*.nc")):
        raise ParameterError(f"--out {folder}: holds records already, which would count as tests; name another folder")
    if not beyond:
        check_campaign(table, tests=chosen, scale=scale)
    facts = loop_facts(checked_loop(table, settings, machine), machine)
    name = folder.resolve().name
    options: dict[str, Any] = {"seed": seed, "errors": errors, "tests": chosen, "scale": scale, "name": name}
    with progress_bar(f"a campaign on {table.name}") as progress:
        made = simulate_campaign(table, settings, known, attrs=facts, progress=progress, **options)
    files, summaries = save_campaign(made, folder), summarise_records(made.records)
    entries = {"campaign": name, "tests": [one.test for one in summaries], **campaign_entries(summaries)}
    entries |= loop_entries(facts)
    print_result(json, lambda: entries, lambda: print_tests(summaries), files)


@command()
def motions(
    name: Annotated[
        str | None, typer.Argument(help="A motion, to print its options.", autocompletion=complete_motion)
    ] = None,
    json: opt.Json = False,
) -> None:
    """List ground motions and tests by name."""
    from ..show.results import motion_entries
    from ..show.tables import print_motions

    print_result(json, lambda: motion_entries(name), lambda: print_motions(name))


def save_run(
    test: "SimulatedTest",
    folder: Path,
    json: bool,
    against: "xr.Dataset | None" = None,
    *,
    interaction: "Interaction | None" = None,
    more: Sequence[Path] = (),
    leave_out: Collection[str] = (),
    record_every: int = 1,
    notes: Sequence[str] = (),
) -> None:
    """Write the record and the report, a comparison if it is `against` a measured test; print a summary.

    interaction: of table and specimen, for the report; more: files that were written before; leave_out: those of
    `RUN_FILES` that are not written; record_every: the file of the record keeps every such sample, report and summary
    are of all; notes: sentences on how it was run, for the report.

    Raises typer.Exit if the run stopped on the way.
    """
    from ..data.records import save_record, thinned
    from ..data.replay_comparison import compare
    from ..show.report.open_loop_report import write_open_loop_report
    from ..show.results import run_entries
    from ..show.run_results import notes_of_run, run_remarks, write_test_report
    from ..show.tables import machine_rows, print_comparison, print_run

    done, record = test
    files, summary = [*more, *(folder / file for file in RUN_FILES if file not in leave_out)], None
    path = None if RUN_FILES[1] in leave_out else files[-1]
    if RUN_FILES[0] not in leave_out:
        save_record(thinned(record, record_every), folder / RUN_FILES[0], single=True)
    remarks = run_remarks(test)
    for remark in remarks:
        log.warning("%s", remark)
    notes, command = [*notes, *notes_of_run(done, remarks)], repeating_command()
    entries: dict[str, Any]
    if against is None:
        summary = write_test_report(done.plant, record, path, notes, command=command, interaction=interaction)
        entries = loop_entries(record.attrs)
    else:
        compared, rows = compare(against, record), machine_rows(done.plant.machine)
        verdict, level = write_open_loop_report(
            against, record, compared, files[-1], notes=notes, command=command, machine_table=rows
        )
        entries = {"verdict": verdict, "level": level, "against_record": compared}

    def show() -> None:
        if against is not None and compared:
            print_comparison(compared)
        print_run(done, summary)

    facts = {key: record.attrs.get(key) for key in TEST_FACTS}
    print_result(json, lambda: facts | run_entries(done, summary) | entries, show, files)
    if done.trouble:
        raise typer.Exit(1)
