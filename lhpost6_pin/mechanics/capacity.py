"""Capacity of the machine by the model beside what its file states: Table 2.2, bare and with payload, or limits."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..machine.strength import stated_strength
from ..machine.structure import FLOW_READINGS
from .actuator_forces import axis_capacity, force_range
from .equilibrium import actuator_speeds
from .payload import lock_joints, with_payload
from .plant import Plant, make_plant
from .pose import kinematic_jacobian, leg_displacements
from .rigid_body import platen_inertia

__all__ = ["Capacity", "FlowReading", "capacity_table", "flow_readings", "has_printed_capacity", "payload_table"]
__all__ += ["actuator_speeds", "axis_speeds", "axis_travel", "with_all_valves"]

ALL_VALVES = 2
"""Servovalves of a horizontal actuator of the LHPOST6, all open in Table 2.2."""

DIGITS = 0.01
"""Half the last digit of the printed 4.9 MN, over it."""

CENTRED = 0.01
"""Distance in plan [m] of a centre of gravity from C up to which it counts as centred."""

PER = {"m": "m/s", "rad": "rad/s"}


class Capacity(NamedTuple):
    """One line: what, the model's value, what is stated (None: nothing), its unit and how the model's came about."""

    name: str
    model: float
    printed: float | None
    unit: str
    how: str

    @property
    def deviation(self) -> float | None:
        """Model over what is stated, less one."""
        return None if self.printed is None else self.model / self.printed - 1.0


class FlowReading(NamedTuple):
    """Peak velocities by both readings of Eq. 4-2 beside what is stated or was measured [m/s, rad/s]."""

    name: str
    printed_equation: float
    full_stroke: float
    stated: float
    source: str


def has_printed_capacity(machine: Machine) -> bool:
    """Whether a machine file states Table 2.2."""
    return "table_2_2.force_actuators" in machine.parameters


def with_all_valves(machine: Machine) -> Machine:
    """Return a copy with all servovalves open, as in Table 2.2; a machine whose file does not state it as it is."""
    return machine.with_valves(ALL_VALVES if has_printed_capacity(machine) else 0)


def capacity_table(machine: Machine, valves: int = 0) -> tuple[Capacity, ...]:
    """Peak forces, accelerations, velocities and strokes with what is mounted, beside what the machine file states.

    Table 2.2 where the file has it, with all servovalves open as there, else its section `limits`. With a number of
    `valves` open the velocities are those of so many. With a specimen the columns of the payload are beside forces,
    accelerations and velocities if it is that payload, else nothing is, as beside velocities with fewer servovalves
    than in Table 2.2.
    """
    plant, printed = lock_joints(make_plant(machine)), has_printed_capacity(machine)
    open_valves = machine.with_valves(valves) if valves else with_all_valves(machine)
    rows = [*_forces(plant), *_accelerations(plant), *_speeds(open_valves), *_travel(plant)]
    stated = _stated(machine)
    if not printed and "peak acceleration Z down" in stated:  # one limit for both directions: of the weaker one
        weaker = min((row for row in rows if row.name.startswith("peak acceleration Z ")), key=lambda row: row.model)
        stated[weaker.name] = stated.pop("peak acceleration Z down")
    if printed and valves not in (0, ALL_VALVES):
        stated = {name: value for name, value in stated.items() if "velocity" not in name}
    return tuple(row._replace(printed=stated.get(row.name)) for row in rows)


def payload_table(machine: Machine) -> tuple[Capacity, ...]:
    """The columns of Table 2.2 for a centred rigid payload; empty if a machine file states none."""
    par = machine.parameters
    if "table_2_2_payload.weight" not in par:
        return ()
    bare = machine.with_valves(ALL_VALVES)
    plant = with_payload(make_plant(bare), par.number("table_2_2_payload.weight"))
    stated = _stated_with_payload(par)
    rows = [*_forces(plant), *_accelerations(plant), *_speeds_of(plant)]
    return tuple(row._replace(printed=stated[row.name]) for row in rows if row.name in stated)


def flow_readings(machine: Machine) -> tuple[FlowReading, ...]:
    """Evidence on the two readings of Eq. 4-2: peak velocities by each beside those stated, and one measured."""
    if not has_printed_capacity(machine):
        return ()
    par, bare = machine.parameters, machine.with_valves(ALL_VALVES)
    plants = [make_plant(bare.with_flow_reading(word)) for word in FLOW_READINGS]
    speeds = [axis_speeds(plant).min(axis=1) for plant in plants]
    limits = machine.limits.velocity
    rows = [
        FlowReading(f"peak velocity {AXES[k]}", float(speeds[0][k]), float(speeds[1][k]), limits[k], "Table 2.2, bare")
        for k in machine.axes
    ]
    if "table_2_2_payload.weight" in par:
        weight = par.number("table_2_2_payload.weight")
        down, full = (float(axis_speeds(with_payload(plant, weight))[2, 1]) for plant in plants)
        stated = par.vector("table_2_2_payload.velocity")[2]
        rows.append(FlowReading("peak velocity z, payload", down, full, stated, f"Table 2.2, {weight / 1e6:g} MN"))
    if "table_2_2.velocity_measured" in par:
        measured = par["table_2_2.velocity_measured"]
        slow, fast = float(speeds[0][0]), float(speeds[1][0])
        rows.append(
            FlowReading("velocity x reached", slow, fast, par.number("table_2_2.velocity_measured"), measured.source)
        )
    return tuple(rows)


def _stated_with_payload(par: Parameters) -> dict[str, float]:
    """What the machine file states with the payload of Table 2.2, by the names of the rows."""
    x, y, down = par.vector("table_2_2_payload.acceleration")
    actuators = par.vector("table_2_2_payload.acceleration_actuators")
    stated = {f"peak acceleration {name}": actuators[k] for k, name in enumerate(("X", "Y", "Z up"))}
    stated |= {"peak acceleration X, reaction mass": x, "peak acceleration Y, reaction mass": y}
    stated |= {"peak acceleration Z down": down, "peak force Z down": par.number("table_2_2_payload.force_down")}
    stated["peak acceleration Z up, platen"] = par.number("table_2_2_payload.acceleration_up")
    velocity = par.vector("table_2_2_payload.velocity")
    stated |= {f"peak velocity {AXES[k]}": velocity[k] for k in range(2)} | {"peak velocity z down": velocity[2]}
    return stated


def _is_stated_payload(machine: Machine) -> bool:
    """Whether the specimen is the payload of Table 2.2: rigid, centred, and of its weight to the digits printed."""
    par, plant = machine.parameters, make_plant(machine)
    if "table_2_2_payload.weight" not in par or plant.flexible:
        return False
    bare = make_plant(machine.without_specimen())
    loaded, own = plant.model.inertias[1], bare.model.inertias[1]
    mass = loaded.mass - own.mass
    weight = par.number("table_2_2_payload.weight")
    if abs(mass * machine.platen.gravity / weight - 1.0) > DIGITS:
        return False
    aside = (loaded.mass * loaded.lever - own.mass * own.lever) / mass - plant.body[0]["rho_c"]
    return bool(np.hypot(*aside[:2]) < CENTRED)


def _stated(machine: Machine) -> dict[str, float]:
    """What the machine file states of the table with what is mounted, by the names of the rows."""
    limits = machine.limits
    found: dict[str, float] = {}
    for k in machine.axes:
        axis = AXES[k]
        found |= {f"peak displacement {axis}": limits.displacement[k]}
        for word in ("", " up", " down") if axis == "z" else ("",):
            found[f"peak velocity {axis}{word}"] = limits.velocity[k]
        name = axis.upper() if k < 3 else axis
        found[f"peak acceleration {name}{' down' if axis == 'z' else ''}"] = limits.acceleration[k]
    if machine.specimen is not None:
        found = {name: value for name, value in found.items() if "displacement" in name}
        return found | (_stated_with_payload(machine.parameters) if _is_stated_payload(machine) else {})
    if has_printed_capacity(machine):
        par = machine.parameters
        for what in ("force", "acceleration"):
            printed = par.vector(f"table_2_2.{what}_actuators")
            found |= {f"peak {what} {name}": printed[k] for k, name in enumerate(("X", "Y", "Z up"))}
        found |= {f"peak acceleration {'XY'[k]}, reaction mass": limits.acceleration[k] for k in range(2)}
        found["peak force Z down"] = par.number("table_2_2.force_down")
        found["peak acceleration Z up, platen"] = par.number("table_2_2.acceleration_platen_up")
    return found


def _forces(plant: Plant) -> list[Capacity]:
    """Largest forces of all actuators together along x, y and z, hold-down counted."""
    jacobian, span = kinematic_jacobian(plant), force_range(plant)
    pressures = f"{span.least[-1] / plant.actuators.area_a[-1] / 1e6:.3g} MPa"
    hold_down = sum(s.pressure * s.area for s in plant.machine.struts)
    rows = []
    for k in (k for k in plant.axes if k < 3):
        along = jacobian[:, k]
        up, down = (float(np.sum(np.maximum(s * along * span.most, s * along * span.least))) for s in (1.0, -1.0))
        if k < 2:
            how = "supply against return in all actuators"
            rows.append(Capacity(f"peak force {'XYZ'[k]}", min(up, down), None, "N", how))
            continue
        how = "supply in all chambers" + ", less hold-down" * bool(hold_down)
        rows.append(Capacity("peak force Z up", up - hold_down, None, "N", how))
        one_way = not plant.machine.double_acting or bool(hold_down)
        how = f"hold-down less {pressures} in the chambers" if one_way else "return against supply in all actuators"
        rows.append(Capacity("peak force Z down", down + hold_down, None, "N", how))
    return rows


def _accelerations(plant: Plant) -> list[Capacity]:
    """Peak force and weight over effective mass; moments beyond rest over inertia; strengths over mass."""
    machine, strength = plant.machine, stated_strength(plant.machine.parameters)
    mass = platen_inertia(plant.model, machine)[1]
    weight = mass[2, 2] * machine.platen.gravity
    forces = {row.name.removeprefix("peak force "): row.model for row in _forces(plant)}
    rows = []
    for name, force in forces.items():
        k = "XYZ".index(name[0])
        net = force + {"Z up": -weight, "Z down": weight}.get(name, 0.0)
        how = "peak force over effective mass" if k < 2 else "peak force and weight over effective mass"
        rows.append(Capacity(f"peak acceleration {name}", net / mass[k, k], None, "m/s2", how))
    for name, force in zip("XY", strength.reaction_mass, strict=True):
        if np.isfinite(force):
            k, how = "XY".index(name), f"strength of the reaction mass, {force / 1e6:.3g} MN, over effective mass"
            rows.append(Capacity(f"peak acceleration {name}, reaction mass", force / mass[k, k], None, "m/s2", how))
    if np.isfinite(strength.platen_up):
        how, left = f"strength of the platen, {strength.platen_up / 1e6:.3g} MN, ", strength.platen_up - weight
        how += "less weight over effective mass" if left > 0.0 else f"which the weight of {weight / 1e6:.3g} MN exceeds"
        rows.append(Capacity("peak acceleration Z up, platen", max(left, 0.0) / mass[2, 2], None, "m/s2", how))
    if machine.motion == "free":
        rise, fall = axis_capacity(plant)
        for k in (3, 4, 5):
            how = "moment of the actuators beyond rest, shared as least norm, over inertia about B"
            value = float(min(rise[k], fall[k]) / mass[k, k])
            rows.append(Capacity(f"peak acceleration {AXES[k]}", value, None, "rad/s2", how))
            if np.isfinite(moment := strength.reaction_moment[k - 3]):
                how = f"strength of the reaction mass, {moment / 1e6:.3g} MN m, over inertia about B"
                name = f"peak acceleration {AXES[k]}, reaction mass"
                rows.append(Capacity(name, float(moment / mass[k, k]), None, "rad/s2", how))
    return rows


def axis_speeds(plant: Plant) -> Array:
    """Steady unloaded speeds along single axes, up and down, of the slowest actuator, (6, 2); nan if not free."""
    jacobian, speeds = kinematic_jacobian(plant), actuator_speeds(plant)
    found = np.full((6, 2), np.nan)
    for k in plant.axes:
        for i, sign in enumerate((1.0, -1.0)):
            rate = sign * jacobian[:, k]
            moving = np.abs(rate) > 1e-9
            found[k, i] = np.min(np.where(rate > 0.0, speeds[:, 0], speeds[:, 1])[moving] / np.abs(rate[moving]))
    return found


def _speeds(machine: Machine) -> list[Capacity]:
    return _speeds_of(make_plant(machine))


def _speeds_of(plant: Plant) -> list[Capacity]:
    rows, how = [], "slowest actuator, unloaded, full spool"
    for k, (up, down) in enumerate(axis_speeds(plant)):
        unit = PER["m" if k < 3 else "rad"]
        if AXES[k] == "z" and np.isfinite(up):
            rows += [
                Capacity(f"peak velocity z {w}", float(v), None, unit, how) for w, v in (("up", up), ("down", down))
            ]
        elif np.isfinite(up):
            rows.append(Capacity(f"peak velocity {AXES[k]}", float(min(up, down)), None, unit, how))
    return rows


def axis_travel(plant: Plant, reach: float = 4.0) -> Array:
    """Largest excursion along each axis alone within the actuators' strokes (6,), by bisection; nan if not free.

    Searched up to `reach` times the stated limit.
    """
    limits = plant.machine.limits.displacement
    strokes = np.array([a.stroke for a in plant.machine.actuators])
    found = np.full(6, np.nan)
    for k in plant.axes:

        def used(size: float, k: int = k) -> float:
            pose = np.zeros((2, 6))
            pose[0, k], pose[1, k] = size, -size
            return float(np.max(np.abs(leg_displacements(plant, pose)[0][:, : plant.spools]) / strokes))

        low, high = 0.0, reach * limits[k]
        while high - low > 1e-6 * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if used(middle) > 1.0 else (middle, high)
        found[k] = low
    return found


def _travel(plant: Plant) -> list[Capacity]:
    travel, how = axis_travel(plant), "strokes of the actuators alone"
    free: Sequence[int] = [int(k) for k in plant.axes]
    return [
        Capacity(f"peak displacement {AXES[k]}", float(travel[k]), None, "m" if k < 3 else "rad", how) for k in free
    ]
