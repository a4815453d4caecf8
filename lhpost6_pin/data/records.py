"""Test records: one netCDF-4 layout for measured and simulated tests, so that one can be laid over the other.

A record is an `xarray.Dataset` over uniform `time`, SI throughout. Any channel of `LAYOUT` may be missing and
others may be added; what is there must be right: `load_record` refuses a record that is not.
"""

import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, Literal, NamedTuple

import h5py
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..core.errors import RecordError, UnknownNameError
from ..core.files import write_whole
from ..core.names import AXES
from ..machine.parameters import LARGEST, unusable

__all__ = [
    "AXES",
    "LAYOUT",
    "LAYOUT_VERSION",
    "Channel",
    "Finding",
    "channel_name",
    "is_measured",
    "layout_faults",
    "load_record",
    "make_record",
    "open_record",
    "require",
    "same_unit",
    "sample_interval",
    "save_record",
]

LAYOUT_VERSION = 1
"""Of the layout below. A change that older records do not follow (of a name, unit or sign) counts it up."""

STEPS: Mapping[int, Callable[[xr.Dataset], xr.Dataset]] = {}
"""From each older version to the next: what is done to a record of it when it is read."""

STEP_TOLERANCE = 0.01  # of one sample: how far a time stamp may be from its place
RATE_TOLERANCE = 1e-4  # relative: 2 ms over 20 s, the least that would spoil a comparison of two records
SLOWEST, FASTEST = 0.1, 1e6  # [Hz]: a test at another rate has its time in another unit
DEFLATE_LIMIT = 5000  # no compressed netCDF unpacks to more than this (deflate 1032:1, times int16 to float64)


class Channel(NamedTuple):
    """One variable of the layout: its dimensions, unit, meaning, and the jobs that cannot do without it."""

    dims: tuple[str, ...]
    units: str  # "translations, rotations" where the last dimension is `axis`
    long_name: str
    needed_by: tuple[str, ...] = ()


_AXIS, _ACTUATOR = ("time", "axis"), ("time", "actuator")
_INVERSE, _OPEN = ("inverse dynamics",), ("open loop",)

LAYOUT: Mapping[str, Channel] = {
    "platen_displacement": Channel(_AXIS, "m, rad", "position of C in {s}; Euler angles", _INVERSE),
    "platen_velocity": Channel(_AXIS, "m/s, rad/s", "velocity of C in {s}; Euler angle rates"),
    "platen_acceleration": Channel(
        _AXIS, "m/s2, rad/s2", "acceleration of C in {s} without gravity; Euler angle accelerations", _INVERSE
    ),
    "actuator_displacement": Channel(_ACTUATOR, "m", "actuator length minus its length in the zero pose"),
    "actuator_force": Channel(_ACTUATOR, "N", "actuator force P_A A_1 - P_B A_2", _INVERSE),
    "chamber_pressure_a": Channel(_ACTUATOR, "Pa", "pressure in chamber A", _OPEN),
    "chamber_pressure_b": Channel(("time", "horizontal"), "Pa", "pressure in chamber B", _OPEN),
    "strut_pressure": Channel(("time", "strut"), "Pa", "nitrogen pressure of the hold-down strut"),
    "spool_command": Channel(_ACTUATOR, "1", "normalised fourth-stage spool command"),
    "spool_position": Channel(_ACTUATOR, "1", "normalised fourth-stage spool position", _OPEN),
    "supply_pressure": Channel(("time",), "Pa", "supply pressure"),
    "reference_displacement": Channel(_AXIS, "m, rad", "displacement the test asked for"),
}


@dataclass(frozen=True)
class Finding:
    """One thing found in a record: where it is, what it is and what to do about it.

    `channel` is a variable with its label, as in `platen_displacement[yaw]`, or empty for the whole record.
    """

    severity: Literal["error", "warning", "info"]
    channel: str
    sample: int | None
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        """`channel, sample 12: message (remedy)`."""
        place = ", ".join([self.channel] * bool(self.channel) + [f"sample {self.sample}"] * (self.sample is not None))
        return f"{place}: " * bool(place) + self.message + f" ({self.remedy})" * bool(self.remedy)


# ---------------------------------------------------------------------------------------------- disk
def open_record(path: Path | str) -> xr.Dataset:
    """Read a whole netCDF-4 file into memory without judging its content; an older layout is brought to today's.

    The file stays as it is. Raises `RecordError`, naming the file, if it is missing, not netCDF-4, or damaged.
    """
    path = Path(path)
    if not path.is_file():
        raise RecordError(f"{path}: no such file")
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


