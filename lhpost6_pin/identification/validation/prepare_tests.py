"""A test made ready to be compared: its platen motion and actuator forces, and a second draw of the sensors' noise.

What sensors leave in a difference is not derived but drawn: the stated noise is added to the record once more, and
what that changes has the noise's size, through every filter and formula that the test itself goes through.
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...data.alignment import hydraulic_force
from ...data.fusion import fuse_motion
from ...data.records import is_measured, require
from ...data.sensors import SensorSet, add_noise
from ...machine.machine import Machine
from ...mechanics.plant import Plant, make_plant
from ...mechanics.pose import PlatenMotion, plant_motion
from ..inverse_dynamics import leg_wrenches
from .metrics import Numbers

__all__ = ["MeasuredSignals", "PreparedTest", "prepare", "too_short", "total_wrench", "wrench_calibration"]

Array = NDArray[np.float64]

SEED = 1  # of the second draw of noise: results repeat


@dataclass(frozen=True)
class MeasuredSignals:
    """What was measured of a test; n samples."""

    record: xr.Dataset
    motion: PlatenMotion  # of C and Euler angles (n, 6)
    force: Array | None  # (n, n_actuators) [N] of load cells, else of chamber pressures


@dataclass(frozen=True)
class PreparedTest:
    """A test, ready to be compared with the model of its machine."""

    name: str
    plant: Plant  # with the servovalves that were open
    time: Array  # (n,) from zero [s]
    test: MeasuredSignals
    again: MeasuredSignals  # with the stated noise added once more

    @property
    def dt(self) -> float:
        """Sample interval [s]."""
        return float(self.time[-1]) / (len(self.time) - 1)

    @property
    def machine(self) -> Machine:
        """The machine with the servovalves that were open."""
        return self.plant.machine


def too_short(seconds: float, numbers: Numbers) -> str:
    """What to say of a test that is too short to be compared."""
    return f"{seconds:.3g} s are too short to compare; {numbers.shortest:.3g} s are needed"


def prepare(machine: Machine, record: xr.Dataset, sensors: SensorSet) -> PreparedTest:
    """Make a record ready. Raises RecordError naming the channels without which there is no platen motion."""
    require(record, "time")
    table = machine.as_tested(record.attrs, "the test")
    plant = make_plant(table)
    noisy = add_noise(record, sensors, np.random.default_rng(SEED))
    both = (MeasuredSignals(r, _motion(plant, r, sensors), _force(table, r)) for r in (record, noisy))
    return PreparedTest(
        str(record.attrs.get("test", "test")), plant, record["time"].values - float(record["time"][0]), *both
    )


def _motion(plant: Plant, record: xr.Dataset, sensors: SensorSet) -> PlatenMotion:
    """Platen motion: a simulated record's own if it is free of noise, else fused from all its sensors."""
    names = [f"platen_{quantity}" for quantity in PlatenMotion._fields]
    if not is_measured(record) and set(names) <= set(record.data_vars):
        return PlatenMotion(*(record[name].values for name in names))
    return fuse_motion(plant, record, sensors).motion


def _force(machine: Machine, record: xr.Dataset) -> Array | None:
    if "actuator_force" in record:
        return np.asarray(record["actuator_force"].sel(actuator=list(machine.actuator_names)).values, float)
    if "chamber_pressure_a" not in record:
        return None
    force = hydraulic_force(machine, record)
    return force if np.isfinite(force).all() else None


def total_wrench(plant: Plant, motion: PlatenMotion, force: Array) -> Array:
    """Wrench (n, 6) of all actuators on the platen at C in {c} [N, N m] of forces (n, n_actuators)."""
    return np.asarray(leg_wrenches(plant, plant_motion(plant, motion).q, force).sum(axis=1))


def wrench_calibration(test: PreparedTest, sensors: SensorSet) -> Array:
    """Standard deviation (6,) that gains and offsets of force sensors leave in the mean of the measured wrench at C.

    nan where forces were not measured.
    """
    if test.test.force is None or "actuator_force" not in test.test.record:
        return np.full(6, np.nan)
    mean = test.test.force.mean(axis=0)
    sd = np.hypot(sensors.offset_sd("actuator_force"), sensors.gain_sd("actuator_force") * mean)
    rest = plant_motion(test.plant, PlatenMotion(*np.zeros((3, 1, 6))))
    arms = leg_wrenches(test.plant, rest.q, np.ones((1, len(mean))))[0]
    return np.asarray(np.sqrt((arms**2).T @ sd**2))
