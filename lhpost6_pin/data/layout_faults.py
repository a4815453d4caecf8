"""Violations of the record layout, as findings with place and remedy."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from ..core.names import AXES
from ..machine.parameters import LARGEST, unusable
from .channels import LAYOUT, LAYOUT_VERSION, Channel, channel_name, columns_of, same_unit

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FASTEST", "SLOWEST", "STEP_TOLERANCE", "RecordFinding", "is_number", "layout_faults", "sampling_rate"]

STEP_TOLERANCE = 0.01  # of one sample: how far a time stamp may be from its place
RATE_TOLERANCE = 1e-4  # relative: 2 ms over 20 s, the least that would spoil a comparison of two records
SLOWEST, FASTEST = 0.1, 1e6  # [Hz]: a test at another rate has its time in another unit


@dataclass(frozen=True)
class RecordFinding:
    """One finding of a record: place, what it is, and remedy.

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


_Fault = tuple[str, int | None, str, str]  # channel, sample, message, remedy


def layout_faults(dataset: "xr.Dataset", labels: Mapping[str, Sequence[str]] | None = None) -> list[RecordFinding]:
    """All violations of the layout by a dataset; empty for a valid record."""
    faults = chain(
        _time_faults(dataset),
        _label_faults(dataset, labels or {}),
        *(_channel_faults(dataset[name], channel) for name, channel in LAYOUT.items() if name in dataset),
        _attribute_faults(dataset),
    )
    return [RecordFinding("error", *fault) for fault in faults]


def _time_faults(dataset: "xr.Dataset") -> Iterator[_Fault]:
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
    elif not SLOWEST <= (rate := sampling_rate(time)) <= FASTEST:
        yield "time", None, f"runs at {rate:g} Hz, outside any test's range", "give time in seconds"
    else:
        stated = dataset.attrs.get("sample_rate_hz", rate)
        if not (is_number(stated) and abs(stated / rate - 1) <= RATE_TOLERANCE):
            yield "time", None, f"runs at {rate:g} Hz, sample_rate_hz is {stated}", "correct the wrong one"


def sampling_rate(time: NDArray[np.float64]) -> float:
    """Samples a second; infinite for times that coincide."""
    with np.errstate(over="ignore", divide="ignore"):
        return float((len(time) - 1) / (time[-1] - time[0]))


def _label_faults(dataset: "xr.Dataset", wanted: Mapping[str, Sequence[str]]) -> Iterator[_Fault]:
    have: dict[str, list[str]] = {}
    for dim in ("axis", "actuator", "horizontal", "strut", "floor"):
        if dim in dataset.coords:
            have[dim] = [str(label) for label in np.atleast_1d(dataset[dim].values)]
        elif dim in dataset.dims:
            yield dim, None, "has no labels", f"add the coordinate {dim!r}"
    for dim, names in have.items():
        right = list(AXES if dim == "axis" else wanted.get(dim, _numbered(names)))
        if names != right:
            what = f"has labels {' '.join(names)}"
            if not right:
                yield dim, None, f"{what}, and the machine has none", "name the record's own machine with --machine"
                continue
            remedy = f"they must be {' '.join(right)}, in this order"
            other = dim in wanted and not set(names) <= set(right)
            yield dim, None, what, remedy + ", or name its machine with --machine" * other
        elif len(set(names)) < len(names):
            yield dim, None, f"has labels that repeat: {' '.join(names)}", "give each its own"
    some, every = have.get("horizontal", []), have.get("actuator", have.get("horizontal", []))
    if some != [name for name in every if name in some]:
        yield "horizontal", None, f"has labels {' '.join(some)}", f"take them in order from {' '.join(every)}"


def _channel_faults(variable: "xr.DataArray", channel: Channel) -> Iterator[_Fault]:
    name = str(variable.name)
    if variable.dims != channel.dims:
        yield name, None, f"has dimensions {variable.dims}", f"they must be {channel.dims}"
        return
    if variable.dtype.kind not in "fiu":
        yield name, None, f"holds {variable.dtype}", "store real numbers"
        return
    if not same_unit(units := variable.attrs.get("units"), channel.units):
        what = "has no units" if units is None else f"has units {units!r}"
        yield name, None, what, f"give it in {channel.units!r}, with the attribute units"
    if not variable.size:
        yield name, None, "is empty", "leave it out"
        return
    values = columns_of(variable)
    if -LARGEST <= values.min() and values.max() <= LARGEST:
        return
    bad = ~(np.abs(values) <= LARGEST)  # NaN is not either
    for column in np.flatnonzero(bad.any(axis=0)):
        sample = int(np.argmax(bad[:, column]))
        what = f"is {unusable(values[sample, column])} in {bad[:, column].sum()} samples"
        yield channel_name(variable, int(column)), sample, what, "fill the gap or cut the record there"


def _attribute_faults(dataset: "xr.Dataset") -> Iterator[_Fault]:
    for key in ("kind", "test", "title", "specimen", "machine", "scheme", "controller", "motion", "drive"):
        if not isinstance(text := dataset.attrs.get(key, ""), str) or "\0" in text:
            yield "", None, f"attribute {key} is {text!r}", "it must be a text"
    if not is_number(steps := dataset.attrs.get("steps_per_second", 1)):
        yield "", None, f"attribute steps_per_second is {steps!r}", "it must be a number"
    valves = dataset.attrs.get("valves_per_horizontal_actuator", 1)
    if not (is_number(valves) and valves in (1, 2)):
        yield "", None, f"attribute valves_per_horizontal_actuator is {valves}", "it must be 1 or 2"
    version = dataset.attrs.get("layout_version", LAYOUT_VERSION)
    if not (is_number(version) and 1 <= version <= LAYOUT_VERSION):
        yield "", None, f"attribute layout_version is {version}", f"known are 1 to {LAYOUT_VERSION}: update"


def _numbered(names: Sequence[str]) -> list[str]:
    """Sort labels by number within each family of letters, families in the order in which they first come."""
    family = [name.rstrip("0123456789") for name in names]
    number = [int(name[len(letters) :] or 0) for name, letters in zip(names, family, strict=True)]
    return [names[k] for k in sorted(range(len(names)), key=lambda k: (family.index(family[k]), number[k]))]


def is_number(value: object) -> bool:
    """Whether a value is one finite number."""
    return isinstance(value, int | float | np.integer | np.floating) and bool(np.isfinite(value))
