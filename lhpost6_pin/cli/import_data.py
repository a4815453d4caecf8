"""The command `import`: measured data of one test, or of many, as records."""

import shlex
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import RecordError
from . import options as opt
from .app import command, print_result

if TYPE_CHECKING:
    import xarray as xr

    from ..data.importing import ChannelMap, RawTest
    from ..data.layout_faults import RecordFinding
    from ..machine.machine import Machine

__all__ = ["import_"]


@command("import")
def import_(
    files: Annotated[
        list[Path], typer.Argument(help="Data file(s) of one test; or a folder, or folders, of one file a test.")
    ],
    machine: opt.MachineOptions,
    map_: Annotated[Path | None, typer.Option("--map", help="Channel map (TOML).")] = None,
    guess: Annotated[bool, typer.Option("--guess", help="Write a draft channel map to edit, and no record.")] = False,
    each: Annotated[bool, typer.Option("--each", help="Each file is a test of its own, as in a folder.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Record to write, default: out/TEST.nc; of many tests the campaign, default: out/FOLDER; "
            "with --guess the map, default: FILE_map.toml."
        ),
    ] = None,
    json: opt.Json = False,
) -> None:
    """Convert measured data to records: MTS 469D, CSV, MATLAB, HDF5, netCDF, TDMS or Parquet."""
    if guess and map_:
        raise RecordError("--guess writes a map, --map uses one; give one of them")
    table = machine.load()
    many = each or any(file.is_dir() for file in files)
    if guess:
        _write_draft_map(files, many, table, _again(files, each, machine), out, json)
    elif many:
        _import_many(files, table, map_, out, json)
    else:
        _import_one(files, table, map_, out, json)


def _again(files: Sequence[Path], each: bool, machine: opt.MachineOptions) -> str:
    """Command that imports the same files, up to its map."""
    words = ["lhpost6", "import", *map(str, files), *(["--each"] if each else [])]
    given = {key: getattr(machine, key) for key in ("machine", "override", "accelerometers")}
    for key, value in given.items():
        if value not in (None, opt.MachineOptions().machine):
            words += [f"--{key}", str(value)]
    return shlex.join(words)


def _write_draft_map(
    files: Sequence[Path], many: bool, table: "Machine", again: str, out: Path | None, json: bool
) -> None:
    """Write a first channel map, and print the command that uses it; of many tests, by the columns of the first."""
    from ..data.importing import find_tests, guess_map, load_raw, other_columns, save_map

    raws = load_raw(find_tests(files)[0].file) if many else [raw for file in files for raw in load_raw(file)]
    full = {a.name: a.full_command for a in table.actuators if a.full_command}
    found, remarks = guess_map(raws, table.labels, table.axis_names, full)
    for test in find_tests(files)[1:] if many else ():
        try:
            differs = other_columns(raws, load_raw(test.file))
        except RecordError as error:
            differs = f"not read: {error}"
        remarks = (*remarks, differs) if differs else remarks
    path = out or Path(f"{files[0].resolve().stem}_map.toml")
    if path.exists():
        raise RecordError(f"{path}: exists and may have been edited; remove it, or name another with --out")
    save_map(found, path, remarks)
    then = f"{again} --map {shlex.quote(str(path))}"
    left = f"{len(remarks)} remark{'s' * (len(remarks) != 1)}"
    count = f"{len(found.channels)} channels, {left}; read and edit it"
    if not found.channels:
        count = f"no column was recognised, {left}; state in it which column is which channel"
    hint = f"{path}: {count}, then\n{then}"
    entries = {"channels": len(found.channels), "remarks": remarks, "then": then}
    print_result(json, lambda: entries, lambda: typer.echo(hint), [path])


def _mapped(raws: "Sequence[RawTest]", table: "Machine", map_: Path | None, file: Path) -> "ChannelMap":
    """Read the map, or for what was exported before, make it."""
    from ..data.importing import guess_map, is_export, load_map

    if map_ is None and not is_export(raws):
        raise RecordError(
            f"{file}: which column is which channel? This command with --guess writes a first map, --map uses one"
        )
    return load_map(map_) if map_ else guess_map(raws, table.labels).channels


