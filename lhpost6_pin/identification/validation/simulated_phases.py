"""A simulated run in open or closed loop, compared with the measured test."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array
from ...core.errors import SimulationError
from ...core.names import AXES
from ...data.signals import Band, delay_within, resample_band_limited
from ...mechanics.pose import PlatenMotion
from ...simulation.rehearse import SimulatedTest
from ..prepare import actuator_forces
from .phase_agreement import MOTIONS, ComparedQuantity
from .prepare_tests import PreparedTest, too_short, total_wrench, wrench_calibration
from .spectra import Resonance, Spectrum, estimate_response, estimate_spectrum, find_resonances

__all__ = ["Lag", "SimulatedComparison"]


class Lag(NamedTuple):
    """Delay of one axis behind the target, of measurement and model [s]."""

    column: str
    measured: float
    model: float


class SimulatedComparison:
    """A run and its test on the test's samples, up to the end of the run.

    `again` is the run of the test with another draw of noise, where the run depends on it: the change of the difference
    between model and measurement is its noise.
    """

    def __init__(self, test: PreparedTest, ran: SimulatedTest, again: SimulatedTest | None) -> None:
        """Raise SimulationError for a run that ended too early to be compared."""
        self.test, self.basis, self.dt = test, test.basis, test.test.dt
        same = again is not None and len(again.run.time) == len(ran.run.time)
        self.ran, self.again = ran.record, again.record if again is not None and same else ran.record
        self.clock = ran.record["time"].values
        self.n = int(np.searchsorted(test.time, self.clock[-1] + 1e-9, side="right"))
        if self.n * self.dt < self.basis.numbers.shortest:
            raise SimulationError(ran.run.trouble or too_short(self.n * self.dt, self.basis.numbers))
        self.notes = [ran.run.trouble] if ran.run.trouble else []
        if ran.run.clipped:
            self.notes.append(f"{ran.run.clipped} spool values beyond full stroke were clipped")
        self.moved = [PlatenMotion(*(r[f"platen_{q}"].values for q in MOTIONS)) for r in (self.ran, self.again)]
        self.axes = [AXES[k] for k in test.plant.axes]

    @property
    def time(self) -> Array:
        """Samples (n,) that are compared [s]."""
        return self.test.time[: self.n]

    def quantities(self, channels: Sequence[str]) -> list[ComparedQuantity]:
        """Motion and total actuator force per axis, and channels per actuator; missing channels are noted."""
        plant, axes = self.test.plant, self.test.plant.axes
        tests, runs = (self.test.test, self.test.again), (self.ran, self.again)
        motions = [[t.motion for t in tests], self.moved]
        found = []
        for quantity in MOTIONS:
            measured, model = ([getattr(m, quantity)[:, axes] for m in side] for side in motions)
            found.append(self._compared(quantity, self.axes, measured, model))
        forces: list[list[Array | None]] = [[actuator_forces(plant.machine, t.channels) for t in tests]]
        forces.append([r["actuator_force"].values for r in runs])
        if forces[0][0] is not None:
            measured, model = (
                [total_wrench(plant, m, f)[:, axes] for m, f in zip(moved, given, strict=True) if f is not None]
                for moved, given in zip(motions, forces, strict=True)
            )
            calibration = wrench_calibration(self.test)[axes]
            found.append(self._compared("wrench", self.axes, measured, model, calibration))
        for name in channels:
            if name not in self.test.test.record:
                self.notes.append(f"{name} was not recorded")
            elif name in self.ran:
                columns = [str(label) for label in self.ran[name][self.ran[name].dims[1]].values]
                measured, model = [t.record[name].values for t in tests], [run[name].values for run in runs]
                found.append(self._compared(name, columns, measured, model))
        return found

    def lags(self, target: Array, velocity: ComparedQuantity, moving: Sequence[str]) -> tuple[Lag, ...]:
        """Delays behind the target velocity (m, 6) at the run's samples, of the columns that move."""
        wanted = self._at_samples(target[: len(self.clock)], self.basis.numbers.band)
        longest, found = self.basis.numbers.longest_delay, []
        for k, column in enumerate(velocity.columns):
            if column in moving:
                sides = velocity.measured[:, k], velocity.model[:, k]
                reference = wanted[:, AXES.index(column)]
                found.append(Lag(column, *(float(delay_within(reference, x, self.dt, longest)) for x in sides)))
        return tuple(found)

    def spectrum(self) -> Spectrum:
        """Spectra of the platen's acceleration."""
        measured, noise, model = self._accelerations()
        return estimate_spectrum("acceleration", self.axes, measured, model, noise, self.dt, self.basis.numbers)

    def resonances(self) -> tuple[Resonance, ...]:
        """Oil columns; none without spool positions."""
        if "spool_position" not in self.test.test.record:
            return ()
        plant, numbers, dt = self.test.plant, self.basis.numbers, self.dt
        spool, more = (m.record["spool_position"].values[: self.n] for m in (self.test.test, self.test.again))
        acceleration, noise, moved = self._accelerations()
        noises = more - spool, noise
        measured = estimate_response(plant, spool, acceleration, noises, dt, numbers)
        opened = self._at_samples(self.ran["spool_position"].values, self.basis.sensors.band)
        model = estimate_response(plant, opened, moved, noises, dt, numbers)
        return find_resonances(self.axes, measured, model, self.basis.modes, numbers)

    def _compared(
        self,
        quantity: str,
        columns: Sequence[str],
        measured: Sequence[Array],
        model: Sequence[Array],
        calibration: Array | None = None,
    ) -> ComparedQuantity:
        """Both sides of a quantity; each has two draws of noise."""
        band = self.basis.numbers.band
        sensor_noise = band.apply(measured[1] - measured[0], self.dt)[: self.n]
        noise = sensor_noise
        if self.again is not self.ran:
            noise = self._at_samples(model[1] - model[0], band) - sensor_noise
        kept = band.apply(measured[0], self.dt)[: self.n], self._at_samples(model[0], band)
        inside = self.basis.numbers.inside(self.n, self.dt)
        spread = sensor_noise[inside].std(axis=0), noise[inside].std(axis=0)
        return ComparedQuantity(quantity, tuple(columns), *kept, *spread, calibration)

    def _at_samples(self, values: Array, band: Band) -> Array:
        """A run's values, filtered, at the test's samples: selected where these coincide, else interpolated."""
        step = self.clock[1] - self.clock[0]
        kept, every = band.apply(values, step), max(round(self.dt / step), 1)
        picked = self.clock[::every][: self.n]
        if len(picked) == self.n and np.allclose(picked, self.time, rtol=0.0, atol=1e-6 * step):
            return np.asarray(kept[::every][: self.n])
        return resample_band_limited(kept, self.clock, self.time)

    def _accelerations(self) -> tuple[Array, Array, Array]:
        """Measured acceleration (n, k) of the free axes, its noise, and the model's."""
        axes = self.test.plant.axes
        measured, more = (m.motion.acceleration[: self.n, axes] for m in (self.test.test, self.test.again))
        return measured, more - measured, self._at_samples(self.moved[0].acceleration[:, axes], self.basis.sensors.band)
