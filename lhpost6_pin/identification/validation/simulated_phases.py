"""A simulated run laid over the test that it repeats, in open or closed loop."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.errors import SimulationError
from ...core.names import AXES
from ...data.signals import Band, delay, resample_band_limited
from ...mechanics.pose import PlatenMotion
from ...simulation.rehearse import SimulatedTest
from ..prepare import actuator_forces
from .band_spectra import Spectrum, estimate_spectrum
from .closed_loop import Lag
from .comparison_basis import ComparisonBasis
from .phase_agreement import MOTIONS, ComparedQuantity
from .prepare_tests import PreparedTest, too_short, total_wrench, wrench_calibration
from .resonance import Resonance, estimate_response, find_resonances

__all__ = ["SimulatedComparison"]

Array = NDArray[np.float64]


class SimulatedComparison:
    """A run and its test on the test's samples, as far as the run came.

    `again` is the run of the test with noise added once more, where the run depends on it: what that changes in the
    difference of model and measurement is the noise of a pair.
    """

    def __init__(
        self, test: PreparedTest, ran: SimulatedTest, again: SimulatedTest | None, basis: ComparisonBasis
    ) -> None:
        """Raise SimulationError for a run that ended too early to be compared."""
        self.test, self.basis = test, basis
        same = again is not None and len(again.run.time) == len(ran.run.time)
        self.ran, self.again = ran.record, again.record if again is not None and same else ran.record
        self.clock = ran.record["time"].values
        self.n = int(np.searchsorted(test.time, self.clock[-1] + 1e-9, side="right"))
        if self.n * test.dt < basis.numbers.shortest:
            raise SimulationError(ran.run.trouble or too_short(self.n * test.dt, basis.numbers))
        self.notes = [ran.run.trouble] if ran.run.trouble else []
        if ran.run.clipped:
            self.notes.append(f"{ran.run.clipped} spool values beyond full stroke were clipped")
        self.moved = [PlatenMotion(*(r[f"platen_{q}"].values for q in MOTIONS)) for r in (self.ran, self.again)]
        self.axes = [AXES[k] for k in test.plant.axes]

    @property
    def time(self) -> Array:
        """Samples (n,) that are compared [s]."""
        return self.test.time[: self.n]

    def pairs(self, channels: Sequence[str]) -> list[ComparedQuantity]:
        """Motion and total actuator force per axis, and channels per actuator; what is missing is noted."""
        found = [self._motion(quantity) for quantity in MOTIONS]
        if actuator_forces(self.test.machine, self.test.test.channels) is not None:
            found.append(self._wrench())
        return found + [self._channel(name) for name in channels if self._has(name)]

    def lags(self, asked: Array, pair: ComparedQuantity, moving: Sequence[str]) -> tuple[Lag, ...]:
        """Delays behind the velocity (m, 6) that was asked for at the run's samples, of the columns that move."""
        wanted = self._brought(asked[: len(self.clock)], self.basis.numbers.band)
        longest = self.basis.numbers.longest_delay
        found = []
        for k, column in enumerate(pair.columns):
            if column in moving:
                reference = wanted[:, AXES.index(column)]
                sides = (delay(reference, side[:, k], self.test.dt, longest) for side in (pair.measured, pair.model))
                found.append(Lag(column, *map(float, sides)))
        return tuple(found)

    def spectrum(self) -> Spectrum:
        """Spectra of the platen's acceleration."""
        columns = self.test.plant.axes
        ours, noise = (x[:, columns] for x in self._accelerations())
        theirs = self._brought(self.moved[0].acceleration[:, columns], self.basis.sensors.band)
        return estimate_spectrum("acceleration", self.axes, ours, theirs, noise, self.test.dt, self.basis.numbers)

    def resonances(self) -> tuple[Resonance, ...]:
        """Oil columns; none without spool positions."""
        if "spool_position" not in self.test.test.record:
            return ()
        plant, numbers, wide = self.test.plant, self.basis.numbers, self.basis.sensors.band
        spool, more = (m.record["spool_position"].values[: self.n] for m in (self.test.test, self.test.again))
        ours, noise = (x[:, plant.axes] for x in self._accelerations())
        heard = more - spool, noise
        measured = estimate_response(plant, spool, ours, heard, self.test.dt, numbers)
        opened = self._brought(self.ran["spool_position"].values, wide)
        moved = self._brought(self.moved[0].acceleration[:, plant.axes], wide)
        model = estimate_response(plant, opened, moved, heard, self.test.dt, numbers)
        return find_resonances(self.axes, measured, model, self.basis.modes, numbers)

    def _motion(self, quantity: str) -> ComparedQuantity:
        axes = self.test.plant.axes
        tests = self.test.test, self.test.again

        def measured(draw: int) -> Array:
            return np.asarray(getattr(tests[draw].motion, quantity)[:, axes])

        def model(draw: int) -> Array:
            return np.asarray(getattr(self.moved[draw], quantity)[:, axes])

        return self._pair(quantity, self.axes, measured, model)

    def _wrench(self) -> ComparedQuantity:
        plant = self.test.plant
        tests, runs = (self.test.test, self.test.again), (self.ran, self.again)

        def measured(draw: int) -> Array:
            force = actuator_forces(plant.machine, tests[draw].channels)
            assert force is not None
            return total_wrench(plant, tests[draw].motion, force)[:, plant.axes]

        def model(draw: int) -> Array:
            return total_wrench(plant, self.moved[draw], runs[draw]["actuator_force"].values)[:, plant.axes]

        calibration = wrench_calibration(self.test, self.basis.sensors)[plant.axes]
        return self._pair("wrench", self.axes, measured, model, calibration)

    def _has(self, name: str) -> bool:
        if name in self.test.test.record:
            return name in self.ran
        self.notes.append(f"{name} was not recorded")
        return False

    def _channel(self, name: str) -> ComparedQuantity:
        tests, runs = (self.test.test.record, self.test.again.record), (self.ran, self.again)
        columns = [str(label) for label in self.ran[name][self.ran[name].dims[1]].values]
        return self._pair(name, columns, lambda i: tests[i][name].values, lambda i: runs[i][name].values)

    def _pair(
        self,
        quantity: str,
        columns: Sequence[str],
        measured: Callable[[int], Array],
        model: Callable[[int], Array],
        calibration: Array | None = None,
    ) -> ComparedQuantity:
        """Pair of a quantity; both sides are functions of the draw, 0 the test itself and 1 with more noise."""
        band, ours = self.basis.numbers.band, measured(0)
        theirs, heard = model(0), band.apply(measured(1) - ours, self.test.dt)[: self.n]
        noise = heard if self.again is self.ran else self._brought(model(1) - theirs, band) - heard
        kept = band.apply(ours, self.test.dt)[: self.n], self._brought(theirs, band)
        return ComparedQuantity(quantity, tuple(columns), *kept, heard.std(axis=0), noise.std(axis=0), calibration)

    def _brought(self, values: Array, band: Band) -> Array:
        """A run's values, filtered, at the test's samples: picked where these are samples of the run, else between."""
        step = self.clock[1] - self.clock[0]
        kept, every = band.apply(values, step), max(round(self.test.dt / step), 1)
        picked = self.clock[::every][: self.n]
        if len(picked) == self.n and np.allclose(picked, self.time, rtol=0.0, atol=1e-6 * step):
            return np.asarray(kept[::every][: self.n])
        return resample_band_limited(kept, self.clock, self.time)

    def _accelerations(self) -> tuple[Array, Array]:
        """Measured acceleration (n, 6), and what noise adds to it."""
        ours, more = (m.motion.acceleration[: self.n] for m in (self.test.test, self.test.again))
        return ours, more - ours
