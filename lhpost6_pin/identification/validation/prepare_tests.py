"""A test prepared for comparison: its platen motion and actuator forces, and a second draw of the sensors' noise.

The noise of a difference is drawn, not derived: the stated noise is added to the record once more, and the resulting
change of the difference has the noise's size, through the same filters and formulas as the test itself.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from ...control import ControllerSettings
from ...core.arrays import Array
from ...core.files import models_folder
from ...data.records import require
from ...data.sensors import SensorSet
from ...data.signals import Band
from ...machine.machine import Machine
from ...machine.parameters import Parameters, load_parameters
from ...mechanics.linearize import OilColumnMode
from ...mechanics.plant import Plant, make_plant
from ...mechanics.pose import PlatenMotion, plant_motion
from ..inverse_dynamics import leg_wrenches
from ..prepare import AS_RECORDED, MeasuredTest, check_usable, prepare_noisier, prepare_test

__all__ = ["ComparisonBasis", "Numbers", "PreparedTest", "prepare", "too_short", "total_wrench", "validation_numbers"]
__all__ += ["wrench_calibration"]

SEED = 1  # of the second draw of noise: results repeat


class Numbers(NamedTuple):
    """Numbers of `models/procedures/validate.toml`."""

    stated: Parameters
    band: Band  # filter of all that is compared
    edge: float  # cut off at both ends of a test [s]
    longest_delay: float  # that is sought between model and measurement [s]
    bands: tuple[float, ...]  # edges of the bands of spectra [Hz]

    def number(self, path: str) -> float:
        """Number at a path of the file."""
        return self.stated.number(path)

    def inside(self, samples: int, dt: float) -> slice:
        """Samples of a test that are compared: all but its ends."""
        edge = round(self.edge / dt)
        return slice(edge, samples - edge)

    @property
    def shortest(self) -> float:
        """Length of the shortest test that can be compared [s], by the longest delay and the edges."""
        return 8 * self.longest_delay + 4 * self.edge


class ComparisonBasis(NamedTuple):
    """References by which all tests of a campaign are compared."""

    sensors: SensorSet
    numbers: Numbers
    modes: Sequence[OilColumnMode]  # oil columns of the linear model
    settings: ControllerSettings | None  # in place of those that records name


def validation_numbers() -> Numbers:
    """Read `models/procedures/validate.toml`."""
    stated = load_parameters(models_folder() / "procedures" / "validate.toml")
    n = stated.number
    band = Band(high=n("comparison.high"), order=int(n("comparison.order")))
    bands = stated.vector("spectra.edges")
    return Numbers(stated, band, n("comparison.edge"), n("comparison.longest_delay"), bands)


class PreparedTest(NamedTuple):
    """A test, prepared for comparison with the model of its machine."""

    basis: ComparisonBasis
    plant: Plant  # with the servovalves that were open
    time: Array  # (n,) from zero [s]
    test: MeasuredTest
    again: MeasuredTest  # with the stated noise added once more


def too_short(seconds: float, numbers: Numbers) -> str:
    """Message on a test that is too short to be compared."""
    return f"{seconds:.3g} s are too short to compare; {numbers.shortest:.3g} s are needed"


def prepare(machine: Machine, record: xr.Dataset, basis: ComparisonBasis) -> PreparedTest:
    """Prepare an aligned record; raises RecordError naming the channels without which there is no platen motion."""
    require(record, "time")
    table, sensors = machine.as_tested(record.attrs, "the test"), basis.sensors
    check_usable(table, record)
    plant = make_plant(table)
    policy = AS_RECORDED._replace(band=basis.numbers.band, edge=basis.numbers.edge)
    test = prepare_test(plant, record, sensors, policy)
    again = prepare_noisier(plant, record, sensors, policy, np.random.default_rng(SEED))
    time = record["time"].values
    return PreparedTest(basis, plant, time - float(time[0]), test, again)


def total_wrench(plant: Plant, motion: PlatenMotion, force: Array) -> Array:
    """Wrench (n, 6) of all actuators on the platen at C in {c} [N, N m] of forces (n, n_actuators)."""
    return np.asarray(leg_wrenches(plant, plant_motion(plant, motion).q, force).sum(axis=1))


def wrench_calibration(test: PreparedTest) -> Array:
    """Standard deviation (6,) of the measured wrench's mean at C by gains and offsets of the sensors of force.

    These are load cells, or the pressures that forces come from where none were recorded; nan without either.
    """
    sensors, actuators = test.basis.sensors, test.plant.machine.actuators
    double = np.array([a.area_b is not None for a in actuators])
    area_a = np.array([a.area_a for a in actuators])
    area_b = np.array([a.area_b for a in actuators if a.area_b is not None])
    every = np.ones(len(actuators), bool)
    ways = (
        {"actuator_force": (every, np.ones(len(actuators)))},
        {"chamber_pressure_a": (every, area_a), "chamber_pressure_b": (double, area_b)},
        {"pressure_difference": (double, area_a[double])},
    )
    way = next((way for way in ways if next(iter(way)) in test.test.channels), None)
    if way is None:
        return np.full(6, np.nan)
    variance = np.zeros(len(actuators))
    for name, (of, area) in way.items():
        if name in test.test.channels:
            mean = test.test.channels[name].mean(axis=0)
            variance[of] += area**2 * (sensors.offset_sd(name) ** 2 + (sensors.gain_sd(name) * mean) ** 2)
    rest = plant_motion(test.plant, PlatenMotion(*np.zeros((3, 1, 6))))
    arms = leg_wrenches(test.plant, rest.q, np.ones((1, len(actuators))))[0]
    return np.asarray(np.sqrt((arms**2).T @ variance))
