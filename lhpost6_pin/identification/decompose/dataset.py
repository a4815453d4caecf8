"""The force ledger of a decomposed record as a dataset, and on disk."""

from pathlib import Path

import numpy as np
import xarray as xr

from ... import __version__
from ...core.files import write_whole
from ...core.names import AXES
from ...simulation.ledger import WRENCH_AXES
from .record import Decomposed
from .work import Work, delivered_by, find_work

__all__ = ["ledger_dataset", "save_ledger"]


def ledger_dataset(found: Decomposed, work: Work | None = None, source: str = "") -> xr.Dataset:
    """Forces, motion, power and energy with dims time, effect, component, axis, coordinate; source names the record.

    Actuators' effects hold what was measured, and `unexplained` the rest, so that all effects add up to the inertia.
    """
    work = find_work(found) if work is None else work
    forces = found.forces
    effects, wrench = delivered_by(found)
    side = "at C in {c}"
    by_axis = {
        "inertia": (forces.ledger.inertia, f"inertial wrench {side}"),
        "required": (forces.required, f"actuator wrench that the motion required {side}"),
        "measured": (forces.measured, f"actuator wrench as measured {side}"),
        "residual": (forces.residual, f"required less measured actuator wrench {side}"),
        "dissipative": (forces.dissipative, f"friction and viscous wrench of the model {side}"),
        "dissipative_measured": (forces.dissipative_measured, f"the same from measured forces {side}"),
    }
    if forces.struts_measured is not None:
        by_axis["struts_measured"] = (forces.struts_measured, f"wrench of the struts from their pressures {side}")
    variables = {
        "wrench": (("time", "effect", "axis"), wrench, _about("N, N m", f"wrench on the platen {side}")),
        "component_force": (
            ("time", "component"),
            forces.component_force,
            _about("N", "measured force along the component, positive where it lengthens it"),
        ),
        "power": (("time", "effect"), work.power, _about("W", "power into the platen, unfiltered")),
        "energy": (("time", "effect"), work.energy, _about("J", "energy since the first sample")),
        "kinetic_energy": ("time", work.kinetic, _about("J", "change of kinetic energy since the first sample")),
    }
    variables |= {n: (("time", "axis"), x, _about("N, N m", words)) for n, (x, words) in by_axis.items()}
    for name, values in found.motion._asdict().items():
        unit = {"displacement": "m, rad", "velocity": "m/s, rad/s", "acceleration": "m/s2, rad/s2"}[name]
        about = _about(unit, f"platen {name} of C in {{s}}; Euler angles")
        variables[f"platen_{name}"] = (("time", "coordinate"), values, about)
    coordinates = {
        "time": ("time", found.time, _about("s", "time")),
        "effect": list(effects),
        "component": list(forces.component),
        "axis": list(WRENCH_AXES),
        "coordinate": list(AXES),
    }
    return xr.Dataset(variables, coordinates, _facts(found, source))


def save_ledger(found: Decomposed, path: Path | str, work: Work | None = None, source: str = "") -> None:
    """Write `ledger_dataset` whole or not at all, in float64 and uncompressed."""
    plain = ledger_dataset(found, work, source)
    encoding = {name: {"_FillValue": None} for name in plain.data_vars}
    # through memory: HDF5 that meets a full disk crashes the process when it closes
    with write_whole(path) as beside, memoryview(plain.to_netcdf(engine="h5netcdf", encoding=encoding)) as content:
        beside.write_bytes(content)


def _about(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}


def _facts(found: Decomposed, source: str) -> dict[str, str | float]:
    record, machine = found.record, found.plant.machine
    name = str(record.attrs.get("test", "test"))
    return {
        "title": f"Forces behind {record.attrs.get('title', name)}",
        "test": name,
        "record": source or str(record.encoding.get("source", "")),
        "machine": machine.name,
        "specimen": machine.specimen.name if machine.specimen else "none",
        "cutoff_hz": found.comparison.band.high,
        "filter_order": found.comparison.band.order,
        "edge_s": found.comparison.edge,
        "made_from": " ".join(found.notes),
        "lhpost6_pin": __version__,
        "numpy": np.__version__,
        "xarray": xr.__version__,
    }
