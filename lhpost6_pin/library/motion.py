"""Springs, gas, weight, inertia and flexibility beyond the report's."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..law_table import NODES

if TYPE_CHECKING:
    from ..machine import Machine

__all__ = ["BUILD"]

Values = Mapping[str, float]
Place = tuple[float, float, float]


def _spring(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "spring", [f"{name} -" for name in components], [(values["stiffness"], 0.0)] * len(components)


def _mounted_spring(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    ports, levers = _at((0.0, 0.0, values["height"]), components)
    return "spring", [port.rpartition(" ")[0] for port in ports], [(values["stiffness"], tilt) for tilt, _ in levers]


def _at(place: Place, axes: Sequence[str]) -> tuple[list[str], list[tuple[float, float]]]:
    """Ports of what moves along axes of the platen at a place from C (x, y, z), and levers of two turns each."""
    x, y, z = place
    turns = {
        "platen.x": ("platen.pitch platen.yaw", (z, -y)),
        "platen.y": ("platen.roll platen.yaw", (-z, x)),
        "platen.z": ("platen.roll platen.pitch", (y, -x)),
    }
    return [f"{axis} {turns[axis][0]}" for axis in axes], [turns[axis][1] for axis in axes]


def _end_stop(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    numbers = (values["force"], values["start"], values["exponent"])
    return "end_stop", components, [numbers] * len(components)


def _by_position(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "by_position", components, [_table(values)] * len(components)


def _by_speed(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "by_speed", components, [_table(values)] * len(components)


def _by_memory(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    return "by_memory", components, [(*_table(values), values["memory"], values["past"])] * len(components)


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


def _oscillator(axes: Sequence[str], values: Values) -> tuple[list[str], list[tuple[float, ...]]]:
    """Ports and numbers of a mass that moves along axes of the platen, somewhere on it."""
    mass, tuned = values["mass"], (2.0 * math.pi * values["frequency"], values["damping"])
    ports, levers = _at((values["x"], values["y"], values["height"]), axes)
    return ports, [(mass, *tuned, 0.0, *both) for both in levers]


def _flexibility(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    ports, rows = _oscillator(components, values)
    more, (upright,) = _upright(values, values["upright_share"] * values["mass"], 0.0)
    return "oscillator", ports + more, [*rows, upright]


def _resonance(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    ports, rows = _oscillator(components, values)
    more, (upright,) = _upright(values, values["mass"], machine.platen.gravity)
    return "oscillator", ports + more, [*rows, upright]


def _upright(values: Values, mass: float, gravity: float) -> tuple[list[str], list[tuple[float, ...]]]:
    """The same upright, where it is stiffer; with weight where there is gravity."""
    stiff = {**values, "mass": mass, "frequency": values["upright"] * values["frequency"]}
    ports, ((mass, frequency, damping, _, *levers),) = _oscillator(["platen.z"], stiff)
    return ports, [(mass, frequency, damping, gravity, *levers)]


def _mass(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    mass = values["mass"]
    share = mass / (mass * mass + 1.0)  # 1 / mass, and none of a mass of nothing
    about_c = (values[f"moment_{axis}"] for axis in "xyz")
    x, y, z = (a - mass * b for a, b in zip(about_c, machine.platen.centre_of_gravity, strict=True))
    squares = (y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
    return "more_inertia", components, [(mass, x, y, z, *(share * xx for xx in squares))]


def _coupling(machine: "Machine", components: Sequence[str], values: Values) -> Any:
    first = [values[f"first_{axis}"] for axis in "xyz"]
    products = [values[f"product_{pair}"] for pair in ("xy", "xz", "yz")]
    return "more_inertia", components, [(0.0, *first, 0.0, 0.0, 0.0, *products)]


BUILD = {
    "stray_spring": _spring,
    "mounted_spring": _mounted_spring,
    "end_stop_stiffening": _end_stop,
    "unnamed_by_position": _by_position,
    "unnamed_by_speed": _by_speed,
    "unnamed_by_memory": _by_memory,
    "gravity_offset": _gravity,
    "bearing_thrust_direction": _thrust,
    "strut_gas_leak": _leak,
    "gas_heat_transfer": _heat,
    "structural_flexibility": _flexibility,
    "specimen_resonance": _resonance,
    "added_mass": _mass,
    "inertia_coupling": _coupling,
}
