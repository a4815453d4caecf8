"""Friction and drag beyond the report's Bouc-Wen and viscous laws.

What rubs as the report's friction does has its yield and shape: those of the component's seal, or of its pad.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from ..port_names import SWIVEL_TURNS
from ..structure import Structure

__all__ = ["BUILD"]

Values = Mapping[str, float]


def _each(machine: Structure, components: Sequence[str]) -> list[Any]:
    known = {c.name: c for c in machine.components}
    return [known[name] for name in components]


def _seal(component: Any) -> tuple[float, float]:
    return component.seal_yield, component.seal_shape


def _stribeck(machine: Structure, components: Sequence[str], values: Values) -> Any:
    rows = [(values["friction"], *_seal(c), values["speed"]) for c in _each(machine, components)]
    return "stribeck", components, rows


def _asymmetric(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "asymmetric", components, [(values["friction"], *_seal(c)) for c in _each(machine, components)]


def _warm_up(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "warm_up", components, [(values["growth"], *_seal(c), values["memory"]) for c in _each(machine, components)]


def _load_dependent(machine: Structure, components: Sequence[str], values: Values) -> Any:
    ports, rows = [], []
    for c in _each(machine, components):
        slides = (
            c.mount == "bearing"
        )  # under its load the platen slides on the pad; otherwise it loads the piston's seal
        ports.append(c.name if slides else f"{c.name} -")
        rubs = (c.pad_yield, c.pad_shape) if slides else _seal(c)
        rows.append((values["coefficient"], *rubs, c.area_a, c.area_b or 0.0))
    return "load_friction", ports, rows


def _backlash(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return (
        "backlash",
        components,
        [(values["friction"], c.seal_yield, values["gap"]) for c in _each(machine, components)],
    )


def _strut(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "bouc_wen_1d", components, [(values["friction"], *_seal(c)) for c in _each(machine, components)]


def _bearing(machine: Structure, components: Sequence[str], values: Values) -> Any:
    rows = [(values["friction"], c.pad_yield, c.pad_shape) for c in _each(machine, components)]
    return "bouc_wen_2d", components, rows


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


def _bearing_presliding(machine: Structure, components: Sequence[str], values: Values) -> Any:
    rubs = [(c.pad_friction, c.pad_yield, c.pad_shape) for c in _each(machine, components)]
    return "dahl_instead", components, _of_another_form(rubs, values)


def _of_another_form(rubs: Sequence[tuple[float, float, float]], values: Values) -> list[tuple[float, ...]]:
    """Numbers of friction (force, yield, shape) of which a share is of Dahl's form."""
    return [(values["share"] * force, slip, shape, values["ratio"] * slip) for force, slip, shape in rubs]


def _viscous(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "viscous", components, [(values["coefficient"],)] * len(components)


def _quadratic(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "drag", components, [(values["coefficient"], 2.0)] * len(components)


def _power(machine: Structure, components: Sequence[str], values: Values) -> Any:
    return "drag", components, [(values["force"], values["exponent"])] * len(components)


BUILD = {
    "stribeck_friction": _stribeck,
    "asymmetric_friction": _asymmetric,
    "friction_warm_up": _warm_up,
    "load_dependent_friction": _load_dependent,
    "backlash": _backlash,
    "strut_friction": _strut,
    "bearing_friction": _bearing,
    "swivel_friction": _swivel,
    "smooth_swivel_friction": _smooth_swivel,
    "presliding": _presliding,
    "bearing_presliding": _bearing_presliding,
    "local_viscous": _viscous,
    "quadratic_drag": _quadratic,
    "power_law_viscous": _power,
}
