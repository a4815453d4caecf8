"""Pairs of redundant channels: what is compared, and by how much calibration errors may make them differ.

`comparisons` turns a record into regressions y = X theta + noise, filtered by one band, for `consistency` to solve.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.names import AXES
from ..mechanics.accelerometers import sensitivities
from ..mechanics.gas_pressure import strut_pressures
from ..mechanics.plant import Plant
from ..mechanics.pose import PlatenMotion, forward_kinematics, kinematic_jacobian, leg_displacements
from .accelerometers import accelerometer_signals, rows_of
from .alignment import due_spools, hydraulic_force
from .channels import LAYOUT, channel_name
from .sensor_view import BAND, RecordView, Regressor, SensorComparison
from .sensors import SensorSet
from .signals import Band, differentiate

__all__ = ["LooseLength", "comparisons", "counterpart", "loose_lengths"]

FAST = 0.3  # of the sampling rate: above it a command is fast


def comparisons(plant: Plant, record: xr.Dataset, sensors: SensorSet) -> Iterator[SensorComparison]:
    """All comparisons for which a record has the channels."""
    view = RecordView(plant, record, sensors)
    for compare in (_forces, _lengths, _parity, _rates, _accelerometers, _struts, _supply, _spools, _redundant):
        yield from compare(view)


def counterpart(check: str) -> str:
    """Channel whose unit may as well be wrong where all gains of a check of `comparisons` are off; empty: none."""
    other = check.rpartition(" against ")[2]
    if other in LAYOUT:
        return other
    if check == "force against pressures":
        return "chamber_pressure"
    if "displacement" in check or "pose" in check or "gas law" in check:
        return "platen_displacement"
    return "spool_command" if check == "spool against command" else ""


class LooseLength(NamedTuple):
    """Length of an actuator against the platen's pose in one record, and on which side of its play the pin stands."""

    name: str
    comparison: SensorComparison
    sides: Array  # (c, n) of the force by each closing force, -1 to 1
    measured: Array  # (samples,) length at the record's rate [m]
    place: Array  # (n,) samples of the record that are compared

    def without(self, errors: Array) -> Array:
        """The length (samples,) [m] less the `errors` (n,) [m] of sensors and geometry at the samples compared."""
        return self.measured - np.interp(np.arange(len(self.measured)), self.place, errors)


def loose_lengths(
    plant: Plant, record: xr.Dataset, sensors: SensorSet, closing: Sequence[float]
) -> Iterator[LooseLength]:
    """Lengths of double-acting actuators against the platen's pose, each with the contact side of a loose pin.

    The side follows from the force, measured or of pressures; each of `closing` (c,) [N] may close most of the play.
    """
    view = RecordView(plant, record, sensors)
    by_cell = view.has("actuator_force")
    if not (by_cell or view.has("chamber_pressure_a", "chamber_pressure_b")):
        return
    force = view.values("actuator_force") if by_cell else hydraulic_force(plant.machine, record)
    sides = np.stack([view.signal(force / np.sqrt(force**2 + one**2)) for one in closing])
    compared = list(_lengths(view))  # none without lengths
    if not compared:
        return
    place = view.step * (view.trim + np.arange(sides.shape[1], dtype=np.float64))
    measured = view.values("actuator_displacement")
    for i, name in enumerate(plant.machine.actuator_names):
        if name in plant.machine.double_acting:
            yield LooseLength(name, compared[i], sides[:, :, i], measured[:, i], place)


def _delay_term(rate: Array, variance: float, nominal: float = 0.0) -> Regressor:
    return Regressor("delay", "s", nominal, rate, float(variance), delay=nominal)


def _gain_terms(
    due: Array, rate: Array, noise: tuple[float, float] = (0.0, 0.0), *, delay: float = 0.0, level: float = 0.0
) -> list[Regressor]:
    """Gain, delay and offset against the predicted column (n,) and its rate, with the noise variance of both."""
    offset = _offset_term(len(due), level)
    return [Regressor("gain", "1", 1.0, due, noise[0]), _delay_term(rate, noise[1], delay), offset]


def _offset_term(n: int, expected: float = 0.0) -> Regressor:
    return Regressor("offset", "", expected, np.ones(n))


