"""A decomposed record effect by effect: wrench, power and energy on the platen, as a dataset and on disk.

Power is an effect's wrench times the twist of C. The work of inertia differs from the change of kinetic energy by the
work of Eq. 4-26's direction-dependent mass (`energy`), and by the errors of quadrature and of measured derivatives.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from ... import __version__
from ...core.arrays import Array
from ...core.files import write_whole
from ...core.names import AXES
from ...data.channels import LAYOUT
from ...mechanics.pose import rotation
from ...mechanics.rigid_body import platen_inertia
from ...simulation.ledger import WRENCH_AXES
from .interface import InterfaceWrench
from .record import Decomposed

__all__ = ["Work", "delivered_by", "find_work", "ledger_dataset", "save_ledger"]

_AT_C = "at C in {c}"


class Work(NamedTuple):
    """Work on the platen over the compared samples, in the sensors' whole band."""

    time: Array  # (n,) [s]
    effects: tuple[str, ...]  # (m,) of the ledger, actuators as measured, and the unexplained rest
    power: Array  # (n, m) [W], positive into the platen
    energy: Array  # (n, m) since the first sample [J]
    inertia: Array  # (n,) work of inertia since the first sample [J]: the sum of all effects
    kinetic: Array  # (n,) change of kinetic energy since the first sample [J]

    @property
    def unbalanced(self) -> Array:
        """Work of inertia less the change of kinetic energy (n,) [J]."""
        return self.inertia - self.kinetic


def delivered_by(found: Decomposed, *, whole: bool = False) -> tuple[tuple[str, ...], Array]:
    """Effects and their wrenches (n, m, 6): the ledger's with the actuators' as measured, and the unexplained rest.

    Their sum is the inertia. Filtered, or (`whole`) in the sensors' band; the compared samples in either case.
    """
    forces, part = (found.whole, found.inside) if whole else (found.forces, slice(None))
    wrench = np.concatenate([forces.ledger.wrench[part], forces.residual[part, None]], axis=1)
    for k, effect in enumerate(found.plant.machine.effects):
        if effect.spools:
            wrench[:, k] = forces.component_wrench[part][:, list(effect.spools)].sum(axis=1)
    return (*forces.ledger.effects, "unexplained"), wrench


def find_work(found: Decomposed) -> Work:
    """Power of every effect, its energy by the trapezoidal rule, and the balance of kinetic energy."""
    from scipy.integrate import cumulative_trapezoid

    effects, wrench = delivered_by(found, whole=True)
    part = found.inside
    v = np.zeros((len(found.time), 6))
    v[:, found.plant.axes] = found.whole.states.v[part]  # twist of B in platen axes, as forces saw it
    turn = rotation(found.test.motion.displacement[part, 3:])
    linear = v[:, :3] + np.cross(v[:, 3:], found.plant.body[0]["rho_c"])
    twist = np.hstack([np.einsum("nij,nj->ni", turn, x) for x in (linear, v[:, 3:])])
    power = np.einsum("nmj,nj->nm", wrench, twist)
    _, mass = platen_inertia(found.plant.model, found.plant.machine)
    kinetic = 0.5 * np.einsum("ni,ij,nj->n", v, mass, v)
    energy = cumulative_trapezoid(power, dx=found.dt, axis=0, initial=0.0)
    return Work(found.time, effects, power, energy, energy.sum(axis=1), kinetic - kinetic[0])


def ledger_dataset(
    found: Decomposed, work: Work | None = None, source: str = "", interface: InterfaceWrench | None = None
) -> xr.Dataset:
    """Forces, motion, power and energy with dims time, effect, component, axis, coordinate; source names the record.

    Actuators' effects hold what was measured, and `unexplained` the rest, so that all effects add up to the inertia.
    """
    work = find_work(found) if work is None else work
    forces, (effects, wrench) = found.forces, delivered_by(found)
    per_effect, along = ("time", "effect"), "measured force along the component, positive where it lengthens it"
    table = [
        ("wrench", (*per_effect, "axis"), wrench, "N, N m", f"wrench on the platen {_AT_C}"),
        ("component_force", ("time", "component"), forces.component_force, "N", along),
        ("power", per_effect, work.power, "W", "power into the platen, unfiltered"),
        ("energy", per_effect, work.energy, "J", "energy since the first sample"),
        ("kinetic_energy", ("time",), work.kinetic, "J", "change of kinetic energy since the first sample"),
    ]
    for name, values, about in (
        ("inertia", forces.ledger.inertia, "inertial wrench"),
        ("required", forces.required, "actuator wrench that the motion required"),
        ("measured", forces.measured, "actuator wrench as measured"),
        ("residual", forces.residual, "required less measured actuator wrench"),
        ("dissipative", forces.dissipative, "friction and viscous wrench of the model"),
        ("dissipative_measured", forces.dissipative_measured, "the same from measured forces"),
        ("struts_measured", forces.struts_measured, "wrench of the struts from their pressures"),
    ):
        if values is not None:
            table.append((name, ("time", "axis"), values, "N, N m", f"{about} {_AT_C}"))
    for name, values in found.motion._asdict().items():
        units = LAYOUT[f"platen_{name}"].units
        about = f"platen {name} of C in {{s}}; Euler angles"
        table.append((f"platen_{name}", ("time", "coordinate"), values, units, about))
    if interface is not None:
        at = "of the specimen on the platen at the interface, platen axes"
        for name, values, about in (
            ("interface", interface.wrench, f"wrench {at}, from measured forces"),
            ("interface_sd", interface.sd, "standard deviation of the interface wrench"),
            ("interface_model", interface.predicted, f"wrench {at}, of the mounted model"),
            ("interface_floors", interface.floors, f"wrench {at}, of the floors' masses and accelerations"),
        ):
            if values is not None:
                table.append((name, ("time", "axis"), values, "N, N m", about))
    coordinates = {
        "time": ("time", found.time, {"units": "s", "long_name": "time"}),
        "effect": list(effects),
        "component": list(forces.component),
        "axis": list(WRENCH_AXES),
        "coordinate": list(AXES),
    }
    variables = {n: (dims, x, {"units": units, "long_name": about}) for n, dims, x, units, about in table}
    return xr.Dataset(variables, coordinates, _attributes(found, source))


def save_ledger(
    found: Decomposed,
    path: Path | str,
    work: Work | None = None,
    source: str = "",
    interface: InterfaceWrench | None = None,
) -> None:
    """Write `ledger_dataset` whole or not at all, in float64 and uncompressed."""
    plain = ledger_dataset(found, work, source, interface)
    encoding = {name: {"_FillValue": None} for name in plain.data_vars}
    # through memory: HDF5 that meets a full disk crashes the process when it closes
    with write_whole(path) as beside, memoryview(plain.to_netcdf(engine="h5netcdf", encoding=encoding)) as content:
        beside.write_bytes(content)


def _attributes(found: Decomposed, source: str) -> dict[str, str | float]:
    record, machine, band = found.record, found.mounted.machine, found.comparison.band
    return {
        "title": f"Forces behind {record.attrs.get('title', found.test.name)}",
        "test": found.test.name,
        "record": source or str(record.encoding.get("source", "")),
        "machine": machine.name,
        "specimen": machine.mounted,
        "cutoff_hz": band.high,
        "filter_order": band.order,
        "edge_s": found.comparison.edge,
        "made_from": " ".join(found.notes),
        "lhpost6_pin": __version__,
        "numpy": np.__version__,
        "xarray": xr.__version__,
    }
