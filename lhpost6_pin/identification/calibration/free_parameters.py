"""Free parameters: the coordinates in which a machine is calibrated, each with its prior.

A free parameter sets one number of the machine file, or several together where only their sum is identifiable (the
heights of a kind's platen points). Its coordinate is the relative change of a positive number, a shift of any other:
zero is the machine as given. The prior is normal with the stated standard deviation.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

import numpy as np

from ...core.arrays import Array
from ...machine.machine import Machine
from ...machine.parameters import Quantity
from ..residuals import RESIDUALS

__all__ = ["FreeParameter", "drawn_coordinates", "machine_parameters", "plan_parameters", "scatter_parameters"]
__all__ += ["parameter_changes", "with_parameters"]


Paths = tuple[tuple[str, int], ...]

_OIL = ("flow", "flow_curve", "leakage", "chamber_a", "chamber_b", "bulk_modulus", "load_cell_share")
_GAS = ("pressure", "polytropic_index")
_GEOMETRY = ("wrench", "flow", "gas")
_MECHANICAL = (
    *("mass", "inertia", "viscous"),
    *("seal_friction", "seal_yield", "seal_shape"),
    *("pad_friction", "pad_yield", "pad_shape"),
)

_LEAST = 0.05
"""Least value of a positive number, relative to the nominal one."""

_WIDE = 0.7
"""Relative standard deviation from which a prior is one of the logarithm."""

_STRAIGHT = 0.01
"""Flow curve of a valve whose gain is straight within half a per cent: its natural end."""

_SHARES = ("seal_shape", "pad_shape", "load_cell_share")
"""Numbers between zero and one."""

_WHOLE = 0.99
"""Largest of these, with room for a difference."""

_ROOM = 1.001
"""Least length of a chamber over the stroke."""

_SCATTER: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("flow", "flow_curve", "leakage"), ("flow",)),
    **dict.fromkeys(("viscous", "seal_friction", "pad_friction"), ("wrench",)),
}
"""Numbers in which identical components differ by wear and adjustment, and the residuals that depend on each."""


@dataclass(frozen=True)
class FreeParameter:
    """One coordinate of the machine; `sd` is its prior standard deviation."""

    name: str  # such as "horizontal.flow", "platen.mass[x]", "horizontal.platen_height"
    paths: Paths  # what it sets: path in the machine file, and component of a vector or -1
    unit: str
    value: float  # nominal, in `unit`
    sd: float  # of the coordinate: in `unit` for a shift, else relative
    form: Literal["shift", "factor", "log"]  # coordinate value - nominal, value / nominal - 1, or ln(value / nominal)
    shows_in: tuple[str, ...]  # residuals that depend on it
    lowest: float = -math.inf  # least coordinate for which a machine can be built
    highest: float = math.inf
    step: float | None = None  # of the coordinate, for derivatives; None: the comparison's share of sd
    of: str = ""  # the kind's number that a component's own is a factor of
    place: int = -1  # actuator on whose residuals alone it acts; -1: on all
    natural: bool = False  # its lowest value is an estimate like any other
    mirrored: bool = False  # points move symmetrically about the axis, those on it stay

    @property
    def alone(self) -> tuple[str, int]:
        """Parameters of one alone[0] act on different rows (alone[1]; -1: all) and are evaluated together."""
        return (self.of.partition(".")[2], self.place) if self.place >= 0 else (self.name, -1)

    def at(self, coordinate: float) -> float:
        """Value in `unit` at a coordinate."""
        if self.form == "shift":
            return self.value + coordinate
        return self.value * (1.0 + coordinate if self.form == "factor" else math.exp(coordinate))

    def slope(self, coordinate: float) -> float:
        """Derivative of the value by the coordinate, there."""
        if self.form == "shift":
            return 1.0
        return self.value * (1.0 if self.form == "factor" else math.exp(coordinate))

    def within(self, low: float, high: float) -> "FreeParameter":
        """The same parameter with its values between low and high."""
        bounds = (-math.inf if self.form == "log" and v <= 0.0 else self.coordinate(v) for v in (low, high))
        lowest, highest = bounds
        return replace(self, lowest=lowest, highest=highest)

    def coordinate(self, value: float) -> float:
        """Coordinate of a value in `unit`."""
        if self.form == "shift":
            return value - self.value
        return value / self.value - 1.0 if self.form == "factor" else math.log(value / self.value)


def machine_parameters(machine: Machine, travel: Mapping[str, float] | None = None) -> tuple[FreeParameter, ...]:
    """Parameters of all numbers of a machine that state an uncertainty: platen, oil, kinds, and heights of each kind.

    Numbers that a component overrides and other geometry are fixed. A chamber is no shorter than the measured `travel`
    [m] of its kind either way; without that, than its stroke.
    """
    sections = {"platen", "hydraulics", *(c.kind for c in machine.components), *(f.name for f in machine.floors)}
    found: list[FreeParameter] = []
    for path, quantity in machine.parameters.items():
        section, _, name = path.partition(".")
        if section in sections and quantity.sd is not None and name != "bearing_plane":
            found += _parameters_of(path, name, quantity)
    found = [*_with_one_area(machine, found), *_points(machine, (2,))]
    if machine.motion != "free":  # a guided platen: masses along its guides, no inertia, no geometry
        masses = {f"platen.mass[{axis}]" for axis in machine.motion}
        found = [p for p in found if p.name in masses or not p.name.startswith("platen.")]
        found = [p for p in found if not p.name.endswith("_height")]
    return tuple(_with_limits(p, machine, travel or {}) for p in found)


def _with_one_area(machine: Machine, found: Sequence[FreeParameter]) -> Iterator[FreeParameter]:
    """The parameters; of a piston of equal areas, both are one."""
    kinds = {a.kind for a in machine.actuators if a.area_b == a.area_a}
    for parameter in found:
        kind, _, name = parameter.name.rpartition(".")
        if kind in kinds and name == "area_a":
            paths = ((f"{kind}.area_a", -1), (f"{kind}.area_b", -1))
            yield replace(parameter, name=f"{kind}.area", paths=paths)
        elif not (kind in kinds and name == "area_b"):
            yield parameter


def _with_limits(parameter: FreeParameter, machine: Machine, travel: Mapping[str, float]) -> FreeParameter:
    """A chamber is no shorter than its piston's travel, a flow curve at best straight, a share below one."""
    kind, _, name = parameter.name.partition(".")
    if name == "flow_curve":
        straight = parameter.coordinate(min(_STRAIGHT, parameter.value))
        return replace(parameter, lowest=max(parameter.lowest, straight), natural=True)
    if name in _SHARES:
        return replace(parameter, highest=parameter.coordinate(_WHOLE))
    if not name.startswith("chamber_"):
        return parameter
    stroke = max(a.stroke for a in machine.actuators if a.kind == kind)
    least = min(0.0, parameter.coordinate(_ROOM * travel.get(kind, stroke)))
    return replace(parameter, lowest=max(parameter.lowest, least))


