"""Where the actuators of a drafted machine act, and what they can give along each axis in the zero-position."""

import cmath
import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array
from ...core.errors import ParameterError

__all__ = ["Leg", "guided_legs", "largest_travel", "leg_rows", "plan_distance", "platform_legs"]


class Leg(NamedTuple):
    """An actuator's name and its ends in {s}, control zero-position [m]."""

    name: str
    platen_point: Array  # (3,)
    base_point: Array  # (3,)


def guided_legs(motion: str, size: tuple[float, float], depth: float, length: float) -> list[Leg]:
    """One actuator along each guided axis, at the edge of the platen at half its depth; from below for z.

    It extends towards positive motion, as laboratories count force and pressure difference.
    """
    legs = []
    for axis in motion:
        k = "xyz".index(axis)
        point, away = np.array([0.0, 0.0, -0.5 * depth]), np.zeros(3)
        if axis == "z":
            point[2], away[2] = -depth, -length
        else:
            point[k], away[k] = -0.5 * size[k], -length
        legs.append(Leg(f"A{axis.upper()}", point, point + away))
    return legs


def platform_legs(radii: tuple[float, float], spreads: tuple[float, float], depth: float, length: float) -> list[Leg]:
    """Six legs from pairs of joints on the base, about 0, 120 and 240 deg, to pairs under the platen half-way between.

    radii [m] of the joints and spreads [rad], the angle between the two of a pair: under the platen, and on the base.
    Raises ParameterError if legs of that length [m] do not reach.
    """
    level = plan_distance(radii, spreads)
    if level >= length:
        least = math.ceil(1.0 + 1000.0 * level) / 1000.0
        raise ParameterError(
            f"--length {length:.4g} m: legs from joints {level:.4g} m apart in plan do not reach the platen; "
            f"give at least {least:.4g} m (legs at 45 deg: {math.sqrt(2.0) * level:.4g} m), or closer radii"
        )
    platen_radius, base_radius = radii
    legs: list[Leg] = []
    for pair in range(3):
        for side in (-1.0, 1.0):
            base = 2.0 * math.pi / 3.0 * pair + 0.5 * side * spreads[1]
            under = 2.0 * math.pi / 3.0 * pair + side * (math.pi / 3.0 - 0.5 * spreads[0])
            point = np.array([platen_radius * math.cos(under), platen_radius * math.sin(under), -depth])
            foot = np.array([base_radius * math.cos(base), base_radius * math.sin(base), 0.0])
            foot[2] = -depth - math.sqrt(length**2 - level**2)
            legs.append(Leg(f"L{len(legs) + 1}", point, foot))
    return legs


def plan_distance(radii: tuple[float, float], spreads: tuple[float, float]) -> float:
    """Distance in plan [m] of the two joints of a leg of `platform_legs`, the same of all six."""
    return abs(radii[0] * cmath.exp(1j * (math.pi / 3.0 - 0.5 * spreads[0])) - radii[1] * cmath.exp(0.5j * spreads[1]))


def leg_rows(legs: Sequence[Leg]) -> Array:
    """Rates of the legs per rate of C along x y z and of the turns about them (n, 6), zero-position (Eq. 3-33)."""
    rows = []
    for leg in legs:
        along = (leg.platen_point - leg.base_point) / np.linalg.norm(leg.platen_point - leg.base_point)
        rows.append(np.concatenate([along, np.cross(leg.platen_point, along)]))
    return np.array(rows)


def largest_travel(legs: Sequence[Leg], stroke: float, axes: Sequence[int]) -> float:
    """Largest displacement of C [m], or turn about it [rad], along all of these axes at once within the stroke [m].

    In either direction along each; more than one axis only of displacements. Found by bisection.
    """

    def used(size: float) -> float:
        worst = 0.0
        for signs in product((-1.0, 1.0), repeat=len(axes)):
            moved = np.zeros(6)
            moved[list(axes)] = size * np.array(signs)
            turn = _turn(moved[3:])
            for leg in legs:
                ends = moved[:3] + turn @ leg.platen_point - leg.base_point
                rest = np.linalg.norm(leg.platen_point - leg.base_point)
                worst = max(worst, float(abs(np.linalg.norm(ends) - rest)))
        return worst / stroke

    low, high = 0.0, stroke
    while used(high) < 1.0 and high < math.pi:  # no table turns further, nor is any leg so long
        low, high = high, 2.0 * high
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if used(middle) <= 1.0 else (low, middle)
    return low


def _turn(angles: Array) -> Array:
    """Rotation about x, y or z; two of the angles are zero."""
    k = int(np.argmax(np.abs(angles)))
    i, j = (k + 1) % 3, (k + 2) % 3
    out = np.eye(3)
    out[i, i] = out[j, j] = math.cos(angles[k])
    out[j, i], out[i, j] = math.sin(angles[k]), -math.sin(angles[k])
    return out
