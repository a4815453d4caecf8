"""Capacity of the machine by the model, beside Table 2.2."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import OutOfRangeError
from ..core.names import AXES
from ..machine.machine import Machine
from .plant import Plant, make_plant
from .pose import kinematic_jacobian, leg_displacements
from .rigid_body import platen_inertia

__all__ = ["Capacity", "capacity_table", "has_printed_capacity", "actuator_speeds", "make_actuator_check"]

ActuatorCheck = Callable[[Array, Array], tuple[Array, tuple[str, ...], Array]]


class Capacity(NamedTuple):
    """One line: what, the model's value, Table 2.2's, its unit and how the model's came about."""

    name: str
    model: float
    printed: float
    unit: str
    how: str

    @property
    def deviation(self) -> float:
        """Model over Table 2.2, less one."""
        return self.model / self.printed - 1.0


def has_printed_capacity(machine: Machine) -> bool:
    """Whether a machine file states Table 2.2, which `capacity_table` needs."""
    return "table_2_2.force_actuators" in machine.parameters


def capacity_table(machine: Machine) -> tuple[Capacity, ...]:
    """Peak forces, accelerations, velocities, rotations and strokes of a six-axis machine against Table 2.2.

    Peak velocities are with all servovalves open (two on each double-acting actuator), as the table's are.
    Raises OutOfRangeError for a guided machine, for which there is no such table.
    """
    if machine.motion != "free" or "table_2_2.force_actuators" not in machine.parameters:
        raise OutOfRangeError(
            f"{machine.name} has no Table 2.2 to compare with; it is a {machine.motion}-guided machine"
        )
    plant = make_plant(machine)
    return (*_forces(plant), *_speeds(machine), *_travel(plant))


def _forces(plant: Plant) -> list[Capacity]:
    machine, par = plant.machine, plant.machine.parameters
    high, low = plant.supply[:2]
    jacobian = kinematic_jacobian(plant)
    area_a, area_b = plant.actuators.area_a, plant.actuators.area_b
    push, pull = high * area_a - low * area_b, low * area_a - high * area_b
    hold_down = sum(s.pressure * s.area for s in machine.struts)
    printed, accelerations = (par.vector(f"table_2_2.{x}_actuators") for x in ("force", "acceleration"))
    rows = []
    for k, name in enumerate("XY"):
        force = float(np.sum(np.maximum(jacobian[:, k] * push, jacobian[:, k] * pull)))
        rows.append((f"peak force {name}", force, printed[k], "N", "supply against return in all actuators"))
    up = float(jacobian[:, 2] @ np.where(jacobian[:, 2] > 0.0, push, pull)) - hold_down
    rows.append(("peak force Z up", up, printed[2], "N", "supply in all chambers, less hold-down"))
    left = par.number("table_2_2.chamber_pressure_down")
    down, most = hold_down - float(jacobian[:, 2] @ (left * area_a)), par.number("table_2_2.force_down")
    rows.append(("peak force Z down", down, most, "N", f"hold-down less {left / 1e6:.3g} MPa in the chambers"))
    _, mass = platen_inertia(plant.model, machine)
    weight = mass[2, 2] * machine.platen.gravity
    for k, name in enumerate(("X", "Y", "Z up")):
        value = (rows[k][1] - (weight if k == 2 else 0.0)) / mass[k, k]
        rows.append((f"peak acceleration {name}", value, accelerations[k], "m/s2", "peak force over effective mass"))
    value, most = (down + weight) / mass[2, 2], machine.limits.acceleration[2]
    rows.append(("peak acceleration Z down", value, most, "m/s2", "peak force and weight over effective mass"))
    return [Capacity(*row) for row in rows]


def _speeds(machine: Machine) -> list[Capacity]:
    plant = make_plant(machine.with_valves(2))
    jacobian, speeds = kinematic_jacobian(plant), actuator_speeds(plant)
    lines = []
    for k, axis in enumerate(AXES):
        for sign, word in ((1.0, " up"), (-1.0, " down")) if axis == "z" else ((1.0, ""),):
            rate = sign * jacobian[:, k]
            moving = np.abs(rate) > 1e-9
            slowest = np.min(np.where(rate > 0.0, speeds[:, 0], speeds[:, 1])[moving] / np.abs(rate[moving]))
            unit, how = "m/s" if k < 3 else "rad/s", "slowest actuator, unloaded, full spool"
            name, printed = f"peak velocity {axis}{word}", machine.limits.velocity[k]
            lines.append(Capacity(name, float(slowest), printed, unit, how))
    return lines


def _travel(plant: Plant) -> list[Capacity]:
    """Largest excursion along each axis alone within the actuators' strokes, by bisection."""
    limits = plant.machine.limits.displacement
    strokes = np.array([a.stroke for a in plant.machine.actuators])
    lines = []
    for k, axis in enumerate(AXES):

        def used(size: float, k: int = k) -> float:
            pose = np.zeros((2, 6))
            pose[0, k], pose[1, k] = size, -size
            return float(np.max(np.abs(leg_displacements(plant, pose)[0][:, : plant.spools]) / strokes))

        low, high = 0.0, 4.0 * limits[k]
        while high - low > 1e-6 * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if used(middle) > 1.0 else (middle, high)
        unit = "m" if k < 3 else "rad"
        lines.append(Capacity(f"peak displacement {axis}", low, limits[k], unit, "strokes of the actuators alone"))
    return lines
