"""Drive files: results of online iteration, to be replayed later with the same settings.

A drive file is netCDF-4 with `drive` (time, axis), the input of the reference generators, its `mode`, and the target
motion (`wanted_displacement`, `wanted_velocity`, `wanted_acceleration`).
"""

import logging
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ..control.filters import MODES
from ..core.arrays import Array
from ..core.errors import RecordError
from ..core.files import write_whole
from ..core.names import AXES, SAMPLE_RATE
from ..data.records import open_record
from ..machine.machine import Machine
from ..machine.parameters import LARGEST, unusable
from ..motions import Reference, Target

__all__ = ["Drive", "check_circumstances", "circumstances", "load_drive", "save_drive", "scaled_drive", "scaled_target"]

log = logging.getLogger(__name__)

_UNITS = {"acceleration": "m/s2, rad/s2", "velocity": "m/s, rad/s", "displacement": "m, rad"}
_REFERENCE = {
    **{name: name for name in ("motion", "source", "scale", "time_scale")},
    **{"high_pass": "high_pass_hz", "low_pass": "low_pass_hz", "start": "start_s"},
}
"""Attributes of a drive file by the field of `Reference`; `axes` is another."""


class Drive(NamedTuple):
    """A drive and its target."""

    values: Array  # (n, 6) in the quantity of `mode`
    mode: str
    target: Target
    attrs: Mapping[str, Any]


def circumstances(machine: Machine, controller: str) -> dict[str, str]:
    """Conditions in which a drive or an inverse is valid: machine, specimen, open servovalves, name of the settings."""
    return {
        "machine": machine.name,
        "specimen": machine.mounted,
        "servovalves": str(sum(a.valves for a in machine.actuators)),
        "controller": controller,
    }


def check_circumstances(origin: str, made_with: Mapping[str, Any], machine: Machine, controller: str) -> None:
    """Raise RecordError, naming the `origin`, for a file made on another machine; log warnings of other differences.

    Conditions missing in `made_with` are not compared.
    """
    now = circumstances(machine, controller)
    differs = {key: str(made_with[key]) for key, value in now.items() if str(made_with.get(key, value)) != value}
    if "machine" in differs:
        raise RecordError(
            f"{origin}: was made on {differs['machine']}, not on {now['machine']}; choose --machine, or make it again"
        )
    for key, value in differs.items():
        log.warning("%s: was made with %s %s, this run has %s", origin, key, value, now[key])


def save_drive(values: Array, mode: str, target: Target, path: Path, attrs: Mapping[str, Any]) -> Path:
    """Write a drive (n, 6) and its target, whole or not at all; attrs describe its origin."""
    about = f"drive of the reference generators in {mode} mode, x y z roll pitch yaw"
    data = {"drive": (("time", "axis"), values, {"units": _UNITS[mode], "long_name": about})}
    for name, unit in _UNITS.items():
        about = f"wanted {name} of C in {{s}}; Euler angles"
        data[f"wanted_{name}"] = (("time", "axis"), getattr(target, name), {"units": unit, "long_name": about})
    reference = {key: getattr(target.reference, name) for name, key in _REFERENCE.items()}
    axes = ",".join(f"{a}={b}" for a, b in target.reference.axes)
    facts = {"kind": "drive", "mode": mode, **reference, "axes": axes, **attrs}
    coords = {"time": ("time", target.time, {"units": "s"}), "axis": list(AXES)}
    with (
        write_whole(path) as beside,
        memoryview(xr.Dataset(data, coords, facts).to_netcdf(engine="h5netcdf")) as content,
    ):
        beside.write_bytes(content)
    return path


def load_drive(path: Path | str) -> Drive:
    """Read a drive file; raises RecordError naming the file and the missing or invalid entry."""
    data = open_record(path)
    if str(data.attrs.get("kind")) != "drive":
        raise RecordError(f"{path}: is not a drive file; make one with `lhpost6 iterate`")
    try:
        mode = str(data.attrs["mode"])
        arrays = {
            name: np.ascontiguousarray(
                data[name].sel(axis=list(AXES)).transpose("time", "axis").values.astype(float, casting="safe")
            )
            for name in ("drive", *(f"wanted_{q}" for q in _UNITS))
        }
        time = data["time"].values.astype(float, casting="safe")
        axes = [pair.split("=") for pair in str(data.attrs["axes"]).split(",")]
        kinds: dict[str, Any] = {"motion": str, "source": str}
        attrs = {"time_scale": 1.0, **data.attrs}  # earlier files have none
        stated = {name: kinds.get(name, float)(attrs[key]) for name, key in _REFERENCE.items()}
        reference = Reference(**stated, axes=tuple((a, b) for a, b in axes))
    except Exception as error:  # xarray and pandas raise nearly anything for labels that repeat or are missing
        raise RecordError(f"{path}: is damaged or incomplete: {error}; make it again with `lhpost6 iterate`") from error
    numbers = (reference.scale, reference.time_scale, reference.high_pass, reference.low_pass, reference.start)
    if not (np.isfinite(numbers).all() and {name for pair in reference.axes for name in pair} <= set(AXES)):
        raise RecordError(f"{path}: invalid description of the motion: {reference}; make it again")
    if mode not in MODES:
        raise RecordError(f"{path}: mode {mode!r} is not one of {', '.join(MODES)}")
    for name, values in arrays.items():
        if not (usable := np.abs(values) <= LARGEST).all():
            at, axis = np.argwhere(~usable)[0]
            what = unusable(values[at, axis])
            raise RecordError(f"{path}: {name} is {what} in {AXES[axis]} at sample {at}; make the file again")
    with np.errstate(over="ignore", invalid="ignore"):
        uniform = len(time) > 1 and np.abs(np.diff(time) * SAMPLE_RATE - 1.0).max() <= 1e-6  # nan is not either
    if not uniform:
        raise RecordError(f"{path}: its samples are not those of the controller, {SAMPLE_RATE} Hz; make the file again")
    motion = {quantity: arrays[f"wanted_{quantity}"] for quantity in _UNITS}
    target = Target(time, motion["displacement"], motion["velocity"], motion["acceleration"], reference)
    return Drive(arrays["drive"], mode, target, dict(data.attrs))


def scaled_drive(drive: Drive, factor: float) -> Drive:
    """A drive and its target times a factor; raises RecordError for one that is not finite, or zero."""
    if not (np.isfinite(factor) and factor != 0.0):
        raise RecordError(f"a drive cannot be scaled by {factor:g}; give a number other than zero")
    if factor == 1.0:
        return drive
    target = drive.target
    moved = {name: factor * getattr(target, name) for name in _UNITS}
    reference = replace(target.reference, scale=factor * target.reference.scale)
    return drive._replace(values=factor * drive.values, target=replace(target, reference=reference, **moved))


def scaled_target(drive: Drive, factor: float) -> Target:
    """Target of `scaled_drive` whose `reference.scale` is the factor, so that a scale that fits is a factor, too."""
    target, made = scaled_drive(drive, factor).target, drive.target.reference
    named = f"the drive of {made.motion}, iterated at scale {made.scale:g},"
    return replace(target, reference=replace(made, motion=named, scale=factor))
