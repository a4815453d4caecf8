"""Residuals of a model along a measured test, equation by equation.

    wrench   required less measured actuator wrench on the platen at C in {c} [N, N m]      (Eqs. 4-24 to 4-26)
    flow     L A / beta dP/dt + A dL/dt - Q, per chamber [m3/s]                              (Eqs. 4-2 to 4-5)
             or half the difference of both chambers' per actuator, of which only the pressure difference is measured,
             or the force of a piston of equal areas
    gas      ln P/P_0 + n ln(1 + dL/L_c0), per strut [1]                                     (Eq. 4-7)
    force    measured actuator force less P_A A_1 - P_B A_2 [N]                              (Eq. 4-6)
    servo    measured spool position less its command, delayed by the valve [1]              (Section 4.1.2)
    supply   measured supply pressure less the model's, which flow may lower [Pa]

All are zero where the model is right and sensors are perfect. The laws are those of the simulation, evaluated by the
same kernels.
"""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array, Mask
from ..core.errors import SimulationError
from ..data.alignment import due_spools
from ..effects.registry import actuator_rows, law_of
from ..mechanics.gas_pressure import gas_ratio, strut_pressures
from ..mechanics.plant import MovingRow, Plant
from ..mechanics.port_path import PortPath, ports_along
from ..mechanics.pose import PlantMotion, plant_motion
from ..mechanics.required_wrench import floor_wrench, require_alike, required_wrench
from .friction_march import march_finely
from .inverse_dynamics import with_loads
from .prepare import MeasuredTest, actuator_forces, chamber_pressures, oil_forces
from .residual_kernels import MeasuredOil, oil_residuals, part_pressures, wrench_residual

__all__ = [
    "RESIDUALS",
    "OilBalance",
    "Path",
    "Residuals",
    "evaluate_residuals",
    "follow",
    "kinds_shown",
    "oil_balance",
    "with_ports",
]


RESIDUALS = ("wrench", "flow", "gas", "force", "servo", "supply")
"""Kinds of residuals."""


class Residuals(NamedTuple):
    """Residuals of one test; n samples, no columns where something was not measured."""

    wrench: Array  # (n, 6)
    flow: Array  # (n, n_chambers)
    gas: Array  # (n, n_struts)
    force: Array  # (n, n_actuators)
    servo: Array  # (n, n_actuators)
    supply: Array  # (n, 1)

    def stacked(self) -> Array:
        """All columns side by side (n, k)."""
        return np.hstack(self)

    def less(self, before: "Residuals") -> "Residuals":
        """Change from others; no columns where these have none."""
        return Residuals(*(a - b if a.shape[1] else a for a, b in zip(self, before, strict=True)))


class Path(NamedTuple):
    """A test's motion in a plant's coordinates and ports, and the resulting friction states."""

    ports: PortPath
    along: PortPath  # for friction
    required: Array  # (n, 6) wrench at B in platen axes for the platen's inertia and weight, on its free axes
    z: Array  # (n, n_states)


def follow(
    plant: Plant, test: MeasuredTest, known: tuple[Plant, Path] | None = None, *, start: Array | None = None
) -> Path:
    """Path of a test; raises RecordError naming the sample where a leg is out of its stroke.

    Raises SimulationError for a specimen that moves on joints or in modes. What does not differ from the `known` path
    of the same motion with another plant is reused; where the states at the start are given, its ports alone. start
    (n_states,) are the friction states at the start, if not zero.
    """
    if plant.flexible:
        raise SimulationError("residuals take a rigid specimen at most; what a moving one exerts beyond is `carried`")
    there: dict[tuple[object, ...], Array] = {}  # states by what they depend on
    same, old = 0, np.zeros((test.samples, 0))
    if known is None or known[0].geometry != plant.geometry:
        moved = plant_motion(plant, test.motion)
        ports, along = _ports(plant, test, moved)
        required = _required(plant, test, moved, ports.turn)
    else:
        ports, along, required, old = known[1]
        if not require_alike(known[0], plant):
            required = _required(plant, test, plant_motion(plant, test.motion), ports.turn)
        before = [one[:2] for one in known[0].moving] if start is None else []
        if start is None and len(plant.states) == old.shape[1] and before == [one[:2] for one in plant.moving]:
            return Path(ports, along, required, old)
        there = {key: old[:, place] for key, place in before}
        same = len(before) if before == [one[:2] for one in plant.moving[: len(before)]] else 0
    fresh = {one.key: one for one in plant.moving if one.key not in there}
    # oscillators and heat average noise, and need the raw motion
    parts: tuple[list[MovingRow], list[MovingRow]] = [], []
    for one in fresh.values():
        parts[test.path is not None and law_of(one.row).follows_motion].append(one)
    for some, way in zip(parts, (along, ports), strict=True):
        there.update(march_finely(plant, way, test, some, start))
    z = np.zeros((test.samples, len(plant.states)))
    if same and old.shape[1] <= z.shape[1]:
        z[:, : old.shape[1]] = old
    for one in plant.moving[same:]:
        z[:, one.states] = there[one.key]
    return Path(ports, along, required, z)


def with_ports(plant: Plant, test: MeasuredTest, path: Path) -> Path:
    """A path of a test with the ports of a plant that differs in them alone."""
    ports, along = _ports(plant, test, plant_motion(plant, test.motion))
    return path._replace(ports=ports, along=along)


def _ports(plant: Plant, test: MeasuredTest, moved: PlantMotion) -> tuple[PortPath, PortPath]:
    """Ports along a test's motion, and along that which friction follows."""
    ports = ports_along(plant, moved)
    if test.path is None:
        return ports, ports
    along = ports_along(plant, plant_motion(plant, test.motion._replace(displacement=test.path)))
    return ports, along._replace(column=along.column[:0].copy(), turn=along.turn[:0].copy())  # which no state needs