def _parameters_of(path: str, name: str, quantity: Quantity) -> list[FreeParameter]:
    shows_in: tuple[str, ...] = ("flow",) if name in _OIL else ("wrench", "gas") if name in _GAS else ("wrench",)
    if name not in _OIL + _GAS + _MECHANICAL:
        shows_in = RESIDUALS
    vector = isinstance(quantity.value, tuple)
    values = np.atleast_1d(quantity.value).tolist()
    sds = np.broadcast_to(np.asarray(quantity.sd, float), len(values)).tolist()
    found = []
    for i, (value, sd) in enumerate(zip(values, sds, strict=True)):
        label, at = f"{path}[{'xyz'[i]}]" if vector else path, ((path, i if vector else -1),)
        if sd > 0.0 and value > 0.0 and name != "centre_of_gravity":
            found.append(_relative(label, at, quantity.unit, value, sd / value, shows_in))
        elif sd > 0.0:
            found.append(FreeParameter(label, at, quantity.unit, value, sd, "shift", shows_in))
    return found


def _relative(name: str, paths: Paths, unit: str, value: float, sd: float, shows_in: tuple[str, ...]) -> FreeParameter:
    """A positive number by its relative change, or, where that is uncertain by more than `_WIDE`, by its logarithm."""
    if sd > _WIDE:
        return FreeParameter(name, paths, unit, value, math.log1p(sd), "log", shows_in)
    return FreeParameter(name, paths, unit, value, sd, "factor", shows_in, lowest=_LEAST - 1.0)


def plan_parameters(machine: Machine) -> tuple[FreeParameter, ...]:
    """Parameters of the points of each kind's components in plan; none of a guided platen."""
    return _points(machine, (0, 1)) if machine.motion == "free" else ()


def _points(machine: Machine, coordinates: Sequence[int]) -> tuple[FreeParameter, ...]:
    """Parameters of coordinates (0, 1: in plan; 2: height) of the points of each kind's components, moved together.

    In plan points are mirror images of each other, moved symmetrically, a bearing with its foot. The height of the foot
    is not identifiable, since the leg is measured from its zero length there.
    """
    found = []
    for kind, members, bearing in _kinds(machine):
        ends: tuple[tuple[str, ...], ...] = (("platen_point",), ("base_point",))
        if bearing:
            ends = (("platen_point",),) if 2 in coordinates else (("platen_point", "base_point"),)
        for points, i in product(ends, coordinates):
            moved = [c for c in members if i == 2 or getattr(c, points[0])[i] != 0.0]
            paths = tuple((f"{c.name}.{point}", i) for c in moved for point in points)
            if (i < 2 and len(moved) < 2) or (sd := _mean_sd(machine, paths)) is None:
                continue
            if bearing and i == 2:
                paths += (("platen.bearing_plane", 2),)
            values = [getattr(c, points[0])[i] for c in moved]
            value = float(np.mean(np.abs(values) if i < 2 else values))
            name = f"{kind}.{points[0].split('_')[0]}_{('x', 'y', 'height')[i]}"
            found.append(FreeParameter(name, paths, "m", value, sd, "shift", _GEOMETRY, mirrored=i < 2))
    return tuple(found)


