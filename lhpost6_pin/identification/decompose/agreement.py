"""Agreement of modelled and measured forces, and the residual expected from sensors and parameters.

The residual is the required less the measured actuator wrench. Its mean and standard deviation are compared with those
expected from:

    noise       a second draw of the sensors' noise, added to the record, which is decomposed again
    sensors     gains and offsets of force sensors; the skew between forces and motion; a gain of each axis's motion
    parameters  uncertain numbers of the platen and of each kind of actuator and strut, without geometry

Errors are propagated linearly, each at one standard deviation, as independent: their effects add in squares.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from ...core.arrays import Array, Mask
from ...data.alignment import phase_delay
from ...data.at_rest import at_rest
from ...data.channels import LAYOUT
from ...data.sensors import SensorSet
from ...data.signals import Band, correlation, differentiate, peak_ratio, rrmse
from ...mechanics.plant import make_plant
from ...mechanics.pose import PlatenMotion
from ..inverse_dynamics import leg_wrenches
from ..prepare import AS_RECORDED, prepare_noisier
from ..residuals import evaluate_residuals, follow
from .interface import InterfaceWrench, find_interface, interface_at
from .record import Decomposed, decompose_numbers, decompose_test

__all__ = ["WrenchAgreement", "Explanation", "Level", "Match", "find_agreement"]


Explanation = Literal["none needed", "noise", "sensors", "parameters", "nothing"]
"""Sufficient explanation of a residual."""


class Match(NamedTuple):
    """Modelled against measured forces, per axis (6,); the measured ones are the reference.

    An axis without any measured force but rounding is at rest: its ratios and correlation are NaN, and so is that of
    means removed where nothing but rounding varies.
    """

    at_rest: Mask
    difference: Array  # rms of modelled less measured [N, N m]
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


class Change(NamedTuple):
    """Changes (n, 6) at C in {c} of the residual, and of what the platen carries (`Decomposition.carried`)."""

    residual: Array
    carried: Array


class Changes(NamedTuple):
    """Sum in squares of changes."""

    residual: Level
    interface: Array  # (n, 6) over time, at the interface


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
    interface: InterfaceWrench | None  # None: no specimen, and no floors measured

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
        enough = [found <= most for most in (np.maximum(noise, tiny), by_sensors, by_all)]
        return tuple(np.select(enough, ["noise", "sensors", "parameters"], "nothing").tolist())


def find_agreement(found: Decomposed, *, seed: int = 0) -> WrenchAgreement:
    """Compare forces, and the residual with that expected from noise (drawn from seed), sensors and parameters."""
    numbers, forces, sensors = decompose_numbers(), found.forces, found.sensors
    required, struts = numbers.number("judgement.correlation"), forces.struts_measured
    none = Changes(Level(np.zeros(6), np.zeros(6)), np.zeros((len(found.time), 6)))
    noise = by_sensors = by_parameters = none
    if sensors is not None:
        noise = summed(found, [_noise(found, sensors, np.random.default_rng(seed))])
        by_sensors = summed(found, _by_sensors(found, sensors))
        by_parameters = summed(found, _by_parameters(found))
    return WrenchAgreement(
        actuators=_match(found, forces.measured, forces.required, required),
        struts=None if struts is None else _match(found, struts, forces.struts, required),
        dissipative=_match(found, forces.dissipative_measured, forces.dissipative, required),
        residual=_level(forces.residual),
        noise=noise.residual.varying,
        sensors=by_sensors.residual,
        parameters=by_parameters.residual,
        noise_range=0.0 if sensors is None else sensors.noise_range,
        coverage=numbers.number("judgement.coverage"),
        interface=find_interface(found, noise.interface, by_sensors.interface, by_parameters.interface),
    )


def _match(found: Decomposed, measured: Array, modelled: Array, required: float) -> Match:
    """Agreement of forces; their delay where the correlation of what varies is at least `required`."""
    band, dt = found.comparison.band, found.dt
    varying = rrmse(measured - measured.mean(axis=0), modelled - modelled.mean(axis=0))
    moving = Band(band.high / 16, band.high, band.order)  # above the window's lobe
    known = correlation(moving.apply(measured, dt), moving.apply(modelled, dt)) >= required
    late, error = (np.where(known, x, np.nan) for x in phase_delay(measured, modelled, dt, moving))
    largest = float(np.abs(found.forces.measured).max())
    still = at_rest(measured, largest)
    varying = np.where(at_rest(measured - measured.mean(axis=0), largest), np.nan, varying)
    ratios = rrmse(measured, modelled), varying, peak_ratio(measured, modelled), correlation(measured, modelled)
    difference = np.sqrt(np.mean((modelled - measured) ** 2, axis=0))
    return Match(still, difference, *(np.where(still, np.nan, x) for x in (*ratios, late, error)))


def _level(x: Array) -> Level:
    return Level(x.mean(axis=0), x.std(axis=0))


def summed(found: Decomposed, changes: Iterable[Change]) -> Changes:
    """Sum in squares of independent changes: levels of the residual, and of what is carried over time."""
    total, carried = np.zeros((2, 6)), np.zeros((len(found.time), 6))
    for change in changes:
        total += np.square(_level(found.compared(change.residual)))
        carried += np.square(interface_at(found, found.compared(change.carried)))
    return Changes(Level(*np.sqrt(total)), np.sqrt(carried))


def _noise(found: Decomposed, sensors: SensorSet, rng: np.random.Generator) -> Change:
    """Change by a second draw of noise."""
    policy = AS_RECORDED._replace(band=found.comparison.band, edge=found.comparison.edge)
    noisier = prepare_noisier(found.plant, found.record, sensors, policy, rng)
    drawn = decompose_test(found.mounted, noisier, found.whole.states.z[0])[0]
    return Change(drawn.residual - found.whole.residual, drawn.carried - found.whole.carried)


def _by_sensors(found: Decomposed, sensors: SensorSet) -> Iterator[Change]:
    """Changes by one standard deviation of each calibration error."""
    whole, record = found.whole, found.record
    unit = leg_wrenches(found.plant, whole.states.q, np.ones((len(whole.states.time), whole.actuators)))
    ways = (("actuator_force",), ("chamber_pressure_a", "chamber_pressure_b"), ("pressure_difference",))
    channels = next(way for way in ways if way[0] in record)  # as `actuator_forces` prefers them
    for k, actuator in enumerate(found.plant.machine.actuators):
        areas = (1.0,) if channels == ways[0] else (actuator.area_a, actuator.area_b)
        for channel, area in zip(channels, areas, strict=False):
            if area is None:
                continue
            values = record[channel].sel({LAYOUT[channel].dims[1]: actuator.name}).values
            yield _of_force(unit[:, k] * (area * sensors.gain_sd(channel) * values[:, None]))
            yield _of_force(unit[:, k] * (area * sensors.offset_sd(channel)))
    skew = np.hypot(sensors.delay_sd(LAYOUT[channels[0]].group or channels[0]), sensors.delay_sd("platen_displacement"))
    yield _of_force(skew * differentiate(whole.measured, found.dt, sensors.band.high))
    used = [name for name in ("actuator_displacement", "platen_displacement", "platen_acceleration") if name in record]
    gain = max(sensors.gain_sd(name) for name in used)
    for axis in found.plant.axes if gain else ():
        scaled = [x.copy() for x in found.test.motion]
        for x in scaled:
            x[:, axis] *= 1.0 + gain
        moved = decompose_test(found.mounted, replace(found.test, motion=PlatenMotion(*scaled)), whole.states.z[0])[0]
        yield Change(moved.residual - whole.residual, moved.carried - whole.carried)


def _of_force(change: Array) -> Change:
    """A change (n, 6) of the measured forces alone."""
    return Change(change, change)


def _by_parameters(found: Decomposed) -> Iterator[Change]:
    """Changes by one standard deviation of each number of the platen and the kinds."""
    machine, measured = found.plant.machine, found.test
    nominal = follow(found.plant, measured)
    as_is = evaluate_residuals(found.plant, measured, ("wrench",), path=nominal).wrench
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
            moved = follow(plant, measured, (found.plant, nominal))
            yield _of_force(evaluate_residuals(plant, measured, ("wrench",), path=moved).wrench - as_is)
