"""Springs, gas, weight, inertia and flexibility beyond the report's."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..law_table import NODES

if TYPE_CHECKING:
    from ..machine import Machine

__all__ = ["BUILD"]

Values = Mapping[str, float]


def _spring(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "spring", components, [(values["stiffness"],)] * len(components)


def _end_stop(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    numbers = (values["force"], values["start"], values["exponent"])
    return "end_stop", components, [numbers] * len(components)


def _by_position(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "by_position", components, [_table(values)] * len(components)


def _by_speed(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "by_speed", components, [_table(values)] * len(components)


def _table(values: Values) -> tuple[float, ...]:
    return tuple(values[key] for key in ("share", "first", "last", *(f"force_{k + 1}" for k in range(NODES))))


def _thrust(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "thrust_direction", components, [(values["share"],)] * len(components)


def _gravity(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    g = machine.platen.gravity
    # r x (0, 0, -m g) about C
    forces = (-g * values["mass"], -g * values["moment_y"], g * values["moment_x"])
    return "constant", ("platen.z", "platen.roll", "platen.pitch"), [(f,) for f in forces]


def _gas(machine: "Machine", components: Sequence[str], first: float, last: float) -> list[tuple[float, ...]]:
    struts = {s.name: s for s in machine.struts}
    chosen = [struts[name] for name in components]
    return [(first, s.pressure, s.area, s.gas_length, s.polytropic_index, last) for s in chosen]


def _leak(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "gas_leak", components, _gas(machine, components, values["rate"], values["lost"])


def _heat(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "gas_heat", components, _gas(machine, components, values["share"], values["time_constant"])


def _oscillator(components: Sequence[str], values: Values, gravity: float) -> Any:
    """Rows of a mass that moves along axes of the platen at a height above C; one more where it has weight."""
    mass, height = values["mass"], values["height"]
    tuned = (2.0 * math.pi * values["frequency"], values["damping"])
    turns = {"platen.x": ("platen.pitch", height), "platen.y": ("platen.roll", -height)}
    ports = [f"{axis} {turns[axis][0]}" for axis in components]
    rows = [(mass, *tuned, turns[axis][1], 0.0) for axis in components]
    if gravity:
        ports.append("platen.z -")
        rows.append((mass, *tuned, 0.0, gravity))
    return "oscillator", ports, rows


def _flexibility(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return _oscillator(components, values, 0.0)


def _resonance(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return _oscillator(components, values, machine.platen.gravity)


def _mass(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    mass = values["mass"]
    to_c = (values["x"], values["y"], values["height"])
    x, y, z = (a - b for a, b in zip(to_c, machine.platen.centre_of_gravity, strict=True))
    squares = (y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
    return "more_inertia", components, [(mass, *(mass * r for r in (x, y, z)), *(mass * r for r in squares))]


def _coupling(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    first = [values[f"first_{axis}"] for axis in "xyz"]
    products = [values[f"product_{pair}"] for pair in ("xy", "xz", "yz")]
    return "more_inertia", components, [(0.0, *first, 0.0, 0.0, 0.0, *products)]


BUILD = {
    "stray_spring": _spring,
    "end_stop_stiffening": _end_stop,
    "unnamed_by_position": _by_position,
    "unnamed_by_speed": _by_speed,
    "gravity_offset": _gravity,
    "bearing_thrust_direction": _thrust,
    "strut_gas_leak": _leak,
    "gas_heat_transfer": _heat,
    "structural_flexibility": _flexibility,
    "specimen_resonance": _resonance,
    "added_mass": _mass,
    "inertia_coupling": _coupling,
}
