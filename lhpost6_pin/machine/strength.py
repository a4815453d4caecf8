"""What the parts of a machine bear, from section `table_2_2` of its file; what is not stated has no limit."""

import math
from typing import NamedTuple

from .parameters import Parameters

__all__ = ["Strength", "stated_strength"]


class Strength(NamedTuple):
    """Strengths and limits of parts (Table 2.2, notes); infinity, or zero of a pressure, where none is stated."""

    reaction_mass: tuple[float, float] = (math.inf, math.inf)  # along X and Y, note 2 [N]
    platen_up: float = math.inf  # vertical actuators less hold-down, note 6 [N]
    rise: float = math.inf  # acceleration upwards that the platen bears, note 3 [m/s2]
    least_pressure: float = 0.0  # in the chamber of a vertical actuator, note 4 [Pa]
    tilt: float = math.inf  # of a vertical piston in its cylinder, Section 3.4.2 [rad]
    payload: float = math.inf  # weight [N]


def stated_strength(parameters: Parameters) -> Strength:
    """Strengths that a machine file states."""
    found: dict[str, float] = {}
    names = {"rise": "acceleration_platen_up", "least_pressure": "chamber_pressure_down", "tilt": "platen_tilt"}
    for name, key in {**names, "payload": "payload"}.items():
        if f"table_2_2.{key}" in parameters:
            found[name] = parameters.number(f"table_2_2.{key}")
    strength = Strength(**found)
    if "table_2_2.force_strength" in parameters:
        x, y, up = parameters.vector("table_2_2.force_strength")
        strength = strength._replace(reaction_mass=(x, y), platen_up=up)
    return strength
