"""Drive files: what online iteration found, to be replayed later and on the same settings.

A drive file is netCDF-4 with `drive` (time, axis), the signal that goes into the reference generators, its `mode`, and
the motion that it is to produce (`wanted_displacement`, `wanted_velocity`, `wanted_acceleration`).
"""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..control.filters import MODES
from ..core.errors import RecordError
from ..core.files import write_whole
from ..core.names import AXES, SAMPLE_RATE
from ..data.records import open_record
from ..machine.machine import Machine
from ..machine.parameters import LARGEST, unusable
from ..motions import Reference, Target

__all__ = ["Drive", "check_circumstances", "circumstances", "load_drive", "save_drive"]

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

_UNITS = {
    "acceleration": "m/s2, rad/s2",
    "velocity": "m/s, rad/s",
    "displacement": "m, rad",
}


class Drive(NamedTuple):
    """A drive and the motion that it is for."""

    values: Array  # (n, 6) in the quantity of `mode`
    mode: str
    target: Target
    attrs: Mapping[str, Any]


def circumstances(machine: Machine, controller: str) -> dict[str, str]:
    """What a drive or an inverse is good for: machine, specimen, open servovalves, and the name of the settings."""
    return {
        "machine": machine.name,
        "specimen": machine.specimen.name if machine.specimen else "none",
        "servovalves": str(sum(a.valves for a in machine.actuators)),
        "controller": controller,
    }


def check_circumstances(origin: str, made_with: Mapping[str, Any], machine: Machine, controller: str) -> None:
    """Refuse what was made on another machine, with a RecordError that names its `origin`; warn of other differences.

    What `made_with` does not say is not judged.
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
    """Write a drive (n, 6) and its target, whole or not at all; attrs say how it was made."""
    about = {
        "units": _UNITS[mode],
        "long_name": f"drive of the reference generators in {mode} mode, x y z roll pitch yaw",
    }
    data = {"drive": (("time", "axis"), values, about)}
    for name, unit in _UNITS.items():
        said = {"units": unit, "long_name": f"wanted {name} of C in {{s}}; Euler angles"}
        data[f"wanted_{name}"] = (("time", "axis"), getattr(target, name), said)
    facts = {
        "kind": "drive",
        "mode": mode,
        "motion": target.reference.motion,
        "source": target.reference.source,
        "scale": target.reference.scale,
        "high_pass_hz": target.reference.high_pass,
        "low_pass_hz": target.reference.low_pass,
        "axes": ",".join(f"{a}={b}" for a, b in target.reference.axes),
        "start_s": target.reference.start,
        **attrs,
    }
    coords = {"time": ("time", target.time, {"units": "s"}), "axis": list(AXES)}
    with (
        write_whole(path) as beside,
        memoryview(xr.Dataset(data, coords, facts).to_netcdf(engine="h5netcdf")) as content,
    ):
        beside.write_bytes(content)
    return path


def load_drive(path: Path | str) -> Drive:
    """Read a drive file; raises RecordError naming the file and what it lacks."""
    data = open_record(path)
    if str(data.attrs.get("kind")) != "drive":
        raise RecordError(f"{path}: is no drive file; make one with `lhpost6 iterate`")
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
        reference = Reference(
            motion=str(data.attrs["motion"]),
            source=str(data.attrs["source"]),
            scale=float(data.attrs["scale"]),
            axes=tuple((a, b) for a, b in axes),
            high_pass=float(data.attrs["high_pass_hz"]),
            low_pass=float(data.attrs["low_pass_hz"]),
            start=float(data.attrs["start_s"]),
        )
    except Exception as error:  # xarray and pandas raise nearly anything for labels that repeat or are missing
        raise RecordError(f"{path}: is damaged or incomplete: {error}; make it again with `lhpost6 iterate`") from error
    numbers = (reference.scale, reference.high_pass, reference.low_pass, reference.start)
    if not (np.isfinite(numbers).all() and {name for pair in reference.axes for name in pair} <= set(AXES)):
        raise RecordError(f"{path}: says of its motion what cannot be: {reference}; make it again")
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
    displacement, velocity, acceleration = (arrays[f"wanted_{q}"] for q in ("displacement", "velocity", "acceleration"))
    target = Target(time, displacement, velocity, acceleration, reference)
    return Drive(arrays["drive"], mode, target, dict(data.attrs))
