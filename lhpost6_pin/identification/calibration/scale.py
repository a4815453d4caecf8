"""The common scale of forces and flows, where no sensor of a campaign fixes it.

A pressure measures a force only through a piston area, a load cell through its own calibration. With the area, all
masses, forces, flows and leaks s times larger, the residuals of a table without a load cell are s times larger, and
zero where they were: only ratios to one of these numbers can be identified. The best stated one is held, and so is the
gain of a sensor that alone measures what it scales (`sensor_errors`).
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array
from ...data.channels import same_unit
from ...machine.machine import Machine
from ...machine.parameters import Quantity
from ...mechanics.plant import make_plant
from ..prepare import MeasuredTest
from ..residuals import Residuals, evaluate_residuals
from .free_parameters import FreeParameter

__all__ = ["Ratio", "Scale", "find_scale", "measures_alone", "ratios", "scale_summary", "without_held"]

_FORCES = ("N", "N m", "N s/m", "N/m", "kg", "kg m2")
_FLOWS = ("m3/s", "m3/s/Pa")
_AREAS = (".area_a", ".area_b")

_GROWN = 1.25
"""Factor by which numbers are scaled to see whether residuals scale as well; exact for any."""

_ALIKE = 1e-6
"""Relative difference within which residuals scale: rounding, and flow at pressures near zero, where it is smoothed."""


class Scale(NamedTuple):
    """What the common scale is taken from: a number of the machine, held as stated, or a sensor's calibration."""

    name: str  # "drive.area", "platen.mass[x]", "actuator_force"
    value: float  # [unit]; nan of a sensor
    unit: str
    deviation: float  # relative, as stated; nan of a sensor
    members: tuple[str, ...]  # units of the numbers that have the scale
    held: tuple[str, ...] = ()  # paths that are not free

    def has(self, unit: str) -> bool:
        """Whether numbers of a unit have the scale."""
        return any(same_unit(unit, member) for member in self.members)


class Ratio(NamedTuple):
    """A number over that which the scale is taken from."""

    value: float
    unit: str
    low: float
    high: float


def find_scale(machine: Machine, test: MeasuredTest, residuals: Residuals) -> Scale | None:
    """The scale that nothing measured in a test fixes, its `residuals` given; None where something does."""
    if not residuals.wrench.size:
        return None
    if "actuator_force" in test.channels:
        alone = measures_alone(machine, "actuator_force", test.channels)
        return Scale("actuator_force", np.nan, "", np.nan, _FORCES) if alone else None
    after = evaluate_residuals(make_plant(_grown(machine)), test, ("wrench", "flow"))
    pairs = ((residuals.wrench, after.wrench), (residuals.flow, after.flow))
    if not all(_grows(before, later) for before, later in pairs):
        return None
    areas = dict(_areas(machine))
    area, names = next(iter(areas.values())), dict.fromkeys(f"{path.rpartition('.')[0]}.area" for path in areas)
    value, deviation = float(np.max(area.value)), max(map(_deviation, areas.values()))
    known = Scale(" and ".join(names), value, area.unit, deviation, (*_FORCES, *_FLOWS), tuple(areas))
    if len(machine.axes) == len(names) == 1:
        mass, axis = machine.parameters["platen.mass"], machine.axes[0]
        if (own := _deviation(mass, axis)) < known.deviation:
            name = f"platen.mass[{'xyz'[axis]}]"
            return Scale(name, machine.platen.mass[axis], mass.unit, own, (*known.members, area.unit), (name,))
    return known


def measures_alone(machine: Machine, name: str, channels: Collection[str]) -> bool:
    """Whether a sensor of force alone fixes the scale of what it measures, so that its gain cannot be identified.

    Several actuators along one axis share the errors of their sensors; their ratios can be identified.
    """
    return (
        name in ("actuator_force", "pressure_difference")
        and len(machine.actuators) <= len(machine.axes)
        and not {"actuator_force", "chamber_pressure_a", "pressure_difference"} & set(channels) - {name}
        and machine.parameters["platen.mass"].sd is not None  # else a known mass fixes it
    )


def without_held(parameters: Iterable[FreeParameter], scale: Scale | None) -> tuple[FreeParameter, ...]:
    """The parameters that are not held for the scale."""
    held = set(scale.held if scale else ())
    return tuple(p for p in parameters if p.name not in held and not {path for path, _ in p.paths} & held)


def ratios(scale: Scale | None, estimates: Iterable[tuple[str, str, float, float, float]]) -> dict[str, Ratio]:
    """Ratios by name of estimates (name, unit, value, low, high) that have the scale of a number of the machine."""
    if scale is None or not scale.unit:
        return {}
    return {
        name: Ratio(value / scale.value, f"{unit}/{scale.unit}", low / scale.value, high / scale.value)
        for name, unit, value, low, high in estimates
        if scale.has(unit) and name != scale.name
    }


def scale_summary(scale: Scale | None) -> str:
    """What cannot be identified, in a sentence; empty where a sensor fixes the scale."""
    if scale is None:
        return ""
    if not scale.unit:
        return f"Masses and friction are in proportion to the calibration of {scale.name}, the only sensor of force."
    stated = f"{scale.value:.4g} {scale.unit}"
    stated += f" +- {100 * scale.deviation:.2g} %" if scale.deviation else ""
    return (
        f"Only ratios to {scale.name} can be identified, as pressures alone measure the force: it is held as stated "
        f"({stated}), and masses, friction, flow and leakage are wrong by the same factor if it is."
    )


def _areas(machine: Machine) -> Iterator[tuple[str, Quantity]]:
    """Piston areas by path: of each actuator, or of its kind."""
    for actuator, side in product(machine.actuators, _AREAS):
        for path in (f"{actuator.name}{side}", f"{actuator.kind}{side}"):
            if path in machine.parameters:
                yield path, machine.parameters[path]
                break


def _grows(before: Array, after: Array) -> bool:
    """Whether residuals (n, k) are in proportion to the scale."""
    return before.shape == after.shape and bool(
        np.max(np.abs(after - _GROWN * before), initial=0.0) <= _ALIKE * np.max(np.abs(before), initial=0.0)
    )


def _grown(machine: Machine) -> Machine:
    """The machine with all that has the scale larger; struts, gas and geometry as they are."""
    sections = {"platen", *(f.name for f in machine.floors)}
    sections |= {name for a in machine.actuators for name in (a.kind, a.name)}
    quantities = {p: q for p, q in machine.parameters.items() if p.partition(".")[0] in sections}
    for name, entry in machine.parameters.effects.items():
        quantities |= {f"effect.{name}.{key}": q for key, q in entry.values.items()}
    changes = {path: _times(q.value) for path, q in quantities.items() if path.endswith(_AREAS) or _scaled(q.unit)}
    return machine.with_params(changes)


def _scaled(unit: str) -> bool:
    return any(same_unit(unit, other) for other in (*_FORCES, *_FLOWS))


def _times(value: float | Sequence[float]) -> float | list[float]:
    return [_GROWN * x for x in value] if isinstance(value, Sequence) else _GROWN * value


def _deviation(quantity: Quantity, place: int = 0) -> float:
    """Stated relative standard deviation of a quantity; zero where it states none."""
    value = np.atleast_1d(np.asarray(quantity.value, float))
    sd = np.broadcast_to(np.asarray(0.0 if quantity.sd is None else quantity.sd, float), value.shape)
    place = min(place, len(value) - 1)
    return float(sd[place] / value[place])
