"""Families in the size of a machine: typical numbers and bounds of the library are those of the LHPOST6.

An amplitude with the unit of the table scales with the ratio of the machines: rated force F, largest piston area A and
stroke L of an actuator, mass of the platen M, supply pressure P. Numbers of other units, and shapes (speeds,
frequencies, exponents), are those of seals, valves and structures of any size. Ratios are rounded, so that a machine
has the same families whatever its numbers were fitted to.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from ..parameters import load_parameters
from ..structure import Structure
from .family import Family, families

__all__ = ["in_size_of", "scaled_families"]

_POWERS: dict[str, dict[str, float]] = {
    "N": {"F": 1},
    "N s/m": {"F": 1},
    "N s2/m2": {"F": 1},
    "N/m": {"F": 1, "L": -1},
    "N m": {"F": 1, "L": 1},
    "kg": {"M": 1},
    "kg m": {"M": 1, "L": 1},
    "kg m2": {"M": 1, "L": 2},
    "m": {"L": 1},
    "m3": {"A": 1, "L": 1},
    "m3/s/Pa": {"A": 1, "P": -1},
    "m3/s/Pa^0.5": {"A": 1, "P": -0.5},
    "Pa s/m3": {"P": 1, "A": -1},
    "Pa s2/m6": {"P": 1, "A": -2},
    "Pa s2/m3": {"P": 1, "A": -1},
}
"""Powers of the machine's sizes by the unit of an amplitude."""

_STEPS = 10
"""Steps a decade to which ratios are rounded."""


def in_size_of(family: Family, machine: Structure) -> Family:
    """A family with typical numbers and bounds of its amplitudes in the size of a machine."""
    ratio = _ratios(machine)
    shapes = []
    for shape in family.shapes:
        powers = _POWERS.get(shape.unit, {}) if shape.amplitude else {}
        factor = math.prod(ratio[size] ** power for size, power in powers.items())
        scaled = {key: factor * getattr(shape, key) for key in ("typical", "low", "high", "scale")}
        shapes.append(shape if factor == 1.0 else replace(shape, **scaled))
    return replace(family, shapes=tuple(shapes))


def scaled_families(machine: Structure) -> dict[str, Family]:
    """All families by name in the size of a machine."""
    return {name: in_size_of(family, machine) for name, family in families().items()}


def _ratios(machine: Structure) -> dict[str, float]:
    """Sizes of a machine over those of the LHPOST6, rounded."""
    own, reference = _sizes(machine), _reference()
    return {key: 10.0 ** (round(_STEPS * math.log10(own[key] / reference[key])) / _STEPS) for key in own}


def _sizes(machine: Structure) -> dict[str, float]:
    area, stroke = (max(getattr(a, key) for a in machine.actuators) for key in ("area_a", "stroke"))
    pressure = machine.hydraulics.supply_pressure
    return {"F": pressure * area, "A": area, "L": stroke, "M": max(machine.platen.mass), "P": pressure}


@cache
def _reference() -> dict[str, float]:
    stated = load_parameters("lhpost6")

    def most(name: str) -> float:
        return max(float(np.max(q.value)) for path, q in stated.items() if path.partition(".")[2] == name)

    pressure = most("supply_pressure")
    sizes = {"A": most("area_a"), "L": most("stroke"), "M": most("mass"), "P": pressure}
    return {"F": pressure * sizes["A"], **sizes}