def _required(plant: Plant, test: MeasuredTest, moved: PlantMotion, turn: Array) -> Array:
    """Wrench (n, 6) that the motion requires, less that of a specimen beyond a rigid one, on the free axes."""
    required = required_wrench(plant, moved, turn)
    if test.carried is not None:
        required[:, plant.axes] -= test.carried[:, plant.axes]
    return required


def evaluate_residuals(
    plant: Plant, test: MeasuredTest, only: tuple[str, ...] = RESIDUALS, *, path: Path | None = None
) -> Residuals:
    """Residuals of a test with a plant's equations; those not in `only` have no columns.

    path is that of `follow`, if it is known. Raises RecordError naming the sample where a leg is out of its stroke.
    """
    machine, measured = plant.machine, test.channels
    path = path or follow(plant, test)
    force, oil = actuator_forces(machine, measured), oil_forces(machine, measured)
    wrench = gas = by_cell = servo = np.zeros((test.samples, 0))
    if "wrench" in only and force is not None:
        required = path.required
        if "floor_acceleration" in measured:
            required = required + floor_wrench(plant, measured["floor_acceleration"])
        z = with_loads(plant, path.ports, required, path.z, force)
        wrench = wrench_residual(plant, path.ports, required, z, force)
    if "gas" in only and "strut_pressure" in measured:
        length = path.ports.s[:, plant.spools : plant.legs.size]
        gas = np.log(measured["strut_pressure"] / strut_pressures(machine, length) / gas_ratio(plant, path.z))
    if "force" in only and oil is not None and "actuator_force" in measured:
        by_cell = measured["actuator_force"] - oil
    if "servo" in only and {"spool_position", "spool_command"} <= measured.keys():
        servo = measured["spool_position"] - due_spools(plant, measured["spool_command"], test.dt)
    flow, supply = _of_oil(plant, test, path, only)
    return Residuals(wrench, flow, gas, by_cell, servo, supply)


def kinds_shown(kinds: Collection[str], channels: Collection[str]) -> tuple[str, ...]:
    """Kinds of residuals that what shows in `kinds` changes in a test with these channels.

    Where spools are not measured, an error of the command path shows in the flow that the command gives.
    """
    more = ("flow",) if "servo" in kinds and "spool_position" not in channels else ()
    return tuple(dict.fromkeys((*kinds, *more)))


def _spools(plant: Plant, test: MeasuredTest) -> Array | None:
    """Spool positions (n, n_actuators): measured, else those that the valves' commands give; None without either."""
    spool, command = test.channels.get("spool_position"), test.channels.get("valve_command")
    return due_spools(plant, command, test.dt) if spool is None and command is not None else spool


class OilBalance(NamedTuple):
    """Mass balance of an actuator's chambers along a test, A of every actuator, then B of the double-acting."""

    flow: Array  # (n, n_chambers) V / beta dP/dt + A dL/dt - Q [m3/s]
    valve: Array  # (n, n_chambers) flow from the valves, a part of Q [m3/s]
    pressure: Array  # (n, n_chambers) [Pa]
    supply: Array  # (n,) pressure of the supply, by the model [Pa]
    spool: Array  # (n, n_actuators) spool positions [1]
    chamber: NDArray[np.int64]  # (n_actuators, 2) columns, -1 without chamber B


def oil_balance(
    plant: Plant, test: MeasuredTest, path: Path, *, flows: bool = True, some: Mask | None = None
) -> OilBalance | None:
    """Balance of a test's oil; without `flows` the supply's alone. None where pressures or spools are not measured.

    some (n_actuators,) are the actuators whose balance is wanted, if the supply is constant; by default all.
    """
    pressure = chamber_pressures(plant.machine, test.channels)
    rate = chamber_pressures(plant.machine, test.rates, rates=True)
    spool = _spools(plant, test)
    if pressure is None or rate is None or spool is None:
        return None
    double = np.isin(plant.machine.actuator_names, plant.machine.double_acting)
    chamber = np.full((plant.spools, 2), -1)
    chamber[:, 0] = np.arange(plant.spools)
    chamber[double, 1] = plant.spools + np.arange(int(double.sum()))
    flow, valve = np.zeros((2, test.samples, int(chamber.max()) + 1 if flows else 0))
    side, side_rate = np.zeros((2, 0, 0)) if test.side is None else test.side
    drooped, oil = np.zeros(test.samples), MeasuredOil(chamber, pressure, rate, spool, side, side_rate, test.dt)
    rows, z = plant.rows[actuator_rows(plant.rows)], np.zeros(len(plant.states))
    if some is not None:
        rows = rows[some]
    if "chamber_pressure_a" not in test.channels:
        hydraulics = plant.machine.hydraulics
        room = 0.5 * (hydraulics.supply_pressure - hydraulics.return_pressure)
        part_pressures(rows, oil, path.ports, room)
    oil_residuals(rows, plant.supply, oil, path.ports, z, drooped, flow, valve)
    return OilBalance(flow, valve, pressure, drooped, spool, chamber)


def _of_oil(plant: Plant, test: MeasuredTest, path: Path, only: tuple[str, ...]) -> tuple[Array, Array]:
    """Residuals `flow` and `supply`."""
    none = np.zeros((test.samples, 0))
    supply = test.channels.get("supply_pressure") if "supply" in only else None
    oil = oil_balance(plant, test, path, flows="flow" in only) if "flow" in only or supply is not None else None
    if oil is None:
        return none, none
    flow = oil.flow
    if "flow" in only and "chamber_pressure_a" not in test.channels:
        flow = 0.5 * (flow[:, : plant.spools] - flow[:, plant.spools :])
    return flow, none if supply is None else supply - oil.supply[:, None]