def _brought_up(dataset: xr.Dataset) -> xr.Dataset:
    """A record in today's layout; what says no version, or none that is known, is left for `layout_faults`."""
    said = dataset.attrs.get("layout_version", LAYOUT_VERSION)
    for version in range(int(said) if _is_number(said) and said >= 1 else LAYOUT_VERSION, LAYOUT_VERSION):
        dataset = STEPS[version](dataset).assign_attrs(layout_version=version + 1, written_in_layout=said)
    return dataset


def load_record(path: Path | str, labels: Mapping[str, Sequence[str]] | None = None) -> xr.Dataset:
    """Load a record and make sure that it is right; channels of the layout come as float64.

    `labels` are those of the machine the record must belong to, e.g. `{"actuator": ["H1", ...]}`; without it
    any machine will do. Raises `RecordError` naming file, channel and sample of whatever breaks the layout.
    """
    dataset = open_record(path)
    _refuse(layout_faults(dataset, labels), str(path))
    return dataset.assign({name: dataset[name].astype(float) for name in LAYOUT if name in dataset})


def save_record(dataset: xr.Dataset, path: Path | str) -> None:
    """Write a record whole or not at all, in float64 and uncompressed.

    Noise-free motion hardly compresses (15 % smaller with deflate) and takes ten times as long to write.
    Raises `RecordError` if the dataset breaks the layout.
    """
    _refuse(layout_faults(dataset), str(path))
    plain = dataset.drop_encoding()
    encoding = {name: {"_FillValue": None} for name in plain.data_vars}
    # through memory: HDF5 that meets a full disk crashes the process when it closes
    with write_whole(path) as beside, memoryview(plain.to_netcdf(engine="h5netcdf", encoding=encoding)) as content:
        beside.write_bytes(content)


