"""The effect table that compiled code reads: one row a port (a pad has two).

Adding an effect adds rows or changes numbers in them; nothing is compiled anew.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..core.errors import UnknownNameError
from ..laws.contract import Law, first_numbers
from .effect import Effect
from .modifiers import modify_rows
from .registry import CODES, LAWS, PORTS, ROW

__all__ = ["effect_table", "state_names"]


def effect_table(effects: Sequence[Effect], ports: Sequence[str]) -> NDArray[np.void]:
    """Rows of all effects for compiled code; raises UnknownNameError for a port that does not exist."""
    number = {name: i for i, name in enumerate(ports)}
    acting = [e for e in effects if not LAWS[e.law].modifies]
    rows = np.zeros(sum(len(e.ports) for e in acting), ROW)
    for column in (*PORTS, "actuator_state", "line_state", "supply_line_state"):
        rows[column] = -1
    actuator: dict[str, int] = {}  # row of the actuator on a port
    i = state = 0
    for ledger, effect in enumerate(acting):
        law = LAWS[effect.law]
        for k, port in enumerate(effect.ports):
            names = _port_names(port, law)
            for name in names:
                if name not in number:
                    raise UnknownNameError("port", name, list(ports))
            row = rows[i]
            row["law"], row["effect"] = CODES[effect.law], ledger
            for column, name in zip(PORTS, names, strict=False):
                row[column] = number[name]
            row["spool"] = effect.spools[k] if effect.spools else -1
            row["numbers"][: len(effect.params[k])] = effect.params[k]
            states = _states(law, effect.params[k])
            row["state"] = state if states else -1
            if law.takes_spool:
                actuator[names[0]] = i
            if (leg := names[0].split(".")[0]) in actuator:
                row["actuator_state"] = rows[actuator[leg]]["state"]
            i, state = i + 1, state + len(states)
    modify_rows(rows, effects, actuator, state)
    return rows


def _port_names(port: str, law: Law) -> tuple[str, ...]:
    if law.ports[1] == 1:
        return (port,)
    return tuple(port.removesuffix(" -").split()) if " " in port else (f"{port}.x", f"{port}.y")


def _states(law: Law, numbers: Sequence[float]) -> tuple[str, ...]:
    """Hidden states of a row with the numbers that its effect states; those that only modifiers fill are zero."""
    if not law.state_needs:
        return law.states
    place = first_numbers(law)
    at = {name: place[parameter] for name, parameter in law.state_needs}
    return tuple(n for n in law.states if n not in at or (at[n] < len(numbers) and numbers[at[n]] > 0.0))


def state_names(effects: Sequence[Effect]) -> tuple[str, ...]:
    """Names of all hidden states in table order, such as ``actuators_4_way.H1.pressure_a``; modifiers' come last.

    Of two ports named, the first counts.
    """
    names = []
    for effect in sorted(effects, key=lambda effect: bool(LAWS[effect.law].modifies)):
        law = LAWS[effect.law]
        for port, numbers in zip(effect.ports, effect.params, strict=True):
            names += [f"{effect.name}.{port.split()[0]}.{state}" for state in _states(law, numbers)]
    return tuple(names)
