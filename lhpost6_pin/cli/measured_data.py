"""Commands for measured data: check, export, decompose, validate, calibrate."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import ParameterError, RecordError
from . import options as opt
from .app import command, print_result, progress_bar, repeating_command

if TYPE_CHECKING:
    from ..data.consistency import ConsistencyFinding
    from ..machine.machine import Machine

__all__ = ["calibrate", "check", "decompose", "export", "validate"]


@command()
def check(
    file: Annotated[Path, typer.Argument(help="Record, or a campaign: a directory of records.")],
    machine: opt.MachineOptions,
    sensors: opt.SensorsName = "lhpost6",
    json: opt.Json = False,
) -> None:
    """Check records: layout, values, and the agreement of redundant sensors."""
    from ..data.check import check_record
    from ..show.results import finding_entries
    from ..show.tables import print_findings, print_sensor_findings

    table = machine.load()
    files = sorted(file.glob("*.nc")) or [file]
    found = {str(path): check_record(path, table) for path in files}
    wrong = any(f.severity == "error" for findings in found.values() for f in findings)
    compared = None if wrong else _check_sensors(table, files, sensors)

    def show() -> None:
        for path, findings in found.items():
            print_findings(path, findings)
        if compared is not None:
            print_sensor_findings(compared)

    print_result(json, lambda: {**finding_entries(found), "sensors": compared}, show)
    if wrong:
        raise typer.Exit(1)


def _check_sensors(table: "Machine", files: list[Path], sensors: str) -> "list[ConsistencyFinding] | None":
    """Compare redundant sensors in measured records of this machine; noise-free simulated records are skipped."""
    from ..data.consistency import check_sensors
    from ..data.records import is_measured, load_record
    from ..data.sensors import load_sensors
    from ..mechanics.plant import make_plant

    records = [load_record(path) for path in files]
    labels = {"actuator": table.actuator_names, "strut": table.strut_names}
    measured = [
        r
        for r in records
        if is_measured(r)
        and all([str(x) for x in r[dim].values] == list(names) for dim, names in labels.items() if dim in r.coords)
    ]
    return list(check_sensors(make_plant(table), measured, load_sensors(sensors))) if measured else None


@command()
def export(
    record: Annotated[Path, typer.Argument(help="Record to export.")],
    to: Annotated[str, typer.Option(help="Format: csv, mat or parquet.")],
    out: Annotated[Path | None, typer.Option(help="File to write; default: beside the record.")] = None,
    json: opt.Json = False,
) -> None:
    """Write a record as CSV, MATLAB v5 or Parquet, with the unit in every column's name."""
    from ..data.importing import FORMATS, export_record
    from ..data.records import load_record

    dataset = load_record(record)
    path = out or record.with_suffix(FORMATS.get(to, ""))
    if path.exists() and path.samefile(record):
        raise RecordError(f"{path}: is the record to export; name another file with --out")
    export_record(dataset, path, to)
    print_result(json, dict, lambda: None, [path])


@command()
def decompose(
    record: Annotated[Path, typer.Argument(help="Record of a test, measured or simulated.")],
    machine: opt.SpecimenOptions,
    out: opt.Out = None,
    sensors: opt.SensorsName = "lhpost6",
    cutoff: Annotated[float | None, typer.Option(help="Low-pass of all forces [Hz]; default: 33.")] = None,
    no_align: Annotated[bool, typer.Option("--no-align", help="Do not correct skews between channels.")] = False,
    json: opt.Json = False,
) -> None:
    """Decompose the forces of a test, effect by effect, by inverse dynamics; writes ledger.nc and report.html."""
    from ..data.records import load_record
    from ..data.sensors import load_sensors
    from ..identification.decompose import decompose_record, find_agreement, find_work, save_ledger
    from ..show.report import write_decompose_report
    from ..show.result_tables import print_agreement
    from ..show.results import agreement_entries

    table = machine.load()
    measured = load_record(record)
    folder = opt.folder_for(out, f"{opt.record_name(record, measured.attrs)}_forces")
    found = decompose_record(table, measured, load_sensors(sensors), cutoff=cutoff, align=not no_align)
    agreement, work = find_agreement(found), find_work(found)
    files = [folder / name for name in ("ledger.nc", "report.html")]
    save_ledger(found, files[0], work, str(record))
    write_decompose_report(found, agreement, work, files[1], command=repeating_command())
    print_result(json, lambda: agreement_entries(found, agreement), lambda: print_agreement(found, agreement), files)


@command()
def validate(
    campaign: opt.CampaignFolder,
    machine: opt.SpecimenOptions,
    out: opt.Out = None,
    sensors: opt.SensorsName = "lhpost6",
    controller: opt.PhaseSettingsName = None,
    phases: Annotated[str, typer.Option(help="Phases: 1 inverse dynamics, 2 open loop, 3 closed loop.")] = "1,2,3",
    jobs: opt.Jobs = -1,
    json: opt.Json = False,
) -> None:
    """Validate the model on measured tests in three phases; writes report.html and metrics.json."""
    from ..data.campaign import load_campaign
    from ..data.sensors import load_sensors
    from ..identification.validation import metrics, save_metrics
    from ..identification.validation import validate as validate_campaign
    from ..show.report.validate_report import write_validate_report
    from ..show.result_tables import print_validation

    words = {word.strip() for word in phases.split(",")}
    if not words <= {"1", "2", "3"}:
        raise ParameterError(f"--phases {phases}: write some of 1,2,3 with commas between them")
    numbers = tuple(sorted(map(int, words)))
    table = machine.load()
    settings = opt.find_settings(controller, table) if controller else None
    known, tests = load_sensors(sensors), load_campaign(campaign, table)
    folder = opt.folder_for(out, f"{tests.name}_validation")
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
    sensors: opt.SensorsName = "lhpost6",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulated sensor noise behind the weights.")] = 0,
    jobs: opt.Jobs = -1,
    json: opt.Json = False,
) -> None:
    """Calibrate parameters and sensors on measured tests; writes override.toml and report.html."""
    from ..data.campaign import load_campaign
    from ..data.sensors import load_sensors
    from ..identification.calibration import calibrate as calibrate_machine
    from ..identification.calibration.override import save_override
    from ..show.report import write_calibrate_report
    from ..show.result_tables import print_calibration
    from ..show.results import calibration_entries

    table = machine.load()
    known, tests = load_sensors(sensors), load_campaign(campaign, table)
    folder = opt.folder_for(out, f"{tests.name}_calibration")
    with progress_bar(f"calibrating {table.name} on {tests.name}") as progress:
        found = calibrate_machine(
            table, tests.records, known, campaign=tests.name, seed=seed, jobs=jobs, progress=progress
        )
    files = [folder / name for name in ("override.toml", "report.html")]
    save_override(found, files[0])
    write_calibrate_report(found, files[1], command=repeating_command())
    print_result(json, lambda: calibration_entries(found), lambda: print_calibration(found), files)
    if not found.converged:
        raise typer.Exit(1)
