"""Springs, gas, weight, inertia and flexibility beyond the report's."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...laws.tabulated import NODES
from ..structure import Structure

__all__ = ["BUILD"]

Values = Mapping[str, float]
Place = tuple[float, float, float]


def _spring(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "spring", [f"{name} -" for name in components], [(values["stiffness"], 0.0)] * len(components)


def _mounted_spring(machine: Structure, components: Sequence[str], values: Values) -> Any:
    tilts = [_turns(axis, (0.0, 0.0, values["height"]))[0] for axis in components]
    ports = [f"{axis} {turn}" for axis, (turn, _) in zip(components, tilts, strict=True)]
    return "spring", ports, [(values["stiffness"], lever) for _, lever in tilts]


def _turns(axis: str, place: Place) -> tuple[tuple[str, float], tuple[str, float]]:
    """The two turns of the platen that move a place (x, y, z from C) along an axis, with their levers."""
    x, y, z = place
    return {
        "platen.x": (("platen.pitch", z), ("platen.yaw", -y)),
        "platen.y": (("platen.roll", -z), ("platen.yaw", x)),
        "platen.z": (("platen.roll", y), ("platen.pitch", -x)),
    }[axis]


def _end_stop(machine: Structure, components: Sequence[str], values: Values) -> Any:
    numbers = (values["force"], values["start"], values["exponent"])
    return "end_stop", components, [numbers] * len(components)


def _by_position(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "by_position", components, [_table(values)] * len(components)


def _by_speed(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "by_speed", components, [_table(values)] * len(components)


def _by_memory(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "by_memory", components, [(*_table(values), values["memory"], values["past"])] * len(components)


def _table(values: Values) -> tuple[float, ...]:
    return tuple(values[key] for key in ("share", "first", "last", *(f"force_{k + 1}" for k in range(NODES))))


def _thrust(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "thrust_direction", components, [(values["share"],)] * len(components)


def _gravity(machine: Structure, components: Sequence[str], values: Values) -> Any:
    g = machine.platen.gravity
    # r x (0, 0, -m g) about C
    forces = (-g * values["mass"], -g * values["moment_y"], g * values["moment_x"])
    return "constant", ("platen.z", "platen.roll", "platen.pitch"), [(f,) for f in forces]


def _gas(machine: Structure, components: Sequence[str], first: float, last: float) -> list[tuple[float, ...]]:
    struts = {s.name: s for s in machine.struts}
    chosen = [struts[name] for name in components]
    return [(first, s.pressure, s.area, s.gas_length, s.polytropic_index, last) for s in chosen]


def _leak(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "gas_leak", components, _gas(machine, components, values["rate"], values["lost"])


def _heat(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "gas_heat", components, _gas(machine, components, values["share"], values["time_constant"])


def _sprung(axis: str, values: Values, mass: float, frequency: float, gravity: float) -> tuple[str, tuple[float, ...]]:
    """Port and numbers of a mass that moves along one axis of the platen, somewhere on it."""
    (one, lever), (other, more) = _turns(axis, (values["x"], values["y"], values["height"]))
    return f"{axis} {one} {other}", (mass, 2.0 * math.pi * frequency, values["damping"], gravity, lever, more)


def _swaying(axes: Sequence[str], values: Values, upright_mass: float, gravity: float) -> Any:
    """A mass that sways along level axes, and upright where it is stiffer; with weight where there is gravity."""
    frequency = values["frequency"]
    rows = [_sprung(axis, values, values["mass"], frequency, 0.0) for axis in axes]
    rows.append(_sprung("platen.z", values, upright_mass, values["upright"] * frequency, gravity))
    return "oscillator", [port for port, _ in rows], [numbers for _, numbers in rows]


def _flexibility(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return _swaying(components, values, values["upright_share"] * values["mass"], 0.0)


def _resonance(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return _swaying(components, values, values["mass"], machine.platen.gravity)


def _mass(machine: Structure, components: Sequence[str], values: Values) -> Any:
    mass = values["mass"]
    share = mass / (mass * mass + 1.0)  # 1 / mass, and none of a mass of nothing
    about_c = (values[f"moment_{axis}"] for axis in "xyz")
    x, y, z = (a - mass * b for a, b in zip(about_c, machine.platen.centre_of_gravity, strict=True))
    squares = (y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
    return "more_inertia", components, [(mass, x, y, z, *(share * xx for xx in squares))]


def _coupling(machine: Structure, components: Sequence[str], values: Values) -> Any:
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
