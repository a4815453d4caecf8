"""Commands for measured data: import, export."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import RecordError
from .app import app, tell
from .options import Json, MachineName, Override, find_machine

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["export", "import_"]


@app.command("import")
def import_(
    files: Annotated[list[Path], typer.Argument(help="Data file(s) of one test.")],
    map_: Annotated[Path | None, typer.Option("--map", help="Channel map (TOML).")] = None,
    guess: Annotated[bool, typer.Option("--guess", help="Write a draft channel map to edit, and no record.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Record to write, default: out/TEST.nc; with --guess the map, default: FILE_map.toml."),
    ] = None,
    machine: MachineName = "lhpost6",
    override: Override = None,
    json: Json = False,
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
        save_map,
    )
    from ..data.records import save_record
    from ..show.results import finding_entries
    from ..show.tables import print_findings

    if guess and map_:
        raise RecordError("--guess writes a map, --map uses one; give one of them")
    table = find_machine(machine, override)
    raws = [raw for file in files for raw in load_raw(file)]
    if guess:
        found, remarks = guess_map(raws, table.labels)
        path = out or Path(f"{files[0].stem}_map.toml")
        if path.exists():
            raise RecordError(f"{path}: exists and may have been edited; remove it, or name another with --out")
        save_map(found, path, remarks)
        then = f"lhpost6 import {' '.join(map(str, files))} --map {path}"

        def hint() -> None:
            typer.echo(f"{path}: {len(found.channels)} channels, {len(remarks)} remarks; read and edit it, then")
            typer.echo(then)

        tell(json, lambda: {"channels": len(found.channels), "remarks": remarks, "then": then}, hint, [path])
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

    def show() -> None:
        _print_channels(record, sources)
        print_findings(str(path), findings)

    def entries() -> dict[str, Any]:
        channels = {
            name: {"from": sources.get(name, "derived"), "unit": unit, "least": values.min(), "most": values.max()}
            for name, unit, values in channel_units(record)
        }
        return {**finding_entries({str(path): findings}), "channels": channels}

    tell(json, entries, show, [path])


@app.command()
def export(
    record: Annotated[Path, typer.Argument(help="Record to export.")],
    to: Annotated[str, typer.Option(help="Format: csv, mat or parquet.")],
    out: Annotated[Path | None, typer.Option(help="File to write; default: beside the record.")] = None,
    json: Json = False,
) -> None:
    """Write a record as CSV, MATLAB v5 or Parquet, with the unit in every column's name."""
    from ..data.importing import FORMATS, export_record
    from ..data.records import load_record

    dataset = load_record(record)
    path = out or record.with_suffix(FORMATS.get(to, ""))
    if path.exists() and path.samefile(record):
        raise RecordError(f"{path}: is the record to export; name another file with --out")
    export_record(dataset, path, to)
    tell(json, dict, lambda: None, [path])


def _print_channels(record: "xr.Dataset", sources: dict[str, str]) -> None:
    """Print every channel with its source and range, which exposes a wrong unit."""
    from rich.markup import escape
    from rich.table import Table

    from ..core.console import make_console
    from ..data.importing import channel_units

    rows = Table("channel", "from", "unit", "least", "most", title=escape(str(record.attrs["title"])))
    for name, unit, values in channel_units(record):
        cells = (name, sources.get(name, "derived"), unit, f"{values.min():.6g}", f"{values.max():.6g}")
        rows.add_row(*map(escape, cells))
    console = make_console()
    console.print(rows)
