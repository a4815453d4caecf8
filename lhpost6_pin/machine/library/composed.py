"""Families that act at a place, on several ports, or in place of the report's friction: their laws' numbers composed.

Friction of the report's form has its yield and shape: those of the component's seal, or of its pad.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..port_names import SWIVEL_TURNS, place_port
from ..structure import Structure

__all__ = ["COMPOSED"]

ISOLATED = 0.02
"""Frequency [Hz] of a mass that carries weight and no inertia: below the band of any test."""

Values = Mapping[str, float]
Place = tuple[float, float, float]


def _each(machine: Structure, components: Sequence[str]) -> list[Any]:
    known = {c.name: c for c in machine.components}
    return [known[name] for name in components]


def _seal(component: Any) -> tuple[float, float]:
    return component.seal_yield, component.seal_shape


def _load_dependent(machine: Structure, components: Sequence[str], values: Values) -> Any:
    ports, rows = [], []
    for c in _each(machine, components):
        slides = c.mount == "bearing"  # the load is on the pad; otherwise on the piston's seal
        ports.append(c.name if slides else f"{c.name} -")
        rubs = (c.pad_yield, c.pad_shape) if slides else _seal(c)
        rows.append((values["coefficient"], *rubs, c.area_a, c.area_b or 0.0))
    return "load_friction", ports, rows


def _swivel(machine: Structure, components: Sequence[str], values: Values) -> Any:
    shapes = [c.seal_shape for c in _each(machine, components) for _ in range(2)]
    return "ball", _swivel_ends(components), [(values["moment"], values["yield_turn"], shape) for shape in shapes]


def _smooth_swivel(machine: Structure, components: Sequence[str], values: Values) -> Any:
    ports = _swivel_ends(components)
    return "smooth_ball", ports, [(values["moment"], values["slow"])] * len(ports)


def _swivel_ends(components: Sequence[str]) -> list[str]:
    """Ports of both ends of each: the rod's turn in the base, then the platen's in the rod."""
    ends = (SWIVEL_TURNS[:2], SWIVEL_TURNS[2:])
    return [" ".join(f"{c}.{turn}" for turn in end) for c in components for end in ends]


def _presliding(machine: Structure, components: Sequence[str], values: Values) -> Any:
    rubs = [(c.seal_friction, *_seal(c)) for c in _each(machine, components)]
    return "dahl_instead", [f"{name} -" for name in components], _of_another_form(rubs, values)


def _backlash_before(machine: Structure, components: Sequence[str], values: Values) -> Any:
    rows = [
        (values["share"] * c.seal_friction, *_seal(c), values["slip"], values["gap"])
        for c in _each(machine, components)
    ]
    return "backlash_instead", components, rows


def _bearing_presliding(machine: Structure, components: Sequence[str], values: Values) -> Any:
    rubs = [(c.pad_friction, c.pad_yield, c.pad_shape) for c in _each(machine, components)]
    return "dahl_instead", components, _of_another_form(rubs, values)


def _bearing_warm_up(machine: Structure, components: Sequence[str], values: Values) -> Any:
    rows = [
        (values["growth"], c.pad_yield, c.pad_shape, values["memory"], values["saturation"])
        for c in _each(machine, components)
    ]
    return "warm_up", components, rows


def _of_another_form(rubs: Sequence[tuple[float, float, float]], values: Values) -> list[tuple[float, ...]]:
    """Numbers of friction (force, yield, shape) of which a share is of Dahl's form."""
    return [(values["share"] * force, slip, shape, values["ratio"] * slip) for force, slip, shape in rubs]


def _mounted_spring(machine: Structure, components: Sequence[str], values: Values) -> Any:
    tilts = [_turns(axis, (0.0, 0.0, values["height"]))[0] for axis in components]
    ports = [f"{axis} {turn}" for axis, (turn, _) in zip(components, tilts, strict=True)]
    return "spring", ports, [(values["stiffness"], lever) for _, lever in tilts]


def _placed_spring(machine: Structure, components: Sequence[str], values: Values) -> Any:
    place = (values["x"], values["y"], values["height"])
    (c, s), (up, down) = ((math.cos(values[angle]), math.sin(values[angle])) for angle in ("turn", "tilt"))
    axes = ((c * up, s * up, -down), (-s, c, 0.0), (c * down, s * down, up))  # about the vertical, then the second
    rows = [(values[f"stiffness_{axis}"], values[f"damping_{axis}"]) for axis in "xyz"]
    return "spring_damper", [place_port(place, axis) for axis in axes], rows


def _turns(axis: str, place: Place) -> tuple[tuple[str, float], tuple[str, float]]:
    """The two turns of the platen that move a place (x, y, z from C) along an axis, with their levers."""
    x, y, z = place
    return {
        "platen.x": (("platen.pitch", z), ("platen.yaw", -y)),
        "platen.y": (("platen.roll", -z), ("platen.yaw", x)),
        "platen.z": (("platen.roll", y), ("platen.pitch", -x)),
    }[axis]


def _gravity(machine: Structure, components: Sequence[str], values: Values) -> Any:
    g = machine.platen.gravity
    # r x (0, 0, -m g) about C
    forces = (-g * values["mass"], -g * values["moment_y"], g * values["moment_x"])
    return "constant", ("platen.z", "platen.roll", "platen.pitch"), [(f,) for f in forces]


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


def _sway_alone(machine: Structure, components: Sequence[str], values: Values) -> Any:
    """A mass that sways along level axes and rests on the platen with its weight, without inertia along the others."""
    rows = [_sprung(axis, values, values["mass"], values["frequency"], 0.0) for axis in components]
    rows.append(_sprung("platen.z", values, values["mass"], ISOLATED, machine.platen.gravity))
    return "oscillator", [port for port, _ in rows], [numbers for _, numbers in rows]


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


COMPOSED = {
    "load_dependent_friction": _load_dependent,
    "swivel_friction": _swivel,
    "smooth_swivel_friction": _smooth_swivel,
    "presliding": _presliding,
    "backlash_before_friction": _backlash_before,
    "bearing_presliding": _bearing_presliding,
    "bearing_warm_up": _bearing_warm_up,
    "mounted_spring": _mounted_spring,
    "placed_spring": _placed_spring,
    "gravity_offset": _gravity,
    "structural_flexibility": _flexibility,
    "specimen_resonance": _resonance,
    "swaying_specimen": _sway_alone,
    "added_mass": _mass,
    "inertia_coupling": _coupling,
}
"""Families by name: (machine, components, values) to law, ports, params."""
