"""What a record states of the pumps and accumulators of its machine."""

from dataclasses import asdict

from .machine import Machine

__all__ = ["power_supply_facts"]


def power_supply_facts(machine: Machine) -> dict[str, float | str]:
    """The numbers that are stated, and as `NAME_evidence` where each comes from."""
    found: dict[str, float | str] = {}
    for name, value in asdict(machine.power_supply).items():
        if value is not None:
            evidence = machine.parameters[f"power_supply.{name}"].evidence
            found |= {name: value, f"{name}_evidence": evidence}
    return found
