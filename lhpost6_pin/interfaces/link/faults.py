"""Faults that a served plant offers: effects of the library in their typical size, named as EFFECT@WHERE."""

from collections.abc import Iterable

from ...core.errors import ParameterError
from ...machine.machine import Machine
from ...mechanics.plant import Plant, make_plant

__all__ = ["make_faults"]


def make_faults(machine: Machine, names: Iterable[str]) -> dict[str, Plant]:
    """Plants by the name of the one fault that each has beside what the machine has already.

    A name is a family of the library and components, as `entrained_air@H1` or `piston_leakage@H1,H2`; without @ the
    effect is on all components that it can act on first (`library.Family.groups`). Its numbers are the typical ones of
    the library in the size of the machine. Raises UnknownNameError or ParameterError.
    """
    found = {}
    for name in names:
        family, at, where = name.partition("@")
        if not family or (at and not where):
            raise ParameterError(f"fault {name!r}: write EFFECT@WHERE, such as entrained_air@H1")
        found[name] = make_plant(machine.with_effect(family, where.split(",") if at else (), name=name))
    return found
