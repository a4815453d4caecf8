"""What the parts of a machine bear, from section `table_2_2` of its file; what is not stated has no limit."""

import math
from typing import NamedTuple

from .parameters import Parameters

__all__ = ["Strength", "stated_strength"]


class Strength(NamedTuple):
    """Strengths and limits of parts (Table 2.2, notes); infinity, or zero of a pressure, where none is stated."""

    reaction_mass: tuple[float, float] = (math.inf, math.inf)  # along X and Y, note 2 [N]
    reaction_moment: tuple[float, ...] = (math.inf, math.inf, math.inf)  # about X, Y and Z at B, note 2 [N m]
    platen_up: float = math.inf  # vertical actuators less hold-down, note 6 [N]
    rise: float = math.inf  # acceleration upwards that the platen bears, note 3 [m/s2]
    least_pressure: float = 0.0  # in the chamber of a vertical actuator, note 4 [Pa]
    tilt: float = math.inf  # of a vertical piston in its cylinder, Section 3.4.2 [rad]
    payload: float = math.inf  # weight [N]


def stated_strength(parameters: Parameters) -> Strength:
    """Strengths that a machine file states."""
    none = Strength()

    def number(key: str, default: float) -> float:
        path = f"table_2_2.{key}"
        return parameters.number(path) if path in parameters else default

    x, y, up = *none.reaction_mass, none.platen_up
    if "table_2_2.force_strength" in parameters:
        x, y, up = parameters.vector("table_2_2.force_strength")
    moment = none.reaction_moment
    if "table_2_2.moment_strength" in parameters:
        moment = parameters.vector("table_2_2.moment_strength")
    return Strength(
        reaction_mass=(x, y),
        reaction_moment=moment,
        platen_up=up,
        rise=number("acceleration_platen_up", none.rise),
        least_pressure=number("chamber_pressure_down", none.least_pressure),
        tilt=number("platen_tilt", none.tilt),
        payload=number("payload", none.payload),
    )
