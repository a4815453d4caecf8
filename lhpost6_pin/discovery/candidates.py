"""Candidates: effects of the library as a search tries them, each a family on some components with some shape."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ..core.arrays import Array
from ..data.channels import LAYOUT
from ..identification.calibration import FreeParameter
from ..identification.calibration.effect_parameters import effect_parameters
from ..identification.calibration.problem import Problem
from ..machine.library import Family, Shape, families, find_family, in_size_of, scaled_families
from ..machine.machine import Machine
from ..machine.parameters import Parameters

__all__ = ["Candidate", "attributed", "first_shape", "list_candidates", "list_releases", "with_background"]
__all__ += ["with_other_form", "with_warm_oil"]


_PARAMETER = {
    "flow": "flow_curve_error",
    "flow_curve": "flow_curve_error",
    "bulk_modulus": "entrained_air",
    "chamber_a": "dead_volume",
    "chamber_b": "dead_volume",
    "leakage": "piston_leakage",
    "viscous": "local_viscous",
    "pad_friction": "bearing_friction",
    "polytropic_index": "gas_heat_transfer",
    "mass": "added_mass",
    "inertia": "inertia_coupling",
}
"""Families that parameters far from their priors are attributed to."""


@dataclass(frozen=True)
class Candidate:
    """A family on a group of components, with its shapes at given values; or an unknown released from its prior."""

    family: Family
    components: tuple[str, ...]
    shape: tuple[tuple[str, float], ...]  # (name, value) of all but amplitudes
    release: str = ""  # the parameter or sensor error that is free of its prior; empty where an effect is added

    @property
    def name(self) -> str:
        """Name of the effect in a machine, or of the released unknown."""
        return self.release or f"{self.family.name}_{'_'.join(self.components)}"

    @property
    def amplitudes(self) -> tuple[Shape, ...]:
        """Numbers in proportion to which the effect vanishes."""
        return tuple(s for s in self.family.shapes if s.amplitude)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest amplitudes (q,)."""
        shapes = self.amplitudes
        return np.array([s.low for s in shapes]), np.array([s.high for s in shapes])

    def spread(self, numbers: Parameters) -> Array:
        """Prior deviations (q,) of amplitudes; `numbers` are those of `models/procedures/discovery.toml`."""
        return numbers.number("fit.spread") * np.array([s.typical for s in self.amplitudes])

    def at(self, components: tuple[str, ...]) -> "Candidate":
        """The same on other components."""
        return replace(self, components=components)

    def of_one_form(self, other: "Candidate") -> bool:
        """Whether only their shapes differ."""
        return replace(self, shape=()) == replace(other, shape=())

    def is_part_of(self, whole: "Candidate") -> bool:
        """Whether it is one of the same family on some of the components of another."""
        return self.family.name == whole.family.name and set(self.components) < set(whole.components)

    def on(self, machine: Machine, amplitudes: tuple[float, ...], *, name: str = "") -> Machine:
        """The machine with this effect, amplitudes (q,) in order; by default with the name of the candidate."""
        values = dict(self.shape) | {s.name: a for s, a in zip(self.amplitudes, amplitudes, strict=True)}
        return machine.with_effect(self.family.name, self.components, name=name or self.name, **values)

    def fit_parameters(self, amplitudes: tuple[float, ...], numbers: Parameters) -> tuple[FreeParameter, ...]:
        """Unknowns of a joint fit; `numbers` are those of `models/procedures/discovery.toml`."""
        return self.parameters(amplitudes, numbers.number("fit.spread"), numbers.number("fit.factor"))

    def parameters(
        self, amplitudes: tuple[float, ...], spread: float, factor: float = 0.0
    ) -> tuple[FreeParameter, ...]:
        """Unknowns of a fit that starts here: amplitudes with a prior of `spread` typical ones.

        Logarithms of shapes have a prior deviation `factor`; where it is zero, shapes are fixed.
        """
        values = dict(self.shape) | {s.name: a for s, a in zip(self.amplitudes, amplitudes, strict=True)}
        return effect_parameters(self.family, self.name, values, spread, factor)


def with_background(
    machine: Machine, spread: float, channels: Collection[str]
) -> tuple[Machine, tuple[FreeParameter, ...]]:
    """The machine with the library's effects of the background, at zero, one of each for a kind; and their parameters.

    spread is the standard deviation of an amplitude in typical ones; channels are those measured. What the machine has
    already is not added again. That an amplitude is zero, its lowest value, is an estimate: there is no such effect.
    """
    parameters: list[FreeParameter] = []
    lacking = {family.name for family in families().values() if family.background_without not in {"", *channels}}
    for one in _of_background(machine, lacking):
        absent = tuple(0.0 for _ in one.amplitudes)
        machine = one.on(machine, absent)
        parameters += (replace(p, natural=True) for p in one.parameters(absent, spread))
    return machine, tuple(parameters)


