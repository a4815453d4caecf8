"""What the tests of sensors share: a smooth motion, as every sensor of the machine would measure it without noise."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from lhpost6_pin.data.records import make_record
from lhpost6_pin.mechanics.gas_pressure import strut_pressures
from lhpost6_pin.mechanics.plant import Plant
from lhpost6_pin.mechanics.pose import PlatenMotion, leg_displacements

RATE = 512.0
AMPLITUDE = np.array([0.1, 0.07, 0.02, 0.004, 0.004, 0.007])  # about, at 1 Hz; x y z roll pitch yaw


def waves(t: np.ndarray, amplitude: np.ndarray, seed: int, highest: float = 20.0) -> list[np.ndarray]:
    """Sums of sines up to `highest` Hz with their first two derivatives, (n, columns) each."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * rng.uniform(0.2, highest, (40, len(amplitude)))
    size = amplitude / 6 / np.maximum(1.0, omega / (2 * np.pi)) ** 2
    angle = np.multiply.outer(t, omega) + rng.uniform(0, 2 * np.pi, omega.shape)
    sine, cosine = size * np.sin(angle), size * omega * np.cos(angle)
    return [x.sum(axis=1) for x in (sine, cosine, -(omega**2) * sine)]


def measured(plant: Plant, seed: int = 0, duration: float = 20.0) -> tuple[xr.Dataset, PlatenMotion]:
    """Record of sensors without noise that agree with each other, and its motion; pressures follow no dynamics.

    The record is the caller's own; the motion is read only by agreement.
    """
    key = id(plant), seed, duration
    if key not in _MADE:
        if len(_MADE) == _MOST:
            _MADE.clear()
        _MADE[key] = plant, *_measured(plant, seed, duration)
    _, record, motion = _MADE[key]
    return record.copy(deep=True), motion


_MADE: dict[tuple[int, int, float], tuple[Plant, xr.Dataset, PlatenMotion]] = {}
"""What was made last, with its plant, so that no other one has its id: to make one takes a second."""
_MOST = 6


def _measured(plant: Plant, seed: int, duration: float) -> tuple[xr.Dataset, PlatenMotion]:
    machine = plant.machine
    t = np.arange(round(duration * RATE)) / RATE
    motion = PlatenMotion(*waves(t, AMPLITUDE, seed))
    legs, _ = leg_displacements(plant, motion.displacement)
    count, double = plant.spools, len(machine.double_acting)
    a = 6e6 + waves(t, np.full(count, 3e7), seed + 1)[0]
    b = 8e6 + waves(t, np.full(double, 4e7), seed + 2)[0]
    areas_b = np.array([x.area_b for x in machine.actuators if x.area_b is not None])
    force = a * [x.area_a for x in machine.actuators]
    force[:, [x.area_b is not None for x in machine.actuators]] -= b * areas_b
    command, late = (waves(t - tau, np.full(count, 0.3), seed + 3)[0] for tau in (0.0, plant.delays[0]))
    channels = {
        "platen_displacement": motion.displacement,
        "platen_velocity": motion.velocity,
        "platen_acceleration": motion.acceleration,
        "actuator_displacement": legs[:, :count],
        "actuator_force": force,
        "chamber_pressure_a": a,
        "chamber_pressure_b": b,
        "strut_pressure": strut_pressures(machine, legs[:, count:]),
        "supply_pressure": np.full(len(t), machine.hydraulics.supply_pressure),
        "spool_command": command,
        "spool_position": late,
    }
    labels = {"actuator": machine.actuator_names, "horizontal": machine.double_acting, "strut": machine.strut_names}
    return make_record(t, channels, labels, {"kind": "simulated"}), motion


def with_change(records: list[xr.Dataset], name: str, change: Callable) -> list[xr.Dataset]:
    """Records with one channel's values (n, k) changed."""
    return [r.assign({name: r[name].copy(data=change(r[name].values.copy()))}) for r in records]


def scaled(column: int, factor: float, offset: float = 0.0) -> Callable:
    """A change of one column by a factor and an offset."""

    def change(values: np.ndarray) -> np.ndarray:
        values[:, column] = factor * values[:, column] + offset
        return values

    return change