def _forces(view: RecordView) -> Iterator[SensorComparison]:
    """actuator_force = P_A A_1 - P_B A_2."""
    if not view.has("actuator_force", "chamber_pressure_a"):
        return
    force = view.signal(view.values("actuator_force"))
    a, rate_a = view.signals(view.values("chamber_pressure_a"), 0, 1)
    noise = {n: (view.variance(n), view.variance(n, 1)) for n in ("actuator_force", "chamber_pressure_a")}
    both = view.has("chamber_pressure_b")
    if both:
        names = [str(n) for n in view.record["horizontal"].values]
        b, rate_b = view.signals(view.values("chamber_pressure_b"), 0, 1)
        noise["chamber_pressure_b"] = view.variance("chamber_pressure_b"), view.variance("chamber_pressure_b", 1)
    (gain_f, offset_f, delay_f), (gain_a, offset_a, delay_p) = map(view.sd, ("actuator_force", "chamber_pressure_a"))
    gain_b, offset_b, _ = view.sd("chamber_pressure_b")
    one = np.ones(len(force))
    for i, actuator in enumerate(view.plant.machine.actuators):
        area_a, area_b = actuator.area_a, actuator.area_b
        push, rate = area_a * a[:, i], area_a * rate_a[:, i]
        still = area_a**2 * noise["chamber_pressure_a"][1][i]
        terms = [Regressor("gain a", "1", 1.0, push, area_a**2 * noise["chamber_pressure_a"][0][i])]
        errors = [gain_f * force[:, i], offset_f * one, gain_a * push, area_a * offset_a * one]
        if area_b is not None:
            if not (both and actuator.name in names):
                continue
            j = names.index(actuator.name)
            pull, rate = -area_b * b[:, j], rate - area_b * rate_b[:, j]
            still += area_b**2 * noise["chamber_pressure_b"][1][j]
            terms.append(Regressor("gain b", "1", 1.0, pull, area_b**2 * noise["chamber_pressure_b"][0][j]))
            errors += [gain_b * pull, area_b * offset_b * one]
        errors += [delay_f * rate, delay_p * rate]
        terms += [_delay_term(rate, still), _offset_term(len(force))]
        channel, variance = f"actuator_force[{actuator.name}]", noise["actuator_force"][0][i]
        yield view.compared("force against pressures", channel, force[:, i], variance, terms, errors)


def _geometry(view: RecordView, pose: Array) -> list[Array]:
    """Changes of the actuators' elongations (n, actuators) by one standard deviation of each coordinate."""
    plant, parameters = view.plant, view.plant.machine.parameters

    def elongations(legs: NDArray[np.void]) -> Array:
        """From the zero-position of these legs."""
        lengths, _ = leg_displacements(replace(plant, legs=legs), np.vstack([np.zeros(6), pose]))
        return lengths[1:, : plant.spools] - lengths[0, : plant.spools]

    nominal, changes = elongations(plant.legs), []
    for field, key in (("rho", "platen_point"), ("base_point", "base_point")):
        for axis in range(3):
            legs = plant.legs.copy()
            for row, component in zip(legs, plant.machine.components, strict=True):
                sd = parameters[f"{component.name}.{key}"].sd
                row[field][axis] += sd[axis] if isinstance(sd, tuple) else 0.0
            changes.append(elongations(legs) - nominal)
    return changes


def _lengths(view: RecordView) -> Iterator[SensorComparison]:
    """actuator_displacement against that of the measured platen pose; it may drift by its noise within a record."""
    if not view.has("actuator_displacement", "platen_displacement"):
        return
    plant, pose = view.plant, view.values("platen_displacement")
    legs = leg_displacements(plant, pose)[0][:, : plant.spools]
    measured, (due, rate) = view.signal(view.values("actuator_displacement")), view.signals(legs, 0, 1)
    slow, jacobian = view.signal(pose), kinematic_jacobian(plant)
    noise = [jacobian**2 @ view.variance("platen_displacement", k) for k in (0, 1)]
    variance, geometry = view.variance("actuator_displacement"), _geometry(view, slow)
    gain_l, offset_l, delay_l = view.sd("actuator_displacement")
    gain_x, offset_x, delay_x = view.sd("platen_displacement")
    one = np.ones(len(slow))
    time = view.step * view.dt * (np.arange(len(slow), dtype=np.float64) - 0.5 * (len(slow) - 1))
    for i, name in enumerate(plant.machine.actuator_names):
        terms = _gain_terms(due[:, i], rate[:, i], (noise[0][i], noise[1][i]))
        terms.append(Regressor("drift", "m/s", 0.0, time, 0.0, beside=True))
        errors = [gain_l * due[:, i], offset_l * one, delay_l * rate[:, i], delay_x * rate[:, i]]
        errors.append(np.sqrt(variance[i]) * time / (view.step * view.dt * max(len(time) - 1, 1)))
        errors += [jacobian[i, k] * (gain_x * slow[:, k] + offset_x) for k in range(6)]
        errors += [change[:, i] for change in geometry]
        check, channel = "length against platen pose", f"actuator_displacement[{name}]"
        yield view.compared(check, channel, measured[:, i], variance[i], terms, errors)


