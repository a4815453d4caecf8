"""Checks of a machine's file beyond unit and bound of each number; each raises ParameterError naming file and key."""

from dataclasses import fields

from ..core.errors import ParameterError, instead_of
from ..core.names import AXES
from .components import Accelerometer, Actuator, Floor, Hydraulics, Limits, Platen, PowerSupply, Strut
from .parameters import Parameters
from .structure import Structure

__all__ = ["check_actuator", "check_machine", "check_names"]

_COMPARISONS = ("estimates", "table_2_2", "table_2_2_payload")
"""Sections of numbers to compare with; their keys are free."""


def check_names(parameters: Parameters, components: list[str], kinds: set[str], floors: list[str]) -> None:
    """Refuse keys that nothing reads: a misspelt key must not be silently ignored."""
    both = {f.name for f in (*fields(Actuator), *fields(Strut)) if f.metadata}
    known = {
        "platen": {f.name for f in fields(Platen)},
        "hydraulics": {f.name for f in fields(Hydraulics)},
        "limits": {f.name for f in fields(Limits)},
        "power_supply": {f.name for f in fields(PowerSupply)},
        "machine": {
            "name",
            "title",
            "motion",
            "thrust",
            "bodies",
            "flow_reading",
            "valve_ports",
            "controller",
            "sensors",
        },
        **{name: both | {"role", "mount", "valve", "valves"} for name in kinds},
        **{name: both | {"kind", "valves"} for name in components},
        **{name: {f.name for f in fields(Floor)} for name in floors},
    }
    for path in (*parameters, *parameters.words):
        section, _, key = path.partition(".")
        if section == "accelerometer":
            section, _, key = path.rpartition(".")
            known[section] = {f.name for f in fields(Accelerometer) if f.metadata}
        if section in _COMPARISONS and path in parameters.quantities:
            continue
        if section not in known:
            hint = instead_of(section, sorted(known))
            if f"{section}.mass" in parameters:
                hint = f'a floor of a specimen, [floor.{section}], needs along, such as "x", beside its mass'
            raise ParameterError(f"{parameters.origin}: {path} is in no known section; {hint}")
        if key not in known[section]:
            hint = instead_of(key, sorted(known[section]))
            raise ParameterError(f"{parameters.origin}: unknown key {path}; {hint}")


def check_actuator(actuator: Actuator, origin: str) -> None:
    """Refuse an actuator that lacks what its valve and mount need, or whose stroke leaves no oil."""
    needed = {"4-way": ("area_b", "chamber_b"), "3-way": ()}[actuator.valve]
    needed += {"bearing": ("pad_friction", "pad_yield", "pad_shape"), "swivel": ()}[actuator.mount]
    for key in needed:
        if getattr(actuator, key) is None:
            why = f"{actuator.valve} valve on a {actuator.mount}"
            raise ParameterError(f"{origin}: {actuator.kind}.{key} is missing; a {why} needs it")
    if actuator.valve == "3-way" and actuator.area_b is not None:
        raise ParameterError(f"{origin}: {actuator.kind}.area_b is given, but a 3-way valve has chamber A only")
    if (actuator.bumper_stiffness is None) != (actuator.bumper_travel is None):
        raise ParameterError(
            f"{origin}: {actuator.kind}: a bumper needs both bumper_stiffness and bumper_travel; give both or neither"
        )
    if actuator.room <= actuator.stroke:
        raise ParameterError(
            f"{origin}: {actuator.kind}.stroke {actuator.stroke:g} m leaves no oil in a chamber of {actuator.name} of "
            f"{actuator.room:g} m; make the chamber (chamber_a, chamber_b) longer or the stroke shorter"
        )


def check_machine(machine: Structure) -> None:
    """Refuse limits, points and pressures that cannot be together."""
    origin = machine.parameters.origin
    if machine.hydraulics.return_pressure >= machine.hydraulics.supply_pressure:
        raise ParameterError(f"{origin}: hydraulics.return_pressure is not below hydraulics.supply_pressure")
    _check_supply(machine.power_supply, origin)
    for quantity in ("displacement", "velocity", "acceleration"):
        still = [AXES[k] for k in machine.axes if not getattr(machine.limits, quantity)[k]]
        if still:
            raise ParameterError(f"{origin}: limits.{quantity} is 0 in {', '.join(still)}, where the platen can move")
    for floor in machine.floors if machine.motion == "free" else ():
        if floor.point is None:
            raise ParameterError(f"{origin}: {floor.name}.point is missing: where the mass of this floor is, from C")
    for component in machine.components:
        if component.platen_point == component.base_point:
            raise ParameterError(f"{origin}: {component.name}: platen_point and base_point coincide")
        bearing = isinstance(component, Actuator) and component.mount == "bearing"
        if bearing and component.platen_point[:2] != component.base_point[:2]:
            raise ParameterError(
                f"{origin}: {component.name}: a bearing actuator must be vertical in the zero-position"
            )
        if bearing and abs(component.platen_point[2] - machine.platen.bearing_plane[2]) > 1e-9:
            raise ParameterError(f"{origin}: {component.name}.platen_point must lie in platen.bearing_plane")
    n_platen = machine.platen.bearing_plane
    if n_platen[0] != 0.0 or n_platen[1] != 0.0 or n_platen[2] == 0.0:
        raise ParameterError(f"{origin}: platen.bearing_plane must lie straight below C: [0, 0, z]")


def _check_supply(supply: PowerSupply, origin: str) -> None:
    """Refuse gas pressures of accumulators that are out of order."""
    given = (supply.precharge, supply.lowest, supply.charged)
    if None not in given and not supply.precharge <= supply.lowest < supply.charged:  # type: ignore[operator]
        words = ", ".join(f"{value:g}" for value in given)
        raise ParameterError(f"{origin}: power_supply: precharge <= lowest < charged is needed [Pa]; got {words}")
