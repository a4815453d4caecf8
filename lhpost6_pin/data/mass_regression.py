"""Forces of a record regressed on the motion: the mass that each moves, and friction against its motion.

The force of an actuator is the mass it moves times the acceleration along it, and friction, constant and in proportion
to speed, against the motion: all coefficients of this regression are positive. Motion is that of the measured
displacement, if there is one, so that an accelerometer with its sign or unit wrong deceives nobody.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array, Mask
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.plant import make_plant
from ..mechanics.pose import kinematic_jacobian
from .channels import columns_of
from .conditioning import integrate
from .records import sample_interval
from .signals import Band, differentiate

__all__ = ["MassFit", "mass_fits"]

FIRM = 0.1  # of a speed's deviation: below it friction is taken to rise with speed


class MassFit(NamedTuple):
    """The regression of one force on the motion along its actuator."""

    channel: str  # a force, or a pressure difference
    actuator: str
    share: float  # fitted mass over the mass that the actuator must move; signed
    explained: float  # share of the force's squares that mass and friction explain
    by_mass: float  # share that mass alone explains
    power: float  # mean square of friction's power, signed: below zero where it drives the motion
    opposite: tuple[str, ...]  # actuators along which this record's acceleration is the opposite
    given: float  # mean power to the platen over rms force, about its mean, and rms speed: -1 to 1, at all frequencies


def mass_fits(record: xr.Dataset, machine: Machine, numbers: Parameters) -> list[MassFit]:
    """Regress every force and pressure difference along whose actuator the platen moves; `numbers` as `rest_numbers`.

    A record without motion to and fro, or slower than the band compared, has none.
    """
    dt = sample_interval(record)
    low, high = numbers.vector("sign.band")
    if record.sizes["time"] * dt < 4 / low or 0.4 / dt < high:
        return []
    if not {"platen_displacement", "platen_acceleration"} & set(record.data_vars):
        return []
    band, rows = Band(low, high), kinematic_jacobian(make_plant(machine))
    speed, along = (x @ rows.T for x in _platen_motion(record, high, dt))  # (n, actuators)
    size = np.std(along, axis=0)
    opposite = _opposite(along, size, numbers.number("sign.opposite"))
    moving = size >= max(numbers.number("sign.moving") * size.max(), 1e-300)
    moving &= np.mean(np.abs(speed), axis=0) >= numbers.number("sign.returns") * np.abs(np.mean(speed, axis=0))
    found = []
    for name, label, force in _forces(record, machine):
        i = machine.actuator_names.index(label)
        if not moving[i]:
            continue
        stiction = np.tanh(speed[:, i] / (FIRM * np.std(speed[:, i])))
        x, y = band.apply(np.stack([along[:, i], stiction, speed[:, i]], axis=1), dt), band.apply(force, dt)
        whole = float(np.sum(y**2))
        if whole:
            coefficient = np.linalg.lstsq(x, y, rcond=None)[0]
            explained = 1.0 - float(np.sum((y - x @ coefficient) ** 2)) / whole
            by_mass = float(x[:, 0] @ y) ** 2 / (float(np.sum(x[:, 0] ** 2)) * whole)
            power = float(np.sum(x[:, 1:] @ coefficient[1:] * x[:, 2]))
            share = float(coefficient[0]) / _mass_moved(machine, rows, i)
            given = _mean_power(force, speed[:, i])
            others = tuple(machine.actuator_names[j] for j in np.flatnonzero(opposite[i]))
            found.append(MassFit(f"{name}[{label}]", label, share, explained, by_mass, power, others, given))
    return found


def _platen_motion(record: xr.Dataset, high: float, dt: float) -> tuple[Array, Array]:
    """Velocity and acceleration (n, 6) of the platen below `high` [Hz]."""
    if "platen_displacement" in record:
        x = Band(high=high).apply(record["platen_displacement"].values.astype(float), dt)
        speed = differentiate(x, dt)
        return speed, differentiate(speed, dt)
    acceleration = Band(high=high).apply(record["platen_acceleration"].values.astype(float), dt)
    return integrate(acceleration - acceleration.mean(axis=0), dt)[0], acceleration


def _opposite(along: Array, size: Array, least: float) -> Mask:
    """Pairs of actuators (n, n) whose accelerations (samples, n) correlate by -`least` or less."""
    unit = (along - along.mean(axis=0)) / np.maximum(size, 1e-300)
    return np.asarray(unit.T @ unit / len(along) <= -least)


def _mean_power(force: Array, speed: Array) -> float:
    """Mean power of a force, less its mean, over the product of both rms; zero without either."""
    varying = force - force.mean()
    apparent = float(np.sqrt(np.mean(varying**2) * np.mean(speed**2)))
    return float(np.mean(varying * speed)) / apparent if apparent else 0.0


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