def _parity(view: RecordView) -> Iterator[SensorComparison]:
    """Combinations of the actuators' lengths that are zero at any pose: one for each actuator in excess of the axes."""
    plant = view.plant
    if not view.has("actuator_displacement"):
        return
    left, _, _ = np.linalg.svd(kinematic_jacobian(plant)[:, plant.axes])
    null = left[:, plant.axes.size :]  # (actuators, combinations)
    if not null.shape[1]:
        return
    lengths = view.signal(view.values("actuator_displacement"))
    pose, _ = forward_kinematics(plant, lengths)
    rest = lengths - leg_displacements(plant, pose)[0][:, : plant.spools]
    gain, offset, _ = view.sd("actuator_displacement")
    errors = [*_geometry(view, pose), gain * lengths, np.full_like(lengths, offset)]
    variance = view.variance("actuator_displacement")
    for k, combination in enumerate(null.T):
        signals = [c * e[:, i] for i, c in enumerate(combination) for e in errors]
        y, channel = rest @ combination, f"actuator_displacement[parity {k + 1}]"
        yield view.compared("kinematic parity", channel, y, combination**2 @ variance, [], signals)


def _rates(view: RecordView) -> Iterator[SensorComparison]:
    """platen_velocity and platen_acceleration against derivatives of platen_displacement.

    An accelerometer may have cross-talk; as much as its gain uncertainty is allowed.
    """
    base = "platen_displacement"
    for order, name in ((1, "platen_velocity"), (2, "platen_acceleration")):
        if not view.has(base, name):
            continue
        measured = view.signal(view.values(name))
        due, rate = view.signals(view.values(base), order, order + 1)
        variance, noise = view.variance(name), [view.variance(base, order + k) for k in (0, 1)]
        (gain_m, offset_m, delay_m), (gain_x, _, delay_x) = map(view.sd, (name, base))
        for j in view.plant.axes:
            terms = _gain_terms(due[:, j], rate[:, j], (noise[0][j], noise[1][j]))
            errors = [gain_m * due[:, j], gain_x * due[:, j], delay_m * rate[:, j], delay_x * rate[:, j]]
            errors.append(offset_m * np.ones(len(due)))
            across = [k for k in view.plant.axes if k < 3 and k != j] if order == 2 and j < 3 else []
            terms += [Regressor(f"cross {AXES[k]}", "1", 0.0, due[:, k], noise[0][k], beside=True) for k in across]
            errors += [gain_m * due[:, k] for k in across]
            check = f"{name.split('_')[1]} against displacement"
            yield view.compared(check, f"{name}[{AXES[j]}]", measured[:, j], variance[j], terms, errors)


def _accelerometers(view: RecordView) -> Iterator[SensorComparison]:
    """Each accelerometer against what it should read, gravity by tilt included, in the motion of platen_displacement.

    Other directions of the platen's motion are its cross-talk; as much as its gain uncertainty is allowed.
    """
    name, base = "point_acceleration", "platen_displacement"
    if not view.has(base, name):
        return
    plant, rows = view.plant, rows_of(view.record)
    measured = view.signal(view.values(name))
    motion = PlatenMotion(*view.signals(view.values(base), 0, 1, 2))
    due = accelerometer_signals(plant, motion, rows)
    rate = differentiate(due, view.step * view.dt)
    noise = [view.variance(base, order) @ sensitivities(rows).T ** 2 for order in (2, 3)]
    variance = np.broadcast_to(view.variance(name), len(rows))
    (gain_m, offset_m, delay_m), (gain_x, _, delay_x) = map(view.sd, (name, base))
    across = gain_m * np.abs(motion.acceleration[:, :3]).max(axis=1)
    for i in range(len(rows)):
        terms = _gain_terms(due[:, i], rate[:, i], (noise[0][i], noise[1][i]))
        errors = [gain_m * due[:, i], gain_x * due[:, i], delay_m * rate[:, i], delay_x * rate[:, i]]
        errors += [offset_m * np.ones(len(due)), across]
        channel = channel_name(view.record[name], i)
        yield view.compared("accelerometer against displacement", channel, measured[:, i], variance[i], terms, errors)


