"""Records as CSV, MATLAB v5 and Parquet: a column a channel, its unit in its name, and the attributes beside them."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...core.errors import RecordError, UnknownNameError
from ...core.files import write_whole
from ..channels import LAYOUT_VERSION, channel_name, column_units, columns_of
from ..layout_faults import layout_faults
from .raw import need_package
from .raw_files import load_raw

__all__ = ["FORMATS", "channel_units", "export_record", "refuse_what_is_no_export"]

FORMATS = {"csv": ".csv", "mat": ".mat", "parquet": ".parquet"}
"""Formats and their suffixes."""


def channel_units(record: xr.Dataset) -> Iterator[tuple[str, str, Array]]:
    """Every numeric column along time: its channel, as in `platen_displacement[x]`, unit, and values (n,)."""
    for variable in record.data_vars.values():
        if variable.dims[:1] != ("time",) or variable.ndim > 2 or variable.dtype.kind not in "fiu":
            continue
        for k, (unit, values) in enumerate(zip(column_units(variable), columns_of(variable).T, strict=True)):
            yield channel_name(variable, k), unit or "-", values


def refuse_what_is_no_export(path: Path) -> None:
    """Raise RecordError if a file is there that was not written by `export_record`: a laboratory's own data."""
    if not path.exists():
        return
    with suppress(RecordError):
        if all("layout_version" in raw.facts for raw in load_raw(path)):
            return
    raise RecordError(f"{path}: is there and is no earlier export; name another file with --out, or remove it first")


def export_record(record: xr.Dataset, path: Path | str, form: str) -> None:
    """Write a record as `csv`, `mat` or `parquet`, whole or not at all; all three import again without a map.

    In a `.mat` file a column is a variable `platen_displacement_x_m`, as a MATLAB name can hold no brackets, and the
    attributes are the struct `facts`. Variables that are not along time are left out. Raises RecordError for a
    dataset that is no record, or a file named as one of another format; UnknownNameError for another format.
    """
    if form not in FORMATS:
        raise UnknownNameError("format to export to", form, list(FORMATS))
    if Path(path).suffix.lower() != FORMATS[form]:
        raise RecordError(f"{path}: the name of a file of format {form} ends in {FORMATS[form]}")
    if faults := layout_faults(record):
        raise RecordError(f"{path}: cannot export what is no record: {faults[0]}")
    columns = {"time [s]": record["time"].values.astype(float)}
    for channel, unit, values in channel_units(record):
        columns[f"{channel.replace('[', '_').rstrip(']')} [{unit}]"] = values
    if form == "parquet":
        need_package("pyarrow", f"{path}: writing Parquet")
    if form == "mat":
        columns = {_matlab_name(name): values for name, values in columns.items()}
        if long := next((name for name in columns if len(name) > 63), None):
            what = f"{long} is longer than the 63 characters of a MATLAB name"
            raise RecordError(f"{path}: {what}; export to csv or parquet")
    facts = {"layout_version": str(LAYOUT_VERSION)}
    facts |= {str(key): " ".join(str(value).split()) for key, value in record.attrs.items()}
    with write_whole(path) as beside:
        {"csv": _write_csv, "mat": _write_mat, "parquet": _write_parquet}[form](columns, facts, beside)


def _write_csv(columns: dict[str, Array], facts: dict[str, str], path: Path) -> None:
    rows = np.column_stack(list(columns.values())).tolist()
    with path.open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {key}: {value}\n" for key, value in facts.items())
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)  # digits enough to give every bit back


def _write_parquet(columns: dict[str, Array], facts: dict[str, str], path: Path) -> None:
    import pandas as pd

    table = pd.DataFrame(columns)
    table.attrs = facts
    table.to_parquet(path, index=False)


def _write_mat(columns: dict[str, Array], facts: dict[str, str], path: Path) -> None:
    from scipy.io import savemat

    named: dict[str, Any] = {name: values.reshape(-1, 1) for name, values in columns.items()}
    savemat(path, named | {"facts": facts}, long_field_names=True)


def _matlab_name(name: str) -> str:
    """`platen_acceleration_x [m/s2]` as `platen_acceleration_x_m_s2`; what has no unit is a `_fraction`."""
    stem, unit = name.removesuffix("]").rsplit(" [", 1)
    tail = "".join(c if c.isalnum() else "_" for c in unit).strip("_") if unit != "1" else "fraction"
    return f"{stem}_{tail}"