def with_other_form(machine: Machine, size: float) -> Machine:
    """The machine with every effect of the library's background, `size` of the typical one."""
    for one in _of_background(machine):
        machine = one.on(machine, tuple(size * s.typical for s in one.amplitudes))
    return machine


def with_warm_oil(machine: Machine, share: float) -> Machine:
    """The machine with oil that is softer and thinner by a share."""
    paths = ["hydraulics.bulk_modulus", *dict.fromkeys(f"{a.kind}.viscous" for a in machine.actuators)]
    return machine.with_params({path: (1.0 - share) * machine.parameters.number(path) for path in paths})


def _of_background(machine: Machine, lacking: Collection[str] = ()) -> list["Candidate"]:
    """Effects of the library's background, on all components of each kind that have what they modify.

    `lacking` are further families, for want of a channel. What the machine has already is left out.
    """
    found, there = [], {effect.name for effect in machine.added_effects}
    for family in scaled_families(machine).values():
        names = family.components(machine) if family.search == "background" or family.name in lacking else ()
        for kind in dict.fromkeys(c.kind for c in machine.components):
            members = tuple(c.name for c in machine.components if c.kind == kind and c.name in names)
            one = Candidate(family, members, first_shape(family))
            if one.name in there:
                continue
            typical = tuple(s.typical for s in one.amplitudes)
            if members and any(numbers[0] for numbers in one.on(machine, typical).added_effects[-1].params):
                found.append(one)
    return found


def first_shape(family: Family) -> tuple[tuple[str, float], ...]:
    """First start of a family's shapes."""
    return tuple((s.name, s.start[0]) for s in family.shapes if not s.amplitude)


def list_candidates(machine: Machine, channels: Collection[str] = LAYOUT) -> tuple[tuple[Candidate, ...], ...]:
    """All candidates of the library for a machine: each family at each start of its shapes, on each group together.

    Not on components on which the machine has an effect of that family. Where spools are not among the measured
    `channels`, errors of the command path are calibrated, not named: delay and lag of a valve cannot be
    distinguished from those that its machine states.
    """
    found: list[tuple[Candidate, ...]] = []
    there = {(entry.family, name) for entry in machine.parameters.effects.values() for name in entry.components}
    for family in scaled_families(machine).values():
        unseen = family.shows_in == ("servo",) and "spool_position" not in channels
        if family.search != "named" or unseen:
            continue
        shapes = [s for s in family.shapes if not s.amplitude]
        names = [s.name for s in shapes]
        for values in product(*(s.start for s in shapes)):
            shape = tuple(zip(names, values, strict=True))
            free = (g for g in family.groups(machine) if there.isdisjoint((family.name, name) for name in g))
            found.append(tuple(Candidate(family, group, shape) for group in free))
    return tuple(group for group in found if group)


def attributed(parameter: FreeParameter, machine: Machine) -> tuple[str, tuple[str, ...]]:
    """Family that a parameter far from its prior is attributed to, empty without any; and components that it is of."""
    section, _, name = parameter.name.partition(".")
    where = tuple(c.name for c in machine.components if c.kind == section) or (section,)
    return "" if parameter.of else _PARAMETER.get(name.split(".")[-1].split("[")[0], ""), where


def list_releases(problem: Problem) -> tuple[Candidate, ...]:
    """All parameters and sensor errors that are not released yet and correspond to a family of the library.

    In a refit parameters stay within a few prior deviations, and sensor errors within their ranges: a missing effect
    must not bias them. One that is far outside is identified like an effect, by the gain of its release.
    """
    found = []
    for parameter in problem.parameters:
        family, where = attributed(parameter, problem.machine)
        if family and parameter.name not in problem.free:
            found.append(Candidate(in_size_of(find_family(family), problem.machine), where, (), parameter.name))
    for unknown in problem.unknowns:  # those of the platen's motion were cross-checked before
        if unknown.name in problem.free or (unknown.kind == "delay" and unknown.column >= 0):
            continue
        if unknown.kind == "delay" or LAYOUT[unknown.channel].role == "sensor":
            family = "channel_delay" if unknown.kind == "delay" else LAYOUT[unknown.channel].fault
            found.append(Candidate(find_family(family), (unknown.name,), (), unknown.name))
    return tuple(found)