def _struts(view: RecordView) -> Iterator[SensorComparison]:
    """strut_pressure against P_0 (1 + dL / L_c0)^-n of the platen's pose; the offset is that level, P_0."""
    plant, machine = view.plant, view.plant.machine
    if not view.has("strut_pressure") or not view.has("platen_displacement"):
        return
    elongation = leg_displacements(plant, view.values("platen_displacement"))[0][:, plant.spools :]
    level = np.array([s.pressure for s in machine.struts])
    due = strut_pressures(machine, elongation) - level
    if not np.isfinite(due).all():  # a wrong unit of displacement leaves no length of gas
        return
    measured, (swing, rate) = view.signal(view.values("strut_pressure")), view.signals(due, 0, 1)
    if np.any(level + swing <= 0.0):
        return
    variance = view.variance("strut_pressure")
    (gain_p, offset_p, delay_p), (gain_x, _, delay_x) = map(view.sd, ("strut_pressure", "platen_displacement"))
    one = np.ones(len(swing))
    for k, strut in enumerate(machine.struts):
        terms = _gain_terms(swing[:, k], rate[:, k], level=level[k])
        spread = {key: _relative_sd(view, strut, key) for key in ("pressure", "polytropic_index")}
        whole = level[k] + swing[:, k]
        errors = [gain_p * whole, offset_p * one, gain_x * swing[:, k], delay_p * rate[:, k], delay_x * rate[:, k]]
        errors += [spread["pressure"] * whole, spread["polytropic_index"] * whole * np.log(whole / level[k])]
        channel = f"strut_pressure[{strut.name}]"
        yield view.compared("strut pressure against gas law", channel, measured[:, k], variance[k], terms, errors)


def _relative_sd(view: RecordView, component: Any, key: str) -> float:
    parameters = view.plant.machine.parameters
    path = f"{component.name}.{key}" if f"{component.name}.{key}" in parameters else f"{component.kind}.{key}"
    sd = parameters[path].sd
    return float(sd) / parameters.number(path) if isinstance(sd, float) else 0.0


def _supply(view: RecordView) -> Iterator[SensorComparison]:
    """supply_pressure against the nominal one."""
    if view.has("supply_pressure"):
        name, nominal = "supply_pressure", view.plant.machine.hydraulics.supply_pressure
        y, (gain, offset, _) = view.signal(view.values(name))[:, 0], view.sd(name)
        errors, terms = [gain * y, offset * np.ones(len(y))], [_offset_term(len(y), nominal)]
        yield view.compared("supply pressure against nominal", name, y, view.variance(name)[0], terms, errors)


def _spools(view: RecordView) -> Iterator[SensorComparison]:
    """spool_position against the command, late by the valve's delay.

    Commands are recorded without a low-pass filter: their fast part bounds the aliasing.
    """
    if not view.has("spool_command", "spool_position"):
        return
    command = due_spools(view.plant, view.values("spool_command"), view.dt)
    measured, (due, rate) = view.signal(view.values("spool_position")), view.signals(command, 0, 1)
    fast = command - Band(high=FAST / view.dt).apply(command, view.dt)
    folded = fast[:: view.step][view.trim :][: len(due)] * np.sqrt(2 * BAND.high * view.dt)
    variance = view.variance("spool_position")
    gain, offset, delay = view.sd("spool_position")
    for i, name in enumerate(view.plant.machine.actuator_names):
        terms = _gain_terms(due[:, i], rate[:, i], delay=view.plant.delays[i])
        errors = [gain * due[:, i], offset * np.ones(len(due)), delay * rate[:, i], folded[:, i]]
        channel = f"spool_position[{name}]"
        yield view.compared("spool against command", channel, measured[:, i], variance[i], terms, errors)


def _redundant(view: RecordView) -> Iterator[SensorComparison]:
    """A redundant channel against the one of the same quantity."""
    for name, base in ((n, c.same_as) for n, c in LAYOUT.items() if c.same_as and view.has(n, c.same_as)):
        measured, (due, rate) = view.signal(view.values(name)), view.signals(view.values(base), 0, 1)
        variance, noise = view.variance(name), [view.variance(base, k) for k in (0, 1)]
        (gain, offset, delay), (gain_b, offset_b, delay_b) = map(view.sd, (name, base))
        for i in range(measured.shape[1]):
            terms = _gain_terms(due[:, i], rate[:, i], (noise[0][i], noise[1][i]))
            errors = [g * due[:, i] for g in (gain, gain_b)] + [d * rate[:, i] for d in (delay, delay_b)]
            errors += [o * np.ones(len(due)) for o in (offset, offset_b)]
            channel = channel_name(view.record[name], i)
            yield view.compared(f"{name} against {base}", channel, measured[:, i], variance[i], terms, errors)
