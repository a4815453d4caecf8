"""Modifiers: effects that make no force of their own but change actuators, the supply, valves, bearings or the platen.

Amplitudes, the first of an effect's parameters, of several effects on one thing add up; its other parameters are those
of the last one. An amplitude of zero changes nothing.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import ParameterError, UnknownNameError
from ..laws.chamber import side_shares
from ..laws.hydraulic import Hydraulic
from ..laws.platen_body import MoreInertia
from ..laws.supply import Supply
from .effect import Effect
from .registry import LAWS

__all__ = ["added_inertias", "command_path", "modify_rows", "supply_of", "thrust_shares"]

_PLACE = {name: i for i, name in enumerate(Hydraulic._fields)}

_OF_CHAMBERS = ("dead_volume", "external_leakage")
"""Laws of chambers whose second number is the side of the piston."""


def _acting(effects: Sequence[Effect], kind: str) -> Iterator[tuple[Effect, str, tuple[float, ...]]]:
    """Effect, component and numbers of all modifiers of a kind."""
    for effect in effects:
        if LAWS[effect.law].modifies == kind:
            for component, numbers in zip(effect.ports, effect.params, strict=True):
                yield effect, component, numbers


def modify_rows(rows: NDArray[np.void], effects: Sequence[Effect], at: Mapping[str, int], states: int) -> None:
    """Apply the modifiers of oil to the rows of actuators, in place.

    at are the rows of actuators by name; `states` hidden states are taken, modifiers have the next ones. Raises
    UnknownNameError for an actuator that does not exist.
    """
    modifiers = [e for e in effects if LAWS[e.law].modifies]
    firsts = {}
    for effect in modifiers:
        for port in effect.ports:
            firsts[effect.name, port], states = states, states + len(LAWS[effect.law].states)
    for effect, component, numbers in _acting(modifiers, "oil"):
        if component not in at:
            raise UnknownNameError("component", component, list(at))
        row, law = rows[at[component]], LAWS[effect.law]
        if numbers[0] == 0.0:
            continue
        if effect.law in _OF_CHAMBERS and row["numbers"][_PLACE["area_b"]] == 0.0:
            numbers = (numbers[0], 0.0)  # one chamber alone has no side
        if effect.law == "dead_volume":
            for side, share in zip("ab", side_shares(numbers[1]), strict=True):
                if (area := row["numbers"][_PLACE[f"area_{side}"]]) > 0.0:
                    row["numbers"][_PLACE[f"chamber_{side}"]] += numbers[0] * share / area
            continue
        amplitude, *others = (_PLACE[field] for field in law.fields)
        row["numbers"][amplitude] += numbers[0]
        row["numbers"][others] = numbers[1:]
        row["modified"] |= law.fields[0] in Hydraulic._field_defaults
        if law.states:
            before = law.fields[0].startswith("supply")
            row["supply_line_state" if before else "line_state"] = firsts[effect.name, component]


def supply_of(effects: Sequence[Effect], states: Sequence[str], pressure: float, return_pressure: float) -> Supply:
    """Supply with what modifiers make of its stated pressures [Pa]; states are the names of all hidden states."""
    found: dict[str, Any] = {}
    for effect, component, numbers in _acting(effects, "supply"):
        law = LAWS[effect.law]
        amplitude, *others, state = law.fields
        found[amplitude] = found.get(amplitude, 0.0) + numbers[0]
        found |= zip(others, numbers[1:], strict=True)
        found.setdefault(state, float(states.index(f"{effect.name}.{component}.{law.states[0]}")))
    return Supply(pressure, return_pressure, **found)


def command_path(effects: Sequence[Effect], delays: Mapping[str, float]) -> tuple[list[float], list[float]]:
    """Delays and time constants of lags [s] of all valves, from the delays of their actuators by name.

    Raises UnknownNameError for an actuator that does not exist, ParameterError for a delay below zero.
    """
    path = {"delay": dict(delays), "lag": dict.fromkeys(delays, 0.0)}
    for effect, component, (value,) in _acting(effects, "valve"):
        (kind,) = LAWS[effect.law].fields
        if component not in path[kind]:
            raise UnknownNameError("component", component, list(delays))
        path[kind][component] += value
        if path[kind][component] < 0.0:
            early = -path[kind][component]
            raise ParameterError(f"{effect.name}: the valve of {component} would act {early:g} s ahead of it")
    return list(path["delay"].values()), list(path["lag"].values())


def thrust_shares(effects: Sequence[Effect], components: Sequence[str]) -> list[float]:
    """By which share the thrust of each component turns to the other direction; raises UnknownNameError."""
    shares = dict.fromkeys(components, 0.0)
    for _, component, (share,) in _acting(effects, "leg"):
        if component not in shares:
            raise UnknownNameError("bearing", component, list(components))
        shares[component] += share
    return list(shares.values())


def added_inertias(effects: Sequence[Effect]) -> list[tuple[str, MoreInertia]]:
    """Inertias that effects add to the platen, with the names of the effects."""
    return [(effect.name, MoreInertia(*numbers)) for effect, _, numbers in _acting(effects, "inertia")]
