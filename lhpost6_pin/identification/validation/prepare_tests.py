"""A test made ready to be compared: its platen motion and actuator forces, and a second draw of the sensors' noise.

What sensors leave in a difference is not derived but drawn: the stated noise is added to the record once more, and
what that changes has the noise's size, through every filter and formula that the test itself goes through.
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...data.records import require
from ...data.sensors import SensorSet, add_noise
from ...machine.machine import Machine
from ...mechanics.plant import Plant, make_plant
from ...mechanics.pose import PlatenMotion, plant_motion
from ..inverse_dynamics import leg_wrenches
from ..prepare import AS_RECORDED, MeasuredTest, check_usable, prepare_test
from .metrics import ComparisonBasis, Numbers

__all__ = ["PreparedTest", "prepare", "too_short", "total_wrench", "wrench_calibration"]


SEED = 1  # of the second draw of noise: results repeat


@dataclass(frozen=True)
class PreparedTest:
    """A test, ready to be compared with the model of its machine."""

    name: str
    plant: Plant  # with the servovalves that were open
    time: Array  # (n,) from zero [s]
    test: MeasuredTest
    again: MeasuredTest  # with the stated noise added once more

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


def prepare(machine: Machine, record: xr.Dataset, basis: ComparisonBasis) -> PreparedTest:
    """Make an aligned record ready; raises RecordError naming the channels without which there is no platen motion."""
    require(record, "time")
    table, sensors = machine.as_tested(record.attrs, "the test"), basis.sensors
    check_usable(table, record)
    plant = make_plant(table)
    noisy = add_noise(record, sensors, np.random.default_rng(SEED))
    policy = AS_RECORDED._replace(band=basis.numbers.band)
    both = (prepare_test(plant, r, sensors, policy) for r in (record, noisy))
    time = record["time"].values
    return PreparedTest(str(record.attrs.get("test", "test")), plant, time - float(time[0]), *both)


def total_wrench(plant: Plant, motion: PlatenMotion, force: Array) -> Array:
    """Wrench (n, 6) of all actuators on the platen at C in {c} [N, N m] of forces (n, n_actuators)."""
    return np.asarray(leg_wrenches(plant, plant_motion(plant, motion).q, force).sum(axis=1))


def wrench_calibration(test: PreparedTest, sensors: SensorSet) -> Array:
    """Standard deviation (6,) that gains and offsets of force sensors leave in the mean of the measured wrench at C.

    nan where forces were not measured.
    """
    force = test.test.channels.get("actuator_force")
    if force is None:
        return np.full(6, np.nan)
    mean = force.mean(axis=0)
    sd = np.hypot(sensors.offset_sd("actuator_force"), sensors.gain_sd("actuator_force") * mean)
    rest = plant_motion(test.plant, PlatenMotion(*np.zeros((3, 1, 6))))
    arms = leg_wrenches(test.plant, rest.q, np.ones((1, len(mean))))[0]
    return np.asarray(np.sqrt((arms**2).T @ sd**2))
