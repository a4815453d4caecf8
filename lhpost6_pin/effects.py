"""Effects: what law acts on which ports with which numbers; and the tables that compiled code reads.

An `Effect` with rows is one entry of the force ledger; one without alters rows of others (`law_table`).
`effect_table` turns a list of effects into rows, one a port (a pad has two): adding an effect adds rows or changes
numbers in them, nothing is compiled anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .alterations import alter_rows
from .components import Actuator, Hydraulics, Strut
from .errors import ParameterError, UnknownNameError
from .law_table import HYDRAULIC_DOUBLE, HYDRAULIC_SINGLE, LAWS, NITROGEN_STRUT, PORTS, ROW, Law
from .laws.orifice import width_ratios

__all__ = ["Effect", "effect_table", "standard_effects", "state_names"]


@dataclass(frozen=True)
class Effect:
    """A named effect: where it acts, what law it obeys, its numbers, and where they come from.

    ports: one name per row (``H1``, ``S2``, ``platen.z``); a two-port law takes the stem of a pad (``V1``), or
    two names with a space between, the second a dash where one port is enough; a three-port law two or three. One
    that alters takes the names of what it alters.
    params: one tuple per row, in the law's order. spools: for a hydraulic law, the number of its spool per row.
    """

    name: str
    law: str
    ports: tuple[str, ...]
    params: tuple[tuple[float, ...], ...]
    source: str
    spools: tuple[int, ...] = ()
    family: str = ""  # of the library; empty for the report's and what is made by hand

    def __post_init__(self) -> None:
        """Check the shape; raises UnknownNameError or ParameterError."""
        if self.law not in LAWS:
            raise UnknownNameError("law", self.law, list(LAWS))
        law = LAWS[self.law]
        if len(self.params) != len(self.ports):
            raise ParameterError(f"{self.name}: {len(self.params)} sets of numbers for {len(self.ports)} ports")
        for port, numbers in zip(self.ports, self.params, strict=True):
            if len(numbers) != len(law.params):
                wanted = ", ".join(f"{name} [{unit}]" for name, unit in law.params)
                raise ParameterError(f"{self.name} on {port}: {len(numbers)} numbers given; {self.law} takes {wanted}")
            if not np.all(np.isfinite(numbers)):
                raise ParameterError(f"{self.name} on {port}: {numbers!r} is not finite")
        if law.takes_spool != bool(self.spools) or (self.spools and len(self.spools) != len(self.ports)):
            raise ParameterError(
                f"{self.name}: a {self.law} law takes {'one spool' if law.takes_spool else 'no spool'}"
            )


def standard_effects(actuators: Sequence[Actuator], struts: Sequence[Strut], oil: Hydraulics) -> tuple[Effect, ...]:
    """The report's effects (Chapter 4) for these components, in ledger order; friction of zero has no row."""
    found = []
    for law, valve in (("hydraulic_double", "4-way"), ("hydraulic_single", "3-way")):
        fed = [(i, a) for i, a in enumerate(actuators) if a.valve == valve]
        if fed:
            found.append(
                Effect(
                    f"actuators_{valve.replace('-', '_')}",
                    law,
                    tuple(a.name for _, a in fed),
                    tuple(_hydraulic_numbers(a, oil) for _, a in fed),
                    "Eqs. 4-1 to 4-6",
                    tuple(i for i, _ in fed),
                )
            )
    if struts:
        gas = tuple((s.pressure, s.area, s.gas_length, s.polytropic_index) for s in struts)
        found.append(Effect("hold_down", "nitrogen_strut", tuple(s.name for s in struts), gas, "Eq. 4-8"))
    legs: list[Actuator | Strut] = [*actuators, *struts]
    rubbing = [c for c in legs if c.seal_friction > 0.0]
    if rubbing:
        seals = tuple((c.seal_friction, c.seal_yield, c.seal_shape) for c in rubbing)
        found.append(Effect("seal_friction", "bouc_wen_1d", tuple(c.name for c in rubbing), seals, "Eq. 4-18"))
    pads = [a for a in actuators if a.mount == "bearing" and a.pad_friction]
    if pads:
        slip = tuple((a.pad_friction, a.pad_yield, a.pad_shape) for a in pads)
        found.append(Effect("pad_friction", "bouc_wen_2d", tuple(a.name for a in pads), slip, "Eqs. 4-12 to 4-17"))
    viscous = tuple((a.viscous,) for a in actuators)
    found.append(Effect("viscous", "viscous", tuple(a.name for a in actuators), viscous, "Eq. 4-19"))
    return tuple(found)


def _hydraulic_numbers(actuator: Actuator, oil: Hydraulics) -> tuple[float, ...]:
    flow = actuator.flow * actuator.valves / oil.rated_pressure**0.5
    if actuator.valve == "4-way":
        w1, w2, w3, w4 = width_ratios(actuator.area_a, actuator.area_b)
    else:
        w1, w2, w3, w4 = 1.0, 0.0, 1.0, 0.0
    return (
        actuator.area_a,
        actuator.area_b or 0.0,
        flow * w1,
        flow * w2,
        flow * w3,
        flow * w4,
        actuator.flow_curve,
        actuator.leakage,
        actuator.chamber_a,
        actuator.chamber_b or 0.0,
        oil.bulk_modulus,
        oil.root_regularisation,
    )


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
