"""Test records: one netCDF-4 layout for measured and simulated tests, so that they can be compared.

A record is an `xarray.Dataset` over uniform `time`, SI throughout. Any channel of `LAYOUT` may be missing and
others may be added; those present must be valid: `load_record` refuses any other record.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import RecordError, UnknownNameError
from ..core.files import write_whole
from ..core.names import AXES
from .channels import LAYOUT, LAYOUT_VERSION
from .layout_faults import RecordFinding, is_number, layout_faults, sampling_rate

if TYPE_CHECKING:
    import xarray as xr

    from ..machine.machine import Machine

__all__ = [
    "FULL_SCALE",
    "DEFLATE_LIMIT",
    "STEPS",
    "is_measured",
    "load_record",
    "make_record",
    "open_record",
    "refuse_other_machine",
    "require",
    "sample_interval",
    "save_record",
    "thinned",
]

STEPS: "Mapping[int, Callable[[xr.Dataset], xr.Dataset]]" = {}
"""From each older version of the layout to the next: what is done to a record of it when it is read."""

DEFLATE_LIMIT = 5000  # no compressed netCDF unpacks to more than this (deflate 1032:1, times int16 to float64)


# ---------------------------------------------------------------------------------------------- disk
_HDF5 = b"\x89HDF\r\n\x1a\n"

FULL_SCALE = "full_scale_force"
"""Attribute of a record: force [N] at which an arrow of the viewer has its full length."""


def open_record(path: Path | str) -> "xr.Dataset":
    """Read a whole netCDF-4 file into memory without checking its content; an older layout is migrated.

    The file stays as it is. Raises `RecordError`, naming the file, if it is missing, not netCDF-4, or damaged.
    """
    import h5py
    import xarray as xr

    path = Path(path)
    _refuse_no_record(path)
    try:
        with h5py.File(path) as file:  # h5netcdf complains to the terminal of a file whose attributes are damaged
            _ = dict(file.attrs)
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # attributes that contradict their variable; overflow
            warnings.simplefilter("error", UserWarning)  # a dimension that a variable has twice
            warnings.simplefilter("ignore", FutureWarning)  # labels in half precision
            with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as lazy:
                if lazy.nbytes > DEFLATE_LIMIT * path.stat().st_size:
                    raise RecordError(f"claims {lazy.nbytes / 1e9:.3g} GB, more than so small a file can hold")
                return _brought_up(lazy.load())
    except Exception as error:  # a damaged file makes HDF5 raise nearly anything
        raise RecordError(
            f"{path}: not a netCDF-4 (HDF5) file, or damaged: {error}; make or export the record again"
        ) from error


def _refuse_no_record(path: Path) -> None:
    """Raise `RecordError` for a directory, a missing file, and one without the first bytes of HDF5."""
    imported = "`lhpost6 import` makes records of measured data (CSV, .mat, ...)"
    if path.is_dir():
        within = sorted(path.glob("*.nc"))
        what = f"; name one record of it, such as {within[0]}" if within else f" without records (.nc); {imported}"
        raise RecordError(f"{path}: is a directory{what}")
    if not path.is_file():
        raise RecordError(f"{path}: no such file")
    with suppress(OSError), path.open("rb") as file:  # what cannot be read is an error of opening it
        if file.read(len(_HDF5)) != _HDF5:
            raise RecordError(f"{path}: not a netCDF-4 (HDF5) file; {imported}")


def _brought_up(dataset: "xr.Dataset") -> "xr.Dataset":
    """A record in the current layout; a missing or unknown version is left to `layout_faults`.

    A force that an earlier import computed from pressures is left out: it is no sensor of its own.
    """
    if "actuator_force" in str(dataset.attrs.pop("derived", "")):
        dataset = dataset.drop_vars("actuator_force", errors="ignore")
    stated = dataset.attrs.get("layout_version", LAYOUT_VERSION)
    for version in range(int(stated) if is_number(stated) and stated >= 1 else LAYOUT_VERSION, LAYOUT_VERSION):
        dataset = STEPS[version](dataset).assign_attrs(layout_version=version + 1, written_in_layout=stated)
    return dataset


def load_record(path: Path | str, labels: Mapping[str, Sequence[str]] | None = None) -> "xr.Dataset":
    """Load a valid record; channels of the layout are float64.

    `labels` are those of the machine the record must belong to, e.g. `{"actuator": ["H1", ...]}`; without it
    any machine is accepted. Raises `RecordError` naming file, channel and sample of whatever breaks the layout.
    """
    dataset = open_record(path)
    _refuse(layout_faults(dataset, labels), str(path))
    return dataset.assign({name: dataset[name].astype(float) for name in LAYOUT if name in dataset})


def save_record(dataset: "xr.Dataset", path: Path | str, *, single: bool = False) -> None:
    """Write a record whole or not at all, uncompressed, in float64 or, where `single`, in float32 but for its time.

    Noise-free motion hardly compresses (15 % smaller with deflate) and takes ten times as long to write. The 24 bits
    of float32 are those of the best converters of sensors.
    Raises `RecordError` if the dataset breaks the layout.
    """
    from .netcdf import netcdf_content

    _refuse(layout_faults(dataset), str(path))
    content = netcdf_content(dataset.drop_encoding(), single=single)
    with write_whole(path) as beside:
        beside.write_bytes(content)


def make_record(
    time: ArrayLike,
    channels: Mapping[str, Any],
    labels: Mapping[str, Sequence[str]],
    attrs: Mapping[str, Any],
) -> "xr.Dataset":
    """Put arrays into the layout, with its units and long names.

    Parameters: `time` (n,) [s]; `channels` arrays by name of the layout, or `(dims, values, attributes)` for
    any further variable; `labels` of the dimensions in use (`axis` is known); `attrs` global attributes, to
    which `sample_rate_hz` and `layout_version` are added. Raises `RecordError` if that breaks the layout,
    `UnknownNameError` for a plain array under a name that the layout does not have.
    """
    import pandas as pd
    import xarray as xr

    time = np.asarray(time, dtype=float)
    variables: dict[str, xr.Variable] = {}
    for name, values in channels.items():
        if isinstance(values, tuple):
            variables[name] = _variable(*values)
        elif name not in LAYOUT:
            raise UnknownNameError("channel of the record layout", name, list(LAYOUT))
        else:
            channel, values = LAYOUT[name], np.asarray(values, dtype=float)
            if values.ndim != len(channel.dims):
                raise RecordError(f"{name}: has shape {values.shape}; the layout has dimensions {channel.dims}")
            about = {"units": channel.units, "long_name": channel.long_name}
            variables[name] = _variable(channel.dims, values, about)
    used = {dim for variable in variables.values() for dim in variable.dims}
    # as indexes: to make them of arrays, xarray would import pint, which takes longer than all else here
    names = {
        dim: pd.Index(list(values), dtype=object)
        for dim, values in ({"axis": AXES} | dict(labels)).items()
        if dim in used
    }
    try:
        record = xr.Dataset(variables, {"time": ("time", pd.Index(time), {"units": "s", "long_name": "time"})} | names)
    except ValueError as error:
        raise RecordError(f"channels, labels and time do not fit together: {error}") from error
    if len(time) > 1 and time[-1] > time[0]:  # the rate to nine figures, so that 2048 Hz reads 2048
        record.attrs["sample_rate_hz"] = float(f"{sampling_rate(time):.9g}")
    record.attrs |= dict(attrs) | {"layout_version": LAYOUT_VERSION}
    _refuse(layout_faults(record), "record")
    return record


def thinned(record: "xr.Dataset", every: int) -> "xr.Dataset":
    """Every `every`-th sample of a record, unfiltered; all samples of one too short to keep two.

    Its attribute `thinned_from_hz` is the rate before.
    """
    if every == 1 or record.sizes["time"] <= every:
        return record
    kept = record.isel(time=slice(None, None, every))
    before = record.attrs.get("thinned_from_hz", record.attrs["sample_rate_hz"])
    rate = float(f"{sampling_rate(kept['time'].values):.9g}")
    return kept.assign_attrs(sample_rate_hz=rate, thinned_from_hz=before)  # a copy: both may share their attributes


def _variable(dims: Any, values: ArrayLike, attrs: Mapping[str, Any] | None = None) -> "xr.Variable":
    """Variable of plain numbers, which xarray need not compare with the arrays of Dask, which it would import."""
    import xarray as xr

    return xr.Variable(dims, np.asarray(values), attrs, fastpath=True)


def sample_interval(dataset: "xr.Dataset") -> float:
    """Time from one sample to the next [s]."""
    time = dataset["time"].values
    return float(time[-1] - time[0]) / (len(time) - 1)


def is_measured(dataset: "xr.Dataset") -> bool:
    """Whether sensors stand between a record and its motion: real ones, or the noise of simulated ones."""
    return str(dataset.attrs.get("kind")) != "simulated" or "noise" in dataset.attrs


def require(dataset: "xr.Dataset", *names: str) -> None:
    """Raise `RecordError` naming those of `names` that the record does not have."""
    missing = [name for name in names if name not in dataset.variables]
    if missing:
        file = dataset.encoding.get("source", "the record")
        raise RecordError(f"{file}: has no {', '.join(missing)}; it has {', '.join(map(str, dataset.data_vars))}")


def refuse_other_machine(machine: "Machine", dataset: "xr.Dataset") -> None:
    """Raise `RecordError` for a record whose components are not those of a machine."""
    for dim, names in machine.labels.items():
        if dim in dataset.coords and [str(x) for x in dataset[dim].values] != list(names):
            raise RecordError(
                f"{dataset.encoding.get('source', 'the record')}: has {dim}s "
                f"{' '.join(map(str, dataset[dim].values))}, {machine.name} has {' '.join(names)}; name its machine "
                "with --machine"
            )


def _refuse(faults: Sequence[RecordFinding], source: str) -> None:
    """Raise the first few faults as one `RecordError`."""
    if faults:
        more = f"; and {len(faults) - 3} more fault{'s' * (len(faults) != 4)}" * (len(faults) > 3)
        raise RecordError(f"{source}: " + "; ".join(map(str, faults[:3])) + more)
