"""Commands for measured data: check, export, decompose, validate, calibrate."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import ParameterError, RecordError
from . import options as opt
from .app import command, print_result, progress_bar, repeating_command
from .quantities import quantity_option

if TYPE_CHECKING:
    from ..data.campaign import Campaign

__all__ = ["calibrate", "check", "decompose", "export", "validate"]


@command()
def check(
    file: Annotated[Path, typer.Argument(help="Record, or a campaign: a directory of records.")],
    machine: opt.MachineOptions,
    sensors: opt.SensorsName = None,
    sensors_out: Annotated[
        Path | None, typer.Option(help="Sensors file (TOML) to write, with noise as rests of these records show it.")
    ] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace that file if there is one.")] = False,
    json: opt.Json = False,
) -> None:
    """Check records: layout, values, signs, noise at rest, agreement of redundant sensors; what sensors can tell."""
    from ..data.campaign_check import check_campaign
    from ..data.check import check_record
    from ..data.measured_sensors import save_sensors
    from ..data.summary import summarise_records
    from ..show.check_tables import campaign_entries, check_entries, print_check, print_tests
    from ..show.results import finding_entries
    from ..show.tables import print_findings
    from ..show.terminal import print_blocks

    table = machine.load()
    if sensors_out is not None and sensors_out.exists() and not replace:
        raise ParameterError(f"{sensors_out}: exists and may have been edited; --replace writes it anew")
    files = sorted(file.glob("*.nc")) or [file]
    found = {str(path): check_record(path, table) for path in files}
    wrong = {path for path, findings in found.items() if any(f.severity == "error" for f in findings)}
    tests = None
    try:
        tests = _comparable(files, wrong)
        checked = check_campaign(table, tests.records, sensors)
    except RecordError:
        if not wrong:
            raise
        checked = None  # a record that breaks the layout is among the findings
    written, unwritten = [], ""
    if sensors_out is not None:
        if checked is None or checked.content is None:
            why = "correct the errors first" if wrong else "no measured record of this machine"
            unwritten = f"{sensors_out}: not written: {(checked.reason if checked else '') or why}"
        else:
            save_sensors(checked.content, sensors_out)
            written = [sensors_out]

    summaries, skipped = (summarise_records(tests.records), tests.skipped) if tests else ((), ())

    def show() -> None:
        for path, findings in found.items():
            print_findings(path, findings)
        if len(files) > 1 and summaries:
            print_tests(summaries)
        if checked is not None:
            print_check(checked)
            if wrong:  # what a comparison of sensors does not count
                print_blocks(f"errors, listed above, in {', '.join(sorted(wrong))}")

    def entries() -> dict[str, Any]:
        summary = campaign_entries(summaries)
        return {**finding_entries(found), **summary, **check_entries(checked), "skipped": dict(skipped)}

    print_result(json, entries, show, written)
    if unwritten:
        raise RecordError(unwritten)
    if wrong:
        raise typer.Exit(1)


def _comparable(files: Sequence[Path], wrong: Collection[str]) -> "Campaign":
    """Records that can be read, without those that calibrate and discover skip, unless these are all.

    Raises RecordError if none can be read, or for one that cannot although it is not among the `wrong` files.
    """
    from ..data.campaign import Campaign, SkippedTest
    from ..data.records import load_record
    from ..data.served_samples import part_compared
    from ..identification.calibration import usable_tests

    records, skipped = [], []
    for path in files:
        try:
            record = load_record(path)
        except RecordError as error:
            if str(path) not in wrong or len(files) == 1:
                raise
            skipped.append(SkippedTest(path.stem, str(error)))
            continue
        record.attrs.setdefault("test", path.stem)
        records.append(part_compared(record))
    if not records:
        raise RecordError(skipped[0].why)
    whole = Campaign(files[0].parent.name, tuple(records), tuple(skipped))
    try:
        return usable_tests(whole)
    except RecordError:  # none of them: noise and signs may be checked all the same
        return whole


@command()
def export(
    record: Annotated[Path, typer.Argument(help="Record to export.")],
    to: Annotated[str, typer.Option(help="Format: csv, mat or parquet.")],
    out: Annotated[Path | None, typer.Option(help="File to write; default: beside the record.")] = None,
    json: opt.Json = False,
) -> None:
    """Write a record as CSV, MATLAB v5 or Parquet, with the unit in every column's name."""
    from ..data.importing import FORMATS, export_record, refuse_what_is_no_export
    from ..data.records import load_record

    dataset = load_record(record)
    path = out or record.with_suffix(FORMATS.get(to, ""))
    if path.exists() and path.samefile(record):
        raise RecordError(f"{path}: is the record to export; name another file with --out")
    refuse_what_is_no_export(path)
    export_record(dataset, path, to)
    print_result(json, dict, lambda: None, [path])


