"""Pumps and accumulators behind the supply, from section `power_supply` of a machine's file, where it has one."""

from .machine import Machine

__all__ = ["NUMBERS", "power_supply"]

NUMBERS = ("pump_flow", "accumulators")
"""Flow of all pumps [m3/s]; volume of the accumulators [m3]."""


def power_supply(machine: Machine) -> dict[str, float | str]:
    """The numbers stated, and as `NAME_evidence` where each comes from."""
    found: dict[str, float | str] = {}
    for name in NUMBERS:
        if (path := f"power_supply.{name}") in machine.parameters:
            found[name] = machine.parameters.number(path)
            found[f"{name}_evidence"] = machine.parameters[path].evidence
    return found
