"""Forces and pressure differences whose sign is turned: they oppose the acceleration that they must cause.

The force of an actuator is the mass it moves times the acceleration along it, and friction, constant and in proportion
to speed, against the motion: all coefficients of this regression are positive. Where it explains the force with those
of mass and friction negative, the sign is turned. Motion is that of the measured displacement, if there is one, so that
an accelerometer with its sign turned deceives nobody.
"""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.plant import make_plant
from ..mechanics.pose import kinematic_jacobian
from .channels import columns_of
from .conditioning import integrate
from .layout_faults import RecordFinding
from .records import sample_interval
from .rests import rest_numbers
from .signals import Band, differentiate

__all__ = ["turned_signs"]

FIRM = 0.1  # of a speed's deviation: below it friction is taken to rise with speed


def turned_signs(record: xr.Dataset, machine: Machine) -> list[RecordFinding]:
    """An error for every force or pressure difference that opposes mass times acceleration, from one record.

    A record of another machine, without motion, or slower than the band compared has none.
    """
    numbers, dt = rest_numbers(), sample_interval(record)
    low, high = numbers.vector("sign.band")
    if record.sizes["time"] * dt < 4 / low or 0.4 / dt < high:
        return []
    if not {"platen_displacement", "platen_acceleration"} & set(record.data_vars):
        return []
    band, rows = Band(low, high), kinematic_jacobian(make_plant(machine))
    speed, along = (x @ rows.T for x in _platen_motion(record, high, dt))  # (n, actuators)
    size = np.std(along, axis=0)
    moving = size >= max(numbers.number("sign.moving") * size.max(), 1e-300)
    found = []
    for name, label, force in _forces(record, machine):
        i = machine.actuator_names.index(label)
        if not moving[i]:
            continue
        stiction = np.tanh(speed[:, i] / (FIRM * np.std(speed[:, i])))
        x, y = band.apply(np.stack([along[:, i], stiction, speed[:, i]], axis=1), dt), band.apply(force, dt)
        if _opposes(x, y, _mass_moved(machine, rows, i), numbers):
            what = f"opposes the motion that it causes, mass and friction alike, from {low:g} to {high:g} Hz"
            remedy = "its sign is turned: write sign = -1 in the channel map, and import again"
            found.append(RecordFinding("error", f"{name}[{label}]", None, what, remedy))
    return found


def _platen_motion(record: xr.Dataset, high: float, dt: float) -> tuple[Array, Array]:
    """Velocity and acceleration (n, 6) of the platen below `high` [Hz]."""
    if "platen_displacement" in record:
        x = Band(high=high).apply(record["platen_displacement"].values.astype(float), dt)
        speed = differentiate(x, dt)
        return speed, differentiate(speed, dt)
    acceleration = Band(high=high).apply(record["platen_acceleration"].values.astype(float), dt)
    return integrate(acceleration - acceleration.mean(axis=0), dt)[0], acceleration


def _mass_moved(machine: Machine, rows: Array, i: int) -> float:
    """Share of the platen's mass [kg] that an actuator moves, with those beside it."""
    beside = float(np.sum((rows[:, :3] @ rows[i, :3]) ** 2))
    return float(np.mean(machine.platen.mass)) / beside


def _forces(record: xr.Dataset, machine: Machine) -> Iterator[tuple[str, str, Array]]:
    """Channel, actuator and force (n,) [N], measured or of a pressure difference."""
    areas = {a.name: a.area_a for a in machine.actuators}
    for name, dim in (("actuator_force", "actuator"), ("pressure_difference", "horizontal")):
        if name in record:
            for label, x in zip(map(str, record[dim].values), columns_of(record[name]).T, strict=True):
                if label in areas:
                    yield name, label, x * (areas[label] if dim == "horizontal" else 1.0)


def _opposes(x: Array, force: Array, mass: float, numbers: Parameters) -> bool:
    """Whether x (n, 3), acceleration, its friction's sign and speed, explains a force with mass and power negative."""
    coefficient = np.linalg.lstsq(x, force, rcond=None)[0]
    missed, whole = float(np.sum((force - x @ coefficient) ** 2)), float(np.sum(force**2))
    if not whole or missed > (1 - numbers.number("sign.explained")) * whole:
        return False
    least, most = numbers.vector("sign.share")
    power = float(np.sum(x[:, 1:] @ coefficient[1:] * x[:, 2]))
    return bool(least <= -coefficient[0] / mass <= most and power < 0)
