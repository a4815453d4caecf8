"""The closed loop that a record was made in: controller settings, reference or drive."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from ...control import ControllerSettings, load_controller
from ...core.arrays import Array
from ...core.errors import RecordError
from ...core.files import shipped
from ...core.names import AXES, SAMPLE_RATE
from ...data.records import require
from ...data.signals import differentiate, resample_band_limited
from ...motions import Reference, Target
from ...tuning.drives import load_drive

__all__ = ["Lag", "drive_of", "settings_of"]


class Lag(NamedTuple):
    """Delay of one axis behind the target, of measurement and model [s]."""

    column: str
    measured: float
    model: float


def settings_of(record: xr.Dataset, given: ControllerSettings | None) -> tuple[ControllerSettings, str]:
    """Settings given, else the shipped ones that the record's attribute `controller` names; and a note on which.

    Raises RecordError where neither is known.
    """
    name = record.attrs.get("controller")
    loop = "closed loop with the controller"
    if given is not None and name != given.name:
        named = "no controller" if name is None else f"“{name}”"
        return given, f"{loop} given, “{given.name}”; the record names {named}: settings may differ"
    known = ((file, load_controller(file)) for file in shipped("controllers"))
    settings = given or next((s for file, s in known if name in (file, s.name)), None)
    if settings is None:
        named = "no controller" if name is None else f"the controller {name!r}, which is not shipped"
        raise RecordError(f"the record names {named}; give its settings as a TOML file with --controller")
    return settings, f"{loop} that the record names, “{settings.name}”"


def drive_of(record: xr.Dataset, settings: ControllerSettings, high: float) -> tuple[Target, Array | None]:
    """Target at the controller's rate, and the drive (n, 6) if the test replayed one.

    Velocity and acceleration of the reference are those stored, else low-passed derivatives up to `high` [Hz]. Raises
    RecordError without reference_displacement, or for a drive file that is missing or of another mode.
    """
    if "drive" in record.attrs:
        found = load_drive(Path(str(record.attrs["drive"])))
        if found.mode != settings.mode:
            raise RecordError(f"{record.attrs['drive']} is for {found.mode} mode; {settings.name} has {settings.mode}")
        return found.target, found.values
    require(record, "reference_displacement")
    time = record["time"].values - float(record["time"][0])
    dt = float(time[-1]) / (len(time) - 1)
    clock = np.arange(int(time[-1] * SAMPLE_RATE + 1e-6) + 1) / SAMPLE_RATE
    motion = [record["reference_displacement"].values]
    for name in ("reference_velocity", "reference_acceleration"):
        motion.append(record[name].values if name in record else differentiate(motion[-1], dt, high))
    x, v, a = (resample_band_limited(values, time, clock) for values in motion)
    axes = tuple((axis, axis) for axis in AXES)
    name = str(record.attrs.get("test", "test"))
    return Target(clock, x, v, a, Reference(name, "reference of the record", 1.0, axes, 0.0, high, 0.0)), None
