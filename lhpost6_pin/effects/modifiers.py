"""Effects that make no force of their own: they change numbers of actuators, of the supply, of valves' command paths.

Amplitudes, the first of an effect's numbers, of several effects on one thing add up; its other numbers are those of the
last one. An amplitude of zero changes nothing.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..core.errors import ParameterError, UnknownNameError
from ..laws.chamber import side_shares
from .effect import Effect
from .registry import (
    AIR,
    AREA_A,
    AREA_B,
    BACK,
    BACK_TIME,
    CHAMBER_A,
    CHAMBER_B,
    CURVE_ERROR,
    DEADBAND,
    DRAWN,
    DROOP,
    DROOP_TIME,
    EXTERNAL,
    FEED_INERTANCE,
    LAWS,
    LEAKAGE,
    LINE_TIME,
    NULL_BIAS,
    NULL_LEAKAGE,
    PLAY,
    RETURNED,
    TURBULENT,
    VOIDS,
    WEIGHT,
)

__all__ = ["alter_rows", "command_path", "supply_numbers"]

_PLACE = {
    "turbulent_leakage": TURBULENT,
    "external_leakage": EXTERNAL,
    "null_leakage": NULL_LEAKAGE,
    "null_bias": NULL_BIAS,
    "deadband": DEADBAND,
    "entrained_air": AIR,
    "cavitation": VOIDS,
    "flow_curve": CURVE_ERROR,
    "line": LINE_TIME,
    "play": PLAY,
    "supply_line": FEED_INERTANCE,
}
"""Where an actuator's row keeps the numbers of a law, one behind the other."""

_SUPPLY_PLACE = {"supply_droop": (DROOP, DROOP_TIME, DRAWN), "back_pressure": (BACK, BACK_TIME, RETURNED)}


def alter_rows(rows: NDArray[np.void], effects: Sequence[Effect], at: Mapping[str, int], states: int) -> None:
    """Change rows in place as the effects among `effects` say that alter oil.

    at are the rows of actuators and struts by name; `states` hidden states are taken, alterations have the next ones.
    Raises UnknownNameError for a component that does not exist.
    """
    for effect in effects:
        law = LAWS[effect.law]
        if not law.alters:
            continue
        for port, numbers in zip(effect.ports, effect.params, strict=True):
            first, states = states, states + len(law.states)
            if law.alters != "oil":
                continue
            if port not in at:
                raise UnknownNameError("component", port, list(at))
            row, amplitude = rows[at[port]], numbers[0]
            if amplitude == 0.0:
                continue
            p = row["p"]
            if effect.law == "extra_leakage":
                p[LEAKAGE] += amplitude
            elif effect.law == "dead_volume":
                share_a, share_b = side_shares(numbers[1])
                p[CHAMBER_A] += amplitude * share_a / p[AREA_A]
                if p[AREA_B] > 0.0:
                    p[CHAMBER_B] += amplitude * share_b / p[AREA_B]
            else:
                place = _PLACE[effect.law]
                p[place] += amplitude
                p[place + 1 : place + len(numbers)] = numbers[1:]
                row["altered"] = 1
                if law.states:
                    row["feed" if effect.law == "supply_line" else "more"] = first


def supply_numbers(effects: Sequence[Effect], states: Sequence[str]) -> tuple[float, ...]:
    """Numbers of the supply behind its two pressures, in the places of `law_table`; none without effects on it."""
    found = np.zeros(9)
    found[[DRAWN, RETURNED]], found[WEIGHT] = -1.0, 1.0
    acting = [e for e in effects if LAWS[e.law].alters == "supply"]
    for effect in acting:
        size, time, state = _SUPPLY_PLACE[effect.law]
        found[size] += effect.params[0][0]
        found[time] = effect.params[0][1]
        if effect.law == "supply_droop":
            found[WEIGHT] = effect.params[0][2]
        if found[state] < 0.0:
            found[state] = states.index(f"{effect.name}.{effect.ports[0]}.{LAWS[effect.law].states[0]}")
    return tuple(float(x) for x in found[2:]) if acting else ()


def command_path(effects: Sequence[Effect], delays: Mapping[str, float]) -> tuple[list[float], list[float]]:
    """Delays and time constants of lags [s] of all valves, from the delays of their actuators by name.

    Raises UnknownNameError for an actuator that does not exist, ParameterError for a delay below zero.
    """
    late, lag = dict(delays), dict.fromkeys(delays, 0.0)
    for effect in effects:
        if LAWS[effect.law].alters != "valve":
            continue
        path = late if effect.law == "valve_delay" else lag
        for port, numbers in zip(effect.ports, effect.params, strict=True):
            if port not in path:
                raise UnknownNameError("component", port, list(path))
            path[port] += numbers[0]
            if path[port] < 0.0:
                raise ParameterError(f"{effect.name}: the valve of {port} would act {-path[port]:g} s ahead of it")
    return list(late.values()), list(lag.values())
