"""Effects: what law acts on which ports with which numbers; and the tables that compiled code reads.

An `Effect` is one entry of the force ledger. `LAWS` says of each law how many ports it joins, its parameters with
units, its hidden states and what it can say of energy. `effect_table` turns a list of effects into rows, one a port
(a pad has two): adding an effect adds rows, nothing is compiled anew.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .components import Actuator, Hydraulics, Strut
from .errors import ParameterError, UnknownNameError
from .laws.orifice import width_ratios

__all__ = [
    "BOUC_WEN_1D",
    "BOUC_WEN_2D",
    "HYDRAULIC_DOUBLE",
    "HYDRAULIC_SINGLE",
    "LAWS",
    "NITROGEN_STRUT",
    "ROW",
]
__all__ += ["VISCOUS", "Effect", "Law", "effect_table", "standard_effects"]

MAX_PARAMS = 12

ROW = np.dtype(
    [
        ("law", np.int64),  # code of the law
        ("effect", np.int64),  # number of the effect in the ledger
        ("port", np.int64),  # port it acts on
        ("port_2", np.int64),  # second port, -1 without
        ("state", np.int64),  # number of its first hidden state, -1 without
        ("input", np.int64),  # number of the spool that feeds it, -1 without
        ("p", np.float64, MAX_PARAMS),  # the law's numbers, in the law's order
    ]
)
"""Table row: one law on one port (or pair of ports)."""

# Codes of the laws, as the compiled stage reads them.
HYDRAULIC_DOUBLE, HYDRAULIC_SINGLE, NITROGEN_STRUT, BOUC_WEN_1D, BOUC_WEN_2D, VISCOUS = range(6)


class Law(NamedTuple):
    """What a law needs; the law itself is a kernel in ``laws/``."""

    code: int
    ports: int
    params: tuple[tuple[str, str], ...]  # (name, unit)
    states: tuple[str, ...] = ()
    stores_energy: bool = False
    takes_spool: bool = False


_FLOW = tuple((name, "m3/s/Pa^0.5") for name in ("flow_pa", "flow_bt", "flow_at", "flow_pb"))
_HYDRAULIC = (
    ("area_a", "m2"),
    ("area_b", "m2"),
    *_FLOW,
    ("flow_curve", "1"),
    ("leakage", "m3/s/Pa"),
    ("chamber_a", "m"),
    ("chamber_b", "m"),
    ("bulk_modulus", "Pa"),
    ("root_regularisation", "Pa"),
)
_FRICTION = (("friction", "N"), ("yield_slip", "m"), ("shape", "1"))

LAWS: Mapping[str, Law] = {
    "hydraulic_double": Law(HYDRAULIC_DOUBLE, 1, _HYDRAULIC, ("pressure_a", "pressure_b"), True, True),
    "hydraulic_single": Law(HYDRAULIC_SINGLE, 1, _HYDRAULIC, ("pressure_a",), True, True),
    "nitrogen_strut": Law(
        NITROGEN_STRUT,
        1,
        (("pressure", "Pa"), ("area", "m2"), ("gas_length", "m"), ("polytropic_index", "1")),
        stores_energy=True,
    ),
    "bouc_wen_1d": Law(BOUC_WEN_1D, 1, _FRICTION, ("z",)),
    "bouc_wen_2d": Law(BOUC_WEN_2D, 2, _FRICTION, ("z_x", "z_y")),
    "viscous": Law(VISCOUS, 1, (("coefficient", "N s/m"),)),
}
"""All laws by name."""


@dataclass(frozen=True)
class Effect:
    """A named force effect: where it acts, what law it obeys, its numbers, and where they come from.

    ports: one name per row (``H1``, ``S2``, ``platen.z``); a two-port law takes the stem of a pad (``V1``).
    params: one tuple per row, in the law's order. spools: for a hydraulic law, the number of its spool per row.
    """

    name: str
    law: str
    ports: tuple[str, ...]
    params: tuple[tuple[float, ...], ...]
    source: str
    spools: tuple[int, ...] = ()

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
    rows = np.zeros(sum(len(e.ports) for e in effects), ROW)
    i = state = 0
    for ledger, effect in enumerate(effects):
        law = LAWS[effect.law]
        for k, port in enumerate(effect.ports):
            names = (port,) if law.ports == 1 else (f"{port}.x", f"{port}.y")
            for name in names:
                if name not in number:
                    raise UnknownNameError("port", name, list(ports))
            row = rows[i]
            row["law"], row["effect"] = law.code, ledger
            row["port"] = number[names[0]]
            row["port_2"] = number[names[-1]] if law.ports == 2 else -1
            row["state"] = state if law.states else -1
            row["input"] = effect.spools[k] if effect.spools else -1
            row["p"][: len(law.params)] = effect.params[k]
            i, state = i + 1, state + len(law.states)
    return rows


def state_names(effects: Sequence[Effect]) -> tuple[str, ...]:
    """Names of all hidden states in table order, such as ``actuators_4_way.H1.pressure_a``."""
    return tuple(
        f"{effect.name}.{port}.{state}"
        for effect in effects
        for port in effect.ports
        for state in LAWS[effect.law].states
    )
