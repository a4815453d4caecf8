"""Commands for measured data: import, check, export, decompose, validate, calibrate."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import ParameterError, RecordError
from . import options as opt
from .app import command, print_result, progress_bar, repeating_command

if TYPE_CHECKING:
    from ..data.consistency import ConsistencyFinding
    from ..data.importing import RawTest
    from ..machine.machine import Machine

__all__ = ["calibrate", "check", "decompose", "export", "import_", "validate"]


@command("import")
def import_(
    files: Annotated[list[Path], typer.Argument(help="Data file(s) of one test.")],
    machine: opt.MachineOptions,
    map_: Annotated[Path | None, typer.Option("--map", help="Channel map (TOML).")] = None,
    guess: Annotated[bool, typer.Option("--guess", help="Write a draft channel map to edit, and no record.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Record to write, default: out/TEST.nc; with --guess the map, default: FILE_map.toml."),
    ] = None,
    json: opt.Json = False,
) -> None:
    """Convert measured data to a record: MTS 469D, CSV, MATLAB, HDF5, netCDF, TDMS or Parquet."""
    from ..data.check import check_dataset
    from ..data.importing import (
        channel_units,
        described_sources,
        guess_map,
        is_export,
        load_map,
        load_raw,
        make_imported_record,
    )
    from ..data.records import save_record
    from ..show.results import finding_entries
    from ..show.tables import print_findings

    if guess and map_:
        raise RecordError("--guess writes a map, --map uses one; give one of them")
    table = machine.load()
    raws = [raw for file in files for raw in load_raw(file)]
    if guess:
        _write_draft_map(raws, table, files, out or Path(f"{files[0].stem}_map.toml"), json)
        return
    if map_ is None and not is_export(raws):
        raise RecordError(f"{files[0]}: which column is which channel? --guess writes a first map, --map uses one")
    channels = load_map(map_) if map_ else guess_map(raws, table.labels).channels
    record = make_imported_record(raws, channels, table.labels, table)
    path = out or Path("out") / f"{record.attrs['test'].replace('/', '_')}.nc"
    if any(path.exists() and path.samefile(file) for file in files):
        raise RecordError(f"{path}: is one of the files to import; name another with --out")
    save_record(record, path)
    sources, findings = described_sources(raws, channels), check_dataset(record, table)
    entries = {  # source and range of every channel expose a wrong unit
        name: {"from": sources.get(name, "derived"), "unit": unit, "least": values.min(), "most": values.max()}
        for name, unit, values in channel_units(record)
    }

    def show() -> None:
        from rich.markup import escape
        from rich.table import Table

        from ..core.console import make_console

        rows = Table("channel", "from", "unit", "least", "most", title=escape(str(record.attrs["title"])))
        for name, entry in entries.items():
            cells = (name, entry["from"], entry["unit"], f"{entry['least']:.6g}", f"{entry['most']:.6g}")
            rows.add_row(*map(escape, cells))
        make_console().print(rows)
        print_findings(str(path), findings)

    print_result(json, lambda: {**finding_entries({str(path): findings}), "channels": entries}, show, [path])


def _write_draft_map(raws: "list[RawTest]", table: "Machine", files: list[Path], path: Path, json: bool) -> None:
    """Write a first channel map, and print the command that uses it."""
    from ..data.importing import guess_map, save_map

    found, remarks = guess_map(raws, table.labels)
    if path.exists():
        raise RecordError(f"{path}: exists and may have been edited; remove it, or name another with --out")
    save_map(found, path, remarks)
    then = f"lhpost6 import {' '.join(map(str, files))} --map {path}"
    hint = f"{path}: {len(found.channels)} channels, {len(remarks)} remarks; read and edit it, then\n{then}"
    entries = {"channels": len(found.channels), "remarks": remarks, "then": then}
    print_result(json, lambda: entries, lambda: typer.echo(hint), [path])


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
