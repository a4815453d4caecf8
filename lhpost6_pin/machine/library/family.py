"""Families: every effect of the library by its name, as `models/library/*.toml` state it."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from ...core.errors import ParameterError, UnknownNameError
from ...core.files import models_folder
from ..port_names import PLATEN_PORTS
from ..structure import Structure

__all__ = ["Family", "Shape", "families", "find_family"]


@dataclass(frozen=True)
class Shape:
    """A number of an effect: its unit, a typical size, bounds, and where a search for it starts."""

    name: str
    unit: str
    typical: float
    low: float
    high: float
    start: tuple[float, ...]  # values that a search tries; for the amplitude none are needed
    source: str
    scale: float  # how far it may be from where a search starts; the typical size unless stated

    @property
    def amplitude(self) -> bool:
        """Whether the effect vanishes, in proportion, with this number."""
        return not self.start


@dataclass(frozen=True)
class Family:
    """A mechanism by its canonical name, usable by hand and searched for in measured tests."""

    name: str
    title: str
    equation: str
    acts_on: tuple[str, ...]  # kinds of components, "platen", one that turns, its "axis" or "level axis", "supply"
    shapes: tuple[Shape, ...]  # the amplitude first
    shows_in: tuple[str, ...]  # kinds of residuals
    confused_with: tuple[str, ...]
    tell_apart: str
    grouping: str  # "kind": a search takes all of a kind together and each alone; "all": all of them at once
    named: str  # the family that it is a form of; usually itself
    background_without: str  # channel without which it is refitted in every search and never named; empty: none
    sum_with: str  # number of a component of which, without that channel, only the sum with the amplitude is known
    # "named"; "compared": with the machine's own friction, by held-out error, before a search; "background": refitted
    # in every search and never named; "unnamed": never a candidate
    search: str
    confusable: bool  # whether another form of the report's own laws may pass for it
    linear: bool  # whether residuals are in its amplitudes; if not, those of small ones do not show what large ones do
    elastic: bool  # whether it is a spring, alone or with a linear damper: what it leaves is no other form of it
    kind: str  # what families that are hard to tell apart have in common, in words; empty: none
    over: str  # state that it depends on, for figures; empty: time
    law: str  # whose parameters are the family's numbers and the component's; empty where `make` composes it
    parameters: Mapping[str, str | float]  # of the law: another name in the family or the component, or a constant

    def components(self, machine: Structure) -> tuple[str, ...]:
        """Names of all components of a machine that it can act on; also ``platen``, its axes, and ``supply``."""
        found = []
        for actuator in machine.actuators:
            acting = {"actuator", "double-acting" if actuator.area_b is not None else "single-acting"}
            acting |= {"guided"} if machine.motion != "free" else set()
            acting |= {"bearing"} if actuator.mount == "bearing" else {"swivel"}
            if acting & set(self.acts_on):
                found.append(actuator.name)
        if "strut" in self.acts_on:
            found += machine.strut_names
        if "platen" in self.acts_on or ("turning platen" in self.acts_on and machine.motion == "free"):
            found.append("platen")
        if "supply" in self.acts_on:
            found.append("supply")
        axes = PLATEN_PORTS if "axis" in self.acts_on else PLATEN_PORTS[:2] if "level axis" in self.acts_on else ()
        found += [axis for axis in axes if PLATEN_PORTS.index(axis) in machine.axes]
        return tuple(found)

    def groups(self, machine: Structure) -> tuple[tuple[str, ...], ...]:
        """Sets of components that a search tries: all but axes of the platen, all of each kind, and each alone.

        What sits on level axes may swing along both.
        """
        names = self.components(machine)
        kinds: dict[str, list[str]] = {}
        for component in machine.components:
            if component.name in names:
                kinds.setdefault(component.kind, []).append(component.name)
        found = [tuple(name for name in names if not name.startswith("platen."))]
        if "level axis" in self.acts_on:
            found.append(names)
        if self.grouping == "kind":
            found += [tuple(members) for members in kinds.values()]
            found += [(name,) for name in names]
        return tuple(dict.fromkeys(group for group in found if group))


@cache
def families() -> dict[str, Family]:
    """All families by name, file after file of `models/library`; raises ParameterError for what is missing."""
    found: dict[str, Family] = {}
    for path in sorted((models_folder() / "library").glob("*.toml")):
        with path.open("rb") as handle:
            for name, table in tomllib.load(handle).items():
                found[name] = _family(name, table, path.name)
    return found


def find_family(name: str) -> Family:
    """Family by name; raises UnknownNameError that lists all."""
    known = families()
    if name not in known:
        raise UnknownNameError("effect of the library", name, list(known))
    return known[name]


def _family(name: str, table: dict[str, Any], file: str) -> Family:
    words = ("title", "equation", "acts_on", "shows_in", "confused_with", "tell_apart")
    if missing := [w for w in words if w not in table]:
        raise ParameterError(f"{file}: {name} lacks {', '.join(missing)}")
    shapes = []
    for key, entry in table.items():
        if isinstance(entry, dict) and key != "parameters":
            if missing := [w for w in ("unit", "typical", "low", "high", "source") if w not in entry]:
                raise ParameterError(f"{file}: {name}.{key} lacks {', '.join(missing)}")
            typical, low, high = (float(entry[w]) for w in ("typical", "low", "high"))
            scale = float(entry.get("scale", typical))
            start = tuple(float(x) for x in entry.get("start", ()))
            count = entry.get("count", 0)  # of a table
            for label in [f"{key}_{k + 1}" for k in range(count)] or [key]:
                shapes.append(Shape(label, entry["unit"], typical, low, high, start, entry["source"], scale))
    shapes.sort(key=lambda shape: not shape.amplitude)
    return Family(
        name=name,
        title=table["title"],
        equation=table["equation"],
        acts_on=tuple(table["acts_on"]),
        shapes=tuple(shapes),
        shows_in=tuple(table["shows_in"]),
        confused_with=tuple(table["confused_with"]),
        tell_apart=table["tell_apart"],
        grouping=table.get("grouping", "kind"),
        named=table.get("named", name),
        background_without=table.get("background_without", ""),
        sum_with=table.get("sum_with", ""),
        search=table.get("search", "named"),
        confusable=table.get("confusable", False),
        linear=table.get("linear", True),
        elastic=table.get("elastic", False),
        kind=table.get("kind", ""),
        over=table.get("over", ""),
        law=table.get("law", ""),
        parameters=table.get("parameters", {}),
    )
