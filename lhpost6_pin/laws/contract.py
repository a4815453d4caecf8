"""The contract of a law: what its module exports, and the attributes that the evaluation of a machine reads.

A module of a law exports LAW and, as compiled scalar functions,

    force(p, ...)      force on its port [N or N m], a tuple where it acts on two or three
    rates(p, ...)      rates of its hidden states, where it has any
    advance(p, ...)    the states after one step, exact wherever the law allows it
    power(p, ...)      dissipated power [W] and stored energy [J]; without it all work is dissipated and nothing stored

p is the law's NamedTuple of parameters. The names of the other arguments are their meaning: s, s_2, s_3 the
coordinates of its ports, v, v_2, v_3 their rates, d, d_2, d_3 their increments over the step dt, the names of its
states, `load` the force of the actuator on the same leg, `planar` whether there is a second port, `work` the power of
its forces. Ports that are optional and absent give zeros. `effects.dispatch` is generated from these signatures.

A law that modifies others (`modifies`) makes no force; its parameters fill `fields` of what it modifies.
"""

from functools import cache
from typing import Any, NamedTuple, get_type_hints

__all__ = ["Law", "first_numbers", "parameter_sizes", "parameter_units"]


class Law(NamedTuple):
    """Attributes of a law."""

    parameters: type  # a NamedTuple, each field annotated with its unit
    ports: tuple[int, int] = (1, 1)  # least and most that one set of parameters acts on
    states: tuple[str, ...] = ()  # hidden states by name
    state_needs: tuple[tuple[str, str], ...] = ()  # a state and the parameter that is positive where there is one
    amplitude: tuple[str, ...] = ()  # parameters that its hidden states do not depend on
    stores_energy: bool = False
    takes_spool: bool = False
    inlined: bool = False  # evaluated within the loop over the table: the report's laws, which every machine has
    friction_memory: bool = False  # its states are the friction's memory of where the platen has been
    acts_on_gas: bool = False  # it is, or changes, the gas of a strut
    feels_load: bool = False  # its force depends on that of the actuator on the same leg
    follows_motion: bool = False  # its states average noise: they follow the measured motion, not a still path
    modifies: str = ""  # "oil" of an actuator, "supply", "valve", "leg", "inertia"; empty: it makes forces
    fields: tuple[str, ...] = ()  # of what it modifies, filled by its parameters in order; amplitudes add up


@cache
def _fields(law: Law) -> dict[str, tuple[str, int]]:
    """Unit of each parameter, and how many values it has where it is a table, else 0."""
    hints: dict[str, Any] = get_type_hints(law.parameters, include_extras=True)
    return {name: (*hint.__metadata__, 0)[:2] for name, hint in hints.items()}


@cache
def parameter_sizes(law: Law) -> dict[str, int]:
    """How many numbers each parameter has, in order."""
    return {name: max(1, count) for name, (_, count) in _fields(law).items()}


@cache
def first_numbers(law: Law) -> dict[str, int]:
    """Place of each parameter's first number among all."""
    places, at = {}, 0
    for name, size in parameter_sizes(law).items():
        places[name], at = at, at + size
    return places


@cache
def parameter_units(law: Law) -> tuple[tuple[str, str], ...]:
    """Names and units of the numbers that an effect states, in order; a table of n values is `name_1` to `name_n`.

    Parameters with defaults are filled by modifiers alone.
    """
    found: list[tuple[str, str]] = []
    for name, (unit, count) in _fields(law).items():
        if name not in law.parameters._field_defaults:  # type: ignore[attr-defined]
            found += [(f"{name}_{k + 1}", unit) for k in range(count)] if count else [(name, unit)]
    return tuple(found)