def _kinds(machine: Machine) -> Iterator[tuple[str, list[Any], bool]]:
    """Kinds of components with their members, and whether these are mounted on bearings."""
    for kind in dict.fromkeys(c.kind for c in machine.components):
        members = [c for c in machine.components if c.kind == kind]
        yield kind, members, getattr(members[0], "mount", "swivel") == "bearing"


def _mean_sd(machine: Machine, paths: Sequence[tuple[str, int]]) -> float | None:
    """Mean stated deviation of components of vectors; None where one states none."""
    stated = [machine.parameters[path].sd for path, _ in paths]
    known = [sd[i] if isinstance(sd, tuple) else sd for sd, (_, i) in zip(stated, paths, strict=True) if sd is not None]
    return float(np.mean(known)) if len(known) == len(paths) else None


def scatter_parameters(machine: Machine, share: float, reach: float) -> tuple[FreeParameter, ...]:
    """Parameters of the scatter between identical components: factors, about one, of numbers that a kind shares.

    share is their standard deviation, reach their bound in deviations. Components with numbers of their own, and kinds
    with one component, are excluded.
    """
    found = []
    kinds = [c.kind for c in machine.components]
    for name, shows_in in _SCATTER.items():
        for i, component in enumerate(machine.components):
            kind, own = f"{component.kind}.{name}", f"{component.name}.{name}"
            known = machine.parameters.quantities
            if kind not in known or own in known or not known[kind].value or kinds.count(component.kind) == 1:
                continue
            most, place = share * reach, i if shows_in == ("flow",) else -1
            found.append(
                FreeParameter(own, ((own, -1),), "1", 1.0, share, "factor", shows_in, -most, most, of=kind, place=place)
            )
    return tuple(found)


def drawn_coordinates(parameters: Sequence[FreeParameter], rng: np.random.Generator) -> Array:
    """Coordinates (k,) drawn from the priors: normal within three deviations, no parameter below its lowest."""
    sd, lowest = np.array([k.sd for k in parameters]), np.array([k.lowest for k in parameters])
    drawn = np.full(len(parameters), np.nan)
    while not np.all(drawn > lowest):
        drawn = np.where(drawn > lowest, drawn, sd * np.clip(rng.standard_normal(len(parameters)), -3.0, 3.0))
    return drawn


def with_parameters(machine: Machine, parameters: Sequence[FreeParameter], coordinates: Array) -> Machine:
    """Copy of a machine with its parameters at coordinates (k,); raises ParameterError for an impossible machine."""
    return machine.with_params(parameter_changes(machine, parameters, coordinates))


def parameter_changes(
    machine: Machine, parameters: Sequence[FreeParameter], coordinates: Array
) -> dict[str, float | list[float]]:
    """New values by path for coordinates (k,), as `Machine.with_params` takes them."""
    values: dict[str, float | list[float]] = {}
    pairs = list(zip(parameters, coordinates, strict=True))
    for parameter, x in pairs:
        for path, i in parameter.paths if not parameter.of else ():
            if i < 0:
                values[path] = parameter.at(float(x))
                continue
            now = machine.parameters[path].value
            vector = values.setdefault(path, list(now) if isinstance(now, tuple) else [now])
            assert isinstance(vector, list)
            # points of a kind may have different heights: each is shifted
            side = math.copysign(1.0, vector[i]) * bool(vector[i]) if parameter.mirrored else 1.0
            vector[i] = parameter.at(float(x)) if len(parameter.paths) == 1 else vector[i] + side * float(x)
    for parameter, x in pairs:
        if parameter.of:
            shared = values.get(parameter.of, machine.parameters[parameter.of].value)
            assert isinstance(shared, float)
            values[parameter.paths[0][0]] = shared * parameter.at(float(x))
    return values | _cut_strokes(machine, values)


def _cut_strokes(machine: Machine, values: Mapping[str, float | list[float]]) -> dict[str, float]:
    """Strokes longer than a chamber among new values, reduced to its length.

    The length of a chamber is identifiable, a stroke is not, and the shipped stroke is assumed. A chamber bounded by it
    would bias the oil (true 0.70 m, stated 0.75 m: 7 % stiffer). It is thus bounded by its piston's measured travel
    (`machine_parameters`), and a stroke that is inconsistent with the identified chamber is reduced.
    """
    cut: dict[str, float] = {}
    for path, length in values.items():
        kind, _, name = path.partition(".")
        stroke = f"{kind}.stroke"
        if not name.startswith("chamber_") or stroke not in machine.parameters or not isinstance(length, float):
            continue
        stated = values.get(stroke, machine.parameters.number(stroke))
        assert isinstance(stated, float)
        if length <= cut.get(stroke, stated):
            cut[stroke] = length / _ROOM
    return cut