def make_record(
    time: ArrayLike,
    channels: Mapping[str, Any],
    labels: Mapping[str, Sequence[str]],
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """Put arrays into the layout, with its units and long names.

    Parameters: `time` (n,) [s]; `channels` arrays by name of the layout, or `(dims, values, attributes)` for
    any further variable; `labels` of the dimensions in use (`axis` is known); `attrs` global attributes, to
    which `sample_rate_hz` and `layout_version` are added. Raises `RecordError` if that breaks the layout,
    `UnknownNameError` for a plain array under a name that the layout does not have.
    """
    time = np.asarray(time, dtype=float)
    variables = {}
    for name, values in channels.items():
        if isinstance(values, tuple):
            variables[name] = values
        elif name not in LAYOUT:
            raise UnknownNameError("channel of the record layout", name, list(LAYOUT))
        else:
            dims, units, long_name, _ = LAYOUT[name]
            values = np.asarray(values, dtype=float)
            if values.ndim != len(dims):
                raise RecordError(f"{name}: has shape {values.shape}; the layout wants dimensions {dims}")
            variables[name] = (dims, values, {"units": units, "long_name": long_name})
    used = {dim for dims, *_ in variables.values() for dim in ([dims] if isinstance(dims, str) else dims)}
    names = {dim: list(values) for dim, values in ({"axis": AXES} | dict(labels)).items() if dim in used}
    try:
        record = xr.Dataset(variables, {"time": ("time", time, {"units": "s", "long_name": "time"})} | names)
    except ValueError as error:
        raise RecordError(f"channels, labels and time do not fit together: {error}") from error
    if len(time) > 1 and time[-1] > time[0]:  # the rate to nine figures, so that 2048 Hz reads 2048
        record.attrs["sample_rate_hz"] = float(f"{_rate(time):.9g}")
    record.attrs |= dict(attrs) | {"layout_version": LAYOUT_VERSION}
    _refuse(layout_faults(record), "record")
    return record


def sample_interval(dataset: xr.Dataset) -> float:
    """Time from one sample to the next [s]."""
    time = dataset["time"].values
    return float(time[-1] - time[0]) / (len(time) - 1)


def is_measured(dataset: xr.Dataset) -> bool:
    """Whether sensors stand between a record and its motion: real ones, or the noise of simulated ones."""
    return dataset.attrs.get("kind") != "simulated" or "noise" in dataset.attrs


def require(dataset: xr.Dataset, *names: str) -> None:
    """Raise `RecordError` naming those of `names` that the record does not have."""
    missing = [name for name in names if name not in dataset.variables]
    if missing:
        file = dataset.encoding.get("source", "the record")
        raise RecordError(f"{file}: has no {', '.join(missing)}; it has {', '.join(map(str, dataset.data_vars))}")


def _refuse(faults: Sequence[Finding], source: str) -> None:
    """Raise the first few faults as one `RecordError`."""
    if faults:
        more = f"; and {len(faults) - 3} more faults" * (len(faults) > 3)
        raise RecordError(f"{source}: " + "; ".join(map(str, faults[:3])) + more)


# -------------------------------------------------------------------------------------------- validity
_Fault = tuple[str, int | None, str, str]  # channel, sample, message, remedy


def layout_faults(dataset: xr.Dataset, labels: Mapping[str, Sequence[str]] | None = None) -> list[Finding]:
    """List everything in which a dataset breaks the layout; empty for a valid record."""
    faults = chain(
        _time_faults(dataset),
        _label_faults(dataset, labels or {}),
        *(_channel_faults(dataset[name], channel) for name, channel in LAYOUT.items() if name in dataset),
        _attribute_faults(dataset),
    )
    return [Finding("error", *fault) for fault in faults]


def _time_faults(dataset: xr.Dataset) -> Iterator[_Fault]:
    if "time" not in dataset.variables:
        yield "time", None, "is missing", "add a uniform time coordinate in seconds"
        return
    time = dataset["time"].values
    if dataset["time"].dims != ("time",) or time.dtype.kind not in "fiu" or len(time) < 2:
        yield "time", None, "is not a row of at least two numbers", "give one time in seconds per sample"
        return
    if not same_unit(units := dataset["time"].attrs.get("units", "s"), "s"):
        yield "time", None, f"has units {units!r}", "give time in s"
    time = time.astype(float)
    if not (usable := np.abs(time) <= LARGEST).all():  # NaN is none of them either
        yield "time", int(np.argmin(usable)), "is not a number", "give one time per sample"
        return
    step = np.diff(time)
    usual = float(np.median(step))
    if (step <= 0).any():
        k = int(np.argmax(step <= 0)) + 1
        yield "time", k, f"does not increase: {time[k]:g} s after {time[k - 1]:g} s", "sort or cut the record"
    elif (uneven := np.abs(step - usual) > STEP_TOLERANCE * usual).any():
        k = int(np.argmax(uneven)) + 1
        lost = round(step[k - 1] / usual) - 1
        what = f"a gap of {lost} missing samples" if lost > 0 else f"a step of {step[k - 1]:g} s"
        yield "time", k, f"is not uniform: {what} where {usual:g} s is usual", "resample to a uniform rate"
    elif not SLOWEST <= (rate := _rate(time)) <= FASTEST:
        yield "time", None, f"runs at {rate:g} Hz, which no test does", "give time in seconds"
    else:
        stated = dataset.attrs.get("sample_rate_hz", rate)
        if not (_is_number(stated) and abs(stated / rate - 1) <= RATE_TOLERANCE):
            yield "time", None, f"runs at {rate:g} Hz, sample_rate_hz says {stated}", "correct the wrong one"


def _rate(time: NDArray[np.float64]) -> float:
    """Samples a second; infinite for times too close to tell apart."""
    with np.errstate(over="ignore", divide="ignore"):
        return float((len(time) - 1) / (time[-1] - time[0]))


def _label_faults(dataset: xr.Dataset, wanted: Mapping[str, Sequence[str]]) -> Iterator[_Fault]:
    have: dict[str, list[str]] = {}
    for dim in ("axis", "actuator", "horizontal", "strut"):
        if dim in dataset.coords:
            have[dim] = [str(label) for label in np.atleast_1d(dataset[dim].values)]
        elif dim in dataset.dims:
            yield dim, None, "has no labels", f"add the coordinate {dim!r}"
    for dim, names in have.items():
        right = list(AXES if dim == "axis" else wanted.get(dim, _numbered(names)))
        if names != right:
            yield dim, None, f"has labels {' '.join(names)}", f"they must be {' '.join(right)}, in this order"
        elif len(set(names)) < len(names):
            yield dim, None, f"has labels that repeat: {' '.join(names)}", "give each its own"
    some, every = have.get("horizontal", []), have.get("actuator", have.get("horizontal", []))
    if some != [name for name in every if name in some]:
        yield "horizontal", None, f"has labels {' '.join(some)}", f"take them in order from {' '.join(every)}"


def _channel_faults(variable: xr.DataArray, channel: Channel) -> Iterator[_Fault]:
    name = str(variable.name)
    if variable.dims != channel.dims:
        yield name, None, f"has dimensions {variable.dims}", f"they must be {channel.dims}"
        return
    if variable.dtype.kind not in "fiu":
        yield name, None, f"holds {variable.dtype}", "store real numbers"
        return
    if not same_unit(units := variable.attrs.get("units"), channel.units):
        what = "has no units" if units is None else f"has units {units!r}"
        yield name, None, what, f"give it in {channel.units!r} and say so in its attribute units"
    if not variable.size:
        yield name, None, "is empty", "leave it out"
        return
    values = variable.values.reshape(len(variable), -1).astype(float)
    bad = ~(np.abs(values) <= LARGEST)  # NaN is not either
    for column in np.flatnonzero(bad.any(axis=0)):
        sample = int(np.argmax(bad[:, column]))
        what = f"is {unusable(values[sample, column])} in {bad[:, column].sum()} samples"
        yield channel_name(variable, int(column)), sample, what, "fill the gap or cut the record there"


def _attribute_faults(dataset: xr.Dataset) -> Iterator[_Fault]:
    for key in ("kind", "test", "title", "specimen", "machine", "scheme", "controller", "motion", "drive"):
        if not isinstance(said := dataset.attrs.get(key, ""), str) or "\0" in said:
            yield "", None, f"attribute {key} is {said!r}", "it must be a text"
    if not _is_number(steps := dataset.attrs.get("steps_per_second", 1)):
        yield "", None, f"attribute steps_per_second is {steps!r}", "it must be a number"
    valves = dataset.attrs.get("valves_per_horizontal_actuator", 1)
    if not (_is_number(valves) and valves in (1, 2)):
        yield "", None, f"attribute valves_per_horizontal_actuator is {valves}", "it must be 1 or 2"
    version = dataset.attrs.get("layout_version", LAYOUT_VERSION)
    if not (_is_number(version) and 1 <= version <= LAYOUT_VERSION):
        yield "", None, f"attribute layout_version is {version}", f"known are 1 to {LAYOUT_VERSION}: update"


def channel_name(variable: xr.DataArray, column: int) -> str:
    """Name of one column of a variable, as in `platen_displacement[yaw]`."""
    if variable.ndim < 2:
        return str(variable.name)
    dim = variable.dims[1]
    return f"{variable.name}[{variable[dim].values[column] if dim in variable.coords else column}]"


def same_unit(units: object, wanted: str) -> bool:
    """Whether two unit strings mean the same: `m/s2`, `m s-2`, `meter/second**2` do, `mm` and `m` do not."""
    if not isinstance(units, str):
        return False
    if units == wanted:
        return True
    ours, theirs = ([_spelled(part) for part in text.split(",")] for text in (units, wanted))
    if len(ours) != len(theirs) or not all(ours):
        return False
    ureg = _unit_registry()
    try:
        pairs = zip(ours, theirs, strict=True)
        return all(math.isclose(ureg.Quantity(1.0, a).to(b).magnitude, 1.0, rel_tol=1e-9) for a, b in pairs)
    except Exception:  # pint raises its own, token and type errors for what is not a unit
        return False


def _spelled(units: str) -> str:
    """Return units with exponents in Python's manner; empty if not simply a product of named units."""
    units = re.sub(r"(?<=[^\W\d_])\s?(\^|\*\*)?(?=-?\d)", "**", units.strip()).replace("·", "*")
    units = {"": "1", "-": "1"}.get(units, units)
    return units if re.fullmatch(r"(1|[^\W\d_]+(\*\*-?\d)?)(\s?[ */]\s?[^\W\d_]+(\*\*-?\d)?)*", units) else ""


@cache
def _unit_registry() -> Any:
    import pint  # takes 0.2 s: only where a unit is not spelled as in the layout

    return pint.UnitRegistry()


def _numbered(names: Sequence[str]) -> list[str]:
    """Sort labels by number within each family of letters, families in the order in which they first come."""
    family = [name.rstrip("0123456789") for name in names]
    number = [int(name[len(letters) :] or 0) for name, letters in zip(names, family, strict=True)]
    return [names[k] for k in sorted(range(len(names)), key=lambda k: (family.index(family[k]), number[k]))]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and bool(np.isfinite(value))
