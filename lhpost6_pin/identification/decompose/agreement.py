"""Agreement of modelled and measured forces, and the residual expected from sensors and parameters.

The residual is the required less the measured actuator wrench. Its mean and standard deviation are compared with those
expected from:

    noise       another draw of the sensors' noise, added to the record and decomposed again
    sensors     gains and offsets of forces through the legs' wrenches; the skew between forces and motion times the
                rate of the wrench; a gain of each axis's motion, through the model. Each at one standard deviation,
                independent of each other
    parameters  every stated uncertainty of the platen's numbers and of the kinds of actuators and struts, one by one,
                at one standard deviation, without geometry

Linear propagation: changes of the residual by each error, added in squares.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from ...core.arrays import Array
from ...data.alignment import phase_delay
from ...data.sensors import SensorSet, add_noise
from ...data.signals import Band, correlation, differentiate, peak_ratio, rrmse
from ...machine.machine import Machine
from ...mechanics.plant import make_plant
from ...mechanics.pose import PlatenMotion
from ..inverse_dynamics import leg_wrenches
from ..prepare import AS_RECORDED, prepare_test
from ..residuals import evaluate_residuals, follow
from .record import Decomposed, decompose_numbers, take_apart

__all__ = ["WrenchAgreement", "Explanation", "Level", "Match", "find_agreement"]


Explanation = Literal["none needed", "noise", "sensors", "parameters", "nothing"]
"""Sufficient explanation of a residual."""


class Match(NamedTuple):
    """Modelled against measured forces, per axis (6,); the measured ones are the reference."""

    rrmse: Array
    rrmse_varying: Array  # means removed
    peak_ratio: Array
    correlation: Array
    delay: Array  # of the modelled behind the measured [s]; NaN where they are not correlated
    delay_error: Array  # standard error [s]


class Level(NamedTuple):
    """Mean and standard deviation over time of a wrench, per axis (6,) [N, N m]."""

    offset: Array
    varying: Array


@dataclass(frozen=True)
class WrenchAgreement:
    """Agreement of a decomposed record with its measured forces."""

    actuators: Match
    struts: Match | None  # None: no strut pressures
    dissipative: Match
    residual: Level
    noise: Array  # (6,) expected standard deviation [N, N m]
    sensors: Level  # expected from calibration errors
    parameters: Level  # expected from the machine's numbers
    noise_range: float  # relative uncertainty of the noise
    coverage: float  # standard deviations of sensors and parameters that are allowed

    @property
    def noise_ratio(self) -> Array:
        """Standard deviation of the residual over that of the noise (6,); NaN without noise."""
        return np.divide(self.residual.varying, self.noise, out=np.full(6, np.nan), where=self.noise > 0.0)

    @property
    def varying_explained(self) -> tuple[Explanation, ...]:
        """Sufficient explanation of the varying part of the residual, per axis."""
        most = (1.0 + self.noise_range) * self.noise
        return self._explained(self.residual.varying, most, self.sensors.varying, self.parameters.varying)

    @property
    def offset_explained(self) -> tuple[Explanation, ...]:
        """Sufficient explanation of the mean of the residual, per axis; noise has none."""
        zero = np.zeros(6)
        return self._explained(np.abs(self.residual.offset), zero, self.sensors.offset, self.parameters.offset)

    def _explained(self, found: Array, noise: Array, sensors: Array, parameters: Array) -> tuple[Explanation, ...]:
        if not self.noise.any():
            return ("none needed",) * 6
        by_sensors = np.hypot(noise, self.coverage * sensors)
        by_all = np.hypot(by_sensors, self.coverage * parameters)
        tiny = 1e-9 * self.noise.max()  # an axis in which a guided platen cannot move

        def of_axis(k: int) -> Explanation:
            if found[k] <= max(noise[k], tiny):
                return "noise"
            if found[k] <= by_sensors[k]:
                return "sensors"
            return "parameters" if found[k] <= by_all[k] else "nothing"

        return tuple(of_axis(k) for k in range(6))


def find_agreement(found: Decomposed, *, seed: int = 0) -> WrenchAgreement:
    """Compare forces, and the residual with that expected from noise (drawn from seed), sensors and parameters."""
    numbers = decompose_numbers()
    forces = found.forces
    struts = forces.struts_measured
    required = numbers.number("judgement.correlation")

    def match(measured: Array, modelled: Array) -> Match:
        return _match(measured, modelled, found.dt, found.comparison.band, required)

    sensors = found.sensors
    none = np.zeros(6)
    return WrenchAgreement(
        actuators=match(forces.measured, forces.required),
        struts=None if struts is None else match(struts, forces.struts),
        dissipative=match(forces.dissipative_measured, forces.dissipative),
        residual=_level(forces.residual),
        noise=none if sensors is None else _noise(found, sensors, np.random.default_rng(seed)),
        sensors=Level(none, none) if sensors is None else _summed(found, _by_sensors(found, sensors)),
        parameters=Level(none, none) if sensors is None else _summed(found, _by_parameters(found)),
        noise_range=0.0 if sensors is None else sensors.noise_range,
        coverage=numbers.number("judgement.coverage"),
    )


def _match(measured: Array, modelled: Array, dt: float, band: Band, required: float) -> Match:
    correlated = correlation(measured, modelled)
    varying = rrmse(measured - measured.mean(axis=0), modelled - modelled.mean(axis=0))
    moving = Band(band.high / 16, band.high, band.order)  # above the window's lobe
    late, error = phase_delay(measured, modelled, dt, moving)
    known = correlation(moving.apply(measured, dt), moving.apply(modelled, dt)) >= required
    late, error = (np.where(known, x, np.nan) for x in (late, error))
    return Match(rrmse(measured, modelled), varying, peak_ratio(measured, modelled), correlated, late, error)


def _level(x: Array) -> Level:
    return Level(x.mean(axis=0), x.std(axis=0))


def _summed(found: Decomposed, changes: Iterator[Array]) -> Level:
    """Sum in squares of the levels of changes (n, 6) of the residual, each filtered and cut as the residual was."""
    total = np.zeros((2, 6))
    for change in changes:
        total += np.square(_level(found.comparison.band.apply(change, found.dt)[found.inside]))
    return Level(*np.sqrt(total))


def _noise(found: Decomposed, sensors: SensorSet, rng: np.random.Generator) -> Array:
    policy = AS_RECORDED._replace(band=found.comparison.band)
    noisier, _ = take_apart(
        found.plant, prepare_test(found.plant, add_noise(found.record, sensors, rng), sensors, policy)
    )
    change = noisier.residual - found.whole.residual
    return np.asarray(found.comparison.band.apply(change, found.dt)[found.inside].std(axis=0))


def _by_sensors(found: Decomposed, sensors: SensorSet) -> Iterator[Array]:
    """Change (n, 6) of the residual by one standard deviation of each calibration error."""
    whole, record, machine = found.whole, found.record, found.plant.machine
    count = whole.actuators
    unit = leg_wrenches(found.plant, whole.states.q, np.ones((len(whole.states.time), count)))
    if "actuator_force" in record:
        group, oil = "actuator_force", [("actuator_force", k, 1.0, whole.component_force[:, k]) for k in range(count)]
    else:
        group, oil = "chamber_pressure", list(_pressures(machine, found))
    for channel, k, area, values in oil:
        yield unit[:, k] * (area * sensors.gain_sd(channel) * values[:, None])
        yield unit[:, k] * (area * sensors.offset_sd(channel))
    skew = np.hypot(sensors.delay_sd(group), sensors.delay_sd("platen_displacement"))
    yield skew * differentiate(whole.measured, found.dt, sensors.band.high)
    used = [name for name in ("actuator_displacement", "platen_displacement", "platen_acceleration") if name in record]
    gain = max(sensors.gain_sd(name) for name in used)
    for axis in found.plant.axes:
        scaled = [x.copy() for x in found.test.motion]
        for x in scaled:
            x[:, axis] *= 1.0 + gain
        other = replace(found.test, motion=PlatenMotion(*scaled))
        yield evaluate_residuals(found.plant, other, ("wrench",)).wrench - whole.residual


def _pressures(machine: Machine, found: Decomposed) -> Iterator[tuple[str, int, float, Array]]:
    """Channel, actuator, area and values of every chamber's pressure."""
    for k, actuator in enumerate(machine.actuators):
        yield "chamber_pressure_a", k, actuator.area_a, found.record["chamber_pressure_a"].values[:, k]
        if actuator.area_b is not None:
            values = found.record["chamber_pressure_b"].sel(horizontal=actuator.name).values
            yield "chamber_pressure_b", k, actuator.area_b, values


def _by_parameters(found: Decomposed) -> Iterator[Array]:
    """Change (n, 6) of the residual by one standard deviation of each number of the platen and the kinds."""
    machine, measured = found.plant.machine, found.test
    as_it_is = follow(found.plant, measured)
    sections = {"platen", *(c.kind for c in machine.components)}
    for path, quantity in machine.parameters.items():
        section, _, name = path.partition(".")
        if section not in sections or quantity.sd is None or name == "bearing_plane":  # moves with the swivels
            continue
        values, sds = np.atleast_1d(quantity.value), np.atleast_1d(quantity.sd)
        for k, sd in enumerate(np.broadcast_to(sds, values.shape)):
            shifted = values.astype(float)
            shifted[k] += sd
            value = shifted.tolist() if isinstance(quantity.value, tuple) else float(shifted[0])
            plant = make_plant(machine.with_params({path: value}))
            moved = follow(plant, measured, (found.plant, as_it_is))
            yield evaluate_residuals(plant, measured, ("wrench",), path=moved).wrench - found.whole.residual
