"""Families in the size of a machine: typical numbers and bounds of the library are those of the LHPOST6.

An amplitude with the unit of the table scales with the ratio of the machines: rated force F, largest piston area A and
stroke L of an actuator, mass of the platen M, supply pressure P. Numbers of other units, and shapes (speeds,
frequencies, exponents), are those of seals, valves and structures of any size. Ratios are rounded, so that a machine
has the same families whatever its numbers were fitted to.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from ..parameters import load_parameters
from ..structure import Structure
from .family import Family, Shape, families

__all__ = ["in_size_of", "scaled_families", "size_of"]

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
    return scaled_families(machine)[family.name]


def scaled_families(machine: Structure) -> Mapping[str, Family]:
    """All families by name in the size of a machine."""
    return _scaled(size_of(machine))


def size_of(machine: Structure) -> tuple[int, ...]:
    """Steps by which each of the sizes of `_reference` is larger in a machine, or in the one that it was fitted from.

    A prior may be so wide that the numbers fitted make another size, while candidates keep their bounds.
    """
    if machine.size is not None:
        return machine.size
    own, reference = _sizes(machine), _reference()
    return tuple(round(_STEPS * math.log10(own[size] / reference[size])) for size in reference)


@cache
def _scaled(steps: tuple[int, ...]) -> Mapping[str, Family]:
    """All families where each of the sizes of `_reference` is so many steps larger: a fit makes many machines."""
    ratio = {size: 10.0 ** (step / _STEPS) for size, step in zip(_reference(), steps, strict=True)}
    return {name: replace(f, shapes=tuple(_of_ratio(s, ratio) for s in f.shapes)) for name, f in families().items()}


def _of_ratio(shape: Shape, ratio: Mapping[str, float]) -> Shape:
    """A number of a family at ratios of a machine's sizes."""
    powers = _POWERS.get(shape.unit, {}) if shape.amplitude else {}
    factor = math.prod(ratio[size] ** power for size, power in powers.items())
    scaled = {key: factor * getattr(shape, key) for key in ("typical", "low", "high", "scale")}
    return shape if factor == 1.0 else replace(shape, **scaled)


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
