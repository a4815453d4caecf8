"""The effect table that compiled code reads: one row a port (a pad has two).

Adding an effect adds rows or changes numbers in them; nothing is compiled anew.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..core.errors import UnknownNameError
from .effect import Effect
from .modifiers import alter_rows
from .registry import HYDRAULIC_DOUBLE, HYDRAULIC_SINGLE, LAWS, NITROGEN_STRUT, PORTS, ROW, Law

__all__ = ["effect_table", "state_names"]


def effect_table(effects: Sequence[Effect], ports: Sequence[str]) -> NDArray[np.void]:
    """Rows of all effects for compiled code; raises UnknownNameError for a port that does not exist."""
    number = {name: i for i, name in enumerate(ports)}
    acting = [e for e in effects if not LAWS[e.law].alters]
    rows = np.zeros(sum(len(e.ports) for e in acting), ROW)
    for column in (*PORTS, "link", "more", "feed"):
        rows[column] = -1
    base: dict[int, int] = {}  # row of the actuator or strut on a port
    i = state = 0
    for ledger, effect in enumerate(acting):
        law = LAWS[effect.law]
        for k, port in enumerate(effect.ports):
            names = _port_names(port, law)
            for name in names:
                if name not in number:
                    raise UnknownNameError("port", name, list(ports))
            leg = number.get(names[0].split(".")[0], -1)
            row = rows[i]
            row["law"], row["effect"] = law.code, ledger
            for column, name in zip(PORTS, names, strict=False):
                row[column] = number[name]
            row["state"] = state if law.states else -1
            row["input"] = effect.spools[k] if effect.spools else -1
            row["p"][: len(law.params)] = effect.params[k]
            if law.code in (HYDRAULIC_DOUBLE, HYDRAULIC_SINGLE, NITROGEN_STRUT):
                base[number[names[0]]] = i
            if leg in base and rows[base[leg]]["input"] >= 0:
                row["link"] = rows[base[leg]]["state"]
            i, state = i + 1, state + len(law.states)
    alter_rows(rows, effects, {port: base[number[port]] for port in ports if number[port] in base}, state)
    return rows


def _port_names(port: str, law: Law) -> tuple[str, ...]:
    if law.ports == 1:
        return (port,)
    return tuple(port.removesuffix(" -").split()) if " " in port else (f"{port}.x", f"{port}.y")


def state_names(effects: Sequence[Effect]) -> tuple[str, ...]:
    """Names of all hidden states in table order, such as ``actuators_4_way.H1.pressure_a``; alterations' come last.

    Of two ports named, the first counts.
    """
    in_order = sorted(effects, key=lambda effect: bool(LAWS[effect.law].alters))
    return tuple(
        f"{effect.name}.{port.split()[0]}.{state}"
        for effect in in_order
        for port in effect.ports
        for state in LAWS[effect.law].states
    )