def _import_one(files: Sequence[Path], table: "Machine", map_: Path | None, out: Path | None, json: bool) -> None:
    """Import the files of one test, and print source and range of every channel, which expose a wrong unit."""
    from ..data.campaign_check import contradicting_sensors
    from ..data.check import check_dataset
    from ..data.importing import channel_units, described_sources, load_raw, make_imported_record
    from ..data.records import save_record
    from ..show.check_tables import print_contradictions
    from ..show.results import finding_entries
    from ..show.tables import print_findings

    raws = [raw for file in files for raw in load_raw(file)]
    channels = _mapped(raws, table, map_, files[0])
    record = make_imported_record(raws, channels, table.labels, table)
    path = out or Path("out") / f"{record.attrs['test'].replace('/', '_')}.nc"
    _refuse_own(path, files)
    if path.suffix != ".nc":
        raise RecordError(f"--out {path}: a record is written, in netCDF; name it {path.stem or 'record'}.nc")
    save_record(record, path)
    sources, findings = described_sources(raws, channels), check_dataset(record, table)
    contradictions = contradicting_sensors(table, _sound([(record, findings)]))
    entries = {
        name: {"from": sources[name], "unit": unit, "least": values.min(), "most": values.max()}
        for name, unit, values in channel_units(record)
        if name in sources  # else an axis held by guides
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
        print_contradictions(contradictions)

    def all_entries() -> dict[str, Any]:
        return {**finding_entries({str(path): findings}), "contradictions": contradictions, "channels": entries}

    print_result(json, all_entries, show, [path])


def _sound(made: "Collection[tuple[xr.Dataset, Sequence[RecordFinding]]]") -> "list[xr.Dataset]":
    """Records without errors, by which redundant sensors are compared; all of them where each has one."""
    sound = [record for record, findings in made if not any(one.severity == "error" for one in findings)]
    return sound or [record for record, _ in made]


def _import_many(files: Sequence[Path], table: "Machine", map_: Path | None, out: Path | None, json: bool) -> None:
    """Import each file as a test of a campaign; one that cannot be read is passed over and said, with exit code 1."""
    from ..data.campaign_check import contradicting_sensors
    from ..data.check import check_dataset
    from ..data.importing import find_tests, load_raw, make_imported_record
    from ..data.records import save_record
    from ..show.check_tables import print_contradictions
    from ..show.results import finding_entries

    tests = find_tests(files)
    name = next((path for path in files if path.is_dir()), Path("campaign")).resolve().name
    folder = opt.folder_for(out, name, *(f"{test.name}.nc" for test in tests))
    made: dict[Path, tuple[xr.Dataset, Sequence[RecordFinding]]] = {}
    failed: dict[str, str] = {}
    for test in tests:
        path = folder / f"{test.name}.nc"
        try:
            raws = load_raw(test.file)
            channels = _mapped(raws, table, map_, test.file)
            channels = replace(channels, test=replace(channels.test, name=test.name))
            record = make_imported_record(raws, channels, table.labels, table)
            _refuse_own(path, [test.file])
        except RecordError as error:
            failed[str(test.file)] = str(error)
            continue
        save_record(record, path)
        made[path] = record, check_dataset(record, table)
    if not made:
        raise RecordError(next(iter(failed.values())))
    contradictions = contradicting_sensors(table, _sound(made.values()))

    def entries() -> dict[str, Any]:
        said = finding_entries({str(path): findings for path, (_, findings) in made.items()})
        return {**said, "contradictions": contradictions, "not imported": failed}

    def show() -> None:
        _show_many(made, failed)
        print_contradictions(contradictions)

    print_result(json, entries, show, list(made))
    if failed:
        raise typer.Exit(1)


def _show_many(made: "dict[Path, tuple[xr.Dataset, Sequence[RecordFinding]]]", failed: dict[str, str]) -> None:
    from rich.markup import escape
    from rich.table import Table

    from ..core.console import make_console
    from ..data.importing import channel_units
    from ..show.tables import print_findings

    rows = Table("test", "seconds", "samples/s", "channels", "errors", "warnings")
    for path, (record, findings) in made.items():
        time = record["time"].values
        kinds = [finding.severity for finding in findings]
        cells = [path.stem, f"{time[-1] - time[0]:.1f}", f"{record.attrs['sample_rate_hz']:g}"]
        cells += [str(len(list(channel_units(record)))), str(kinds.count("error")), str(kinds.count("warning"))]
        rows.add_row(*map(escape, cells))
    make_console().print(rows)
    for path, (_, findings) in made.items():
        if faults := [finding for finding in findings if finding.severity != "info"]:
            print_findings(str(path), faults)
    for file, why in failed.items():
        typer.echo(f"not imported: {Path(file).name}: {why}")


def _refuse_own(path: Path, files: Sequence[Path]) -> None:
    if any(path.exists() and path.samefile(file) for file in files):
        raise RecordError(f"{path}: is one of the files to import; name another with --out")