@command()
def decompose(
    record: Annotated[Path, typer.Argument(help="Record of a test, measured or simulated.")],
    machine: opt.SpecimenOptions,
    out: opt.Out = None,
    sensors: opt.SensorsName = None,
    cutoff: Annotated[
        float | None, quantity_option("--cutoff", "Hz", "33Hz", r"Low-pass of all forces \[Hz]; default: 33.")
    ] = None,
    no_align: Annotated[bool, typer.Option("--no-align", help="Do not correct skews between channels.")] = False,
    json: opt.Json = False,
) -> None:
    """Decompose the forces of a test, effect by effect, by inverse dynamics; writes ledger.nc and report.html."""
    from ..data.measured_sensors import find_sensors
    from ..data.records import is_measured, load_record
    from ..identification.decompose import decompose_record, find_agreement, find_work, save_ledger
    from ..show.report.decompose_report import write_decompose_report
    from ..show.result_tables import print_agreement
    from ..show.results import agreement_entries

    bare = machine.load_bare()
    measured = load_record(record, bare.labels)
    table = machine.onto_for(bare, [measured])
    folder = opt.folder_for(out, f"{opt.record_name(record, measured.attrs)}_forces", "ledger.nc", "report.html")
    known = None
    if is_measured(measured) or sensors:
        known = find_sensors(table, [measured], sensors, opt.measuring(record.parent, machine.machine))
    found = decompose_record(table, measured, known, cutoff=cutoff, align=not no_align)
    agreement, work = find_agreement(found), find_work(found)
    files = [folder / name for name in ("ledger.nc", "report.html")]
    save_ledger(found, files[0], work, str(record), agreement.interface)
    write_decompose_report(found, agreement, work, files[1], command=repeating_command())
    print_result(json, lambda: agreement_entries(found, agreement), lambda: print_agreement(found, agreement), files)


@command()
def validate(
    campaign: opt.CampaignFolder,
    machine: opt.SpecimenOptions,
    out: opt.Out = None,
    sensors: opt.SensorsName = None,
    controller: opt.PhaseSettingsName = None,
    phases: Annotated[str, typer.Option(help="Phases: 1 inverse dynamics, 2 open loop, 3 closed loop.")] = "1,2,3",
    jobs: opt.Jobs = -1,
    json: opt.Json = False,
) -> None:
    """Validate the model on measured tests in three phases; writes report.html and metrics.json."""
    from ..data.campaign import load_campaign
    from ..data.measured_sensors import find_sensors
    from ..identification.validation import metrics, save_metrics
    from ..identification.validation import validate as validate_campaign
    from ..show.report.validate_report import write_validate_report
    from ..show.result_tables import print_validation

    words = {word.strip() for word in phases.split(",")}
    if not words <= {"1", "2", "3"}:
        raise ParameterError(f"--phases {phases}: write some of 1,2,3 with commas between them")
    numbers = tuple(sorted(map(int, words)))
    bare = machine.load_bare()
    settings = opt.find_settings(controller, bare) if controller else None
    tests = load_campaign(campaign, bare)
    table = machine.onto_for(bare, tests.records)
    known = find_sensors(table, tests.records, sensors, opt.measuring(campaign, machine.machine))
    folder = opt.folder_for(out, f"{tests.name}_validation", "metrics.json", "report.html")
    with progress_bar(f"validating {table.name} on {tests.name}") as progress:
        found = validate_campaign(
            table, tests, sensors=known, settings=settings, phases=numbers, jobs=jobs, progress=progress
        )
    files = [folder / name for name in ("metrics.json", "report.html")]
    save_metrics(found, files[0])
    write_validate_report(found, files[1], command=repeating_command())
    print_result(json, lambda: metrics(found), lambda: print_validation(found), files)


@command()
def calibrate(
    campaign: opt.CampaignFolder,
    machine: opt.SpecimenOptions,
    out: opt.Out = None,
    sensors: opt.SensorsName = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulated sensor noise behind the weights.")] = 0,
    jobs: opt.Jobs = -1,
    json: opt.Json = False,
) -> None:
    """Calibrate parameters and sensors on measured tests; writes override.toml and report.html."""
    from ..data.campaign import load_campaign
    from ..data.measured_sensors import find_sensors
    from ..identification.calibration import calibrate as calibrate_machine
    from ..identification.calibration import usable_tests
    from ..identification.calibration.override import save_override
    from ..show.report.calibrate_report import write_calibrate_report
    from ..show.result_tables import print_calibration
    from ..show.results import calibration_entries

    bare = machine.load_bare()
    tests = usable_tests(load_campaign(campaign, bare))
    table = machine.onto_for(bare, tests.records)
    known = find_sensors(table, tests.records, sensors, opt.measuring(campaign, machine.machine))
    folder = opt.folder_for(out, f"{tests.name}_calibration", "override.toml", "report.html")
    with progress_bar(f"calibrating {table.name} on {tests.name}") as progress:
        found = calibrate_machine(
            *(table, tests.records, known),
            campaign=tests.name, skipped=tests.skipped, seed=seed, jobs=jobs, progress=progress,
        )  # fmt: skip
    files = [folder / name for name in ("override.toml", "report.html")]
    save_override(found, files[0])
    write_calibrate_report(found, files[1], command=repeating_command())
    print_result(json, lambda: calibration_entries(found), lambda: print_calibration(found), files)
    if not found.converged:
        raise typer.Exit(1)
