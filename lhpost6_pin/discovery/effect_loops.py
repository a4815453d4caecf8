"""What an effect does, over the state that it depends on: the residual of a test without it and with it.

Everything else is as fitted. The effect's own part is the difference of both residuals, in the column where it is
largest against what is left: a force along a leg or an axis, a flow into a chamber, a pressure, a spool's position. Its
band is that of its amplitude's 90 % interval. Forces are drawn as friction is: positive against a positive velocity.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES
from ..data.signals import Band
from ..identification.calibration.operating_point import OperatingPoint
from ..identification.prepare import MeasuredTest
from ..identification.residual_change import Evaluated, change_of
from ..identification.residuals import RESIDUALS, Path, follow, kinds_shown
from ..machine.port_names import place_of
from ..mechanics.plant import make_plant
from ..mechanics.pose import kinematic_jacobian, leg_displacements
from .estimates import Estimate, amplitude_of
from .search_state import AddedEffect, Search

__all__ = ["EffectLoop", "effect_loops", "squares_explained"]


@dataclass(frozen=True)
class EffectLoop:
    """One effect on one test; n samples."""

    family: str
    test: str
    column: str  # such as "resisting force along H2", "flow into H1 A"
    unit: str
    over: str  # the state
    over_unit: str
    state: Array  # (n,) in over_unit
    before: Array  # (n,) residual without the effect
    after: Array  # (n,) with it
    own: Array  # (n,) difference
    spread: tuple[float, float]  # of `own`, as factors: the amplitude's interval
    explained: float  # share of the squares of `before`, `squares_explained`


def effect_loops(
    found: Search, bases: Sequence[OperatingPoint], estimates: Mapping[str, Estimate]
) -> tuple[EffectLoop, ...]:
    """Loops of all effects added that are parts of the machine, on the test where each does most.

    bases are tests at the solution: those held out, if any, then those searched.
    """
    out = []
    for one in found.added if bases else ():
        if not one.candidate.release:
            loops = [loop for base in bases for loop in _loops(found, base, one, estimates)]
            out += [max(loops, key=lambda loop: float(np.mean(loop.own**2)))] if loops else []
    return tuple(out)


def _loops(
    found: Search, base: OperatingPoint, one: AddedEffect, estimates: Mapping[str, Estimate]
) -> Iterator[EffectLoop]:
    """The loop of an effect on every test, in the column where it is largest."""
    plant = make_plant(base.plant.machine.without_effect(one.candidate.name))
    bands = found.problem.comparison.bands
    size = estimates.get(amplitude_of(one))
    spread = (size.low / size.value, size.high / size.value) if size and size.value else (1.0, 1.0)
    shown = kinds_shown(one.candidate.family.shows_in, base.tests[0].channels)
    kinds = tuple(kind for kind in shown if kind in RESIDUALS)
    for test, path, residuals in zip(base.tests, base.paths, base.residuals, strict=True):
        before = Evaluated(base.plant, test, path, residuals)
        change = change_of(before, plant, test, follow(plant, test, (base.plant, path)), kinds)
        columns = []
        for kind in kinds:
            own, rest = getattr(change, kind), getattr(residuals, kind)
            if own.shape[1]:
                columns += _named(base, one, kind, own, rest, path)
        if not columns:
            continue
        column = max(columns, key=lambda c: float(np.mean(c.own**2)) / (float(np.var(c.rest)) or 1.0))
        low_pass = Band(high=bands[-1])
        own, rest = (low_pass.apply(x, test.dt) for x in (column.own, column.rest))
        over, over_unit, state = _state(base, one.candidate.family.over, test, column.place, path)
        whole = own + rest
        yield EffectLoop(
            *(one.candidate.family.named, test.name, column.name, column.unit, over, over_unit, state),
            before=whole, after=rest, own=own, spread=spread,
            explained=squares_explained(whole, rest),
        )  # fmt: skip


def squares_explained(before: Array, after: Array) -> float:
    """Share of the squares of a residual (n,) that an effect explains; zero where there is nothing to explain.

    A constant part of the effect counts, as a null bias has no other. The constant residual that remains with the
    effect, such as a static preload, is no error of its form and is left out of both.
    """
    level = float(after.mean())
    squares = float(np.mean((before - level) ** 2))
    return 1.0 - float(np.var(after)) / squares if squares > 0.0 else 0.0


class _Column(NamedTuple):
    """A column of a residual with an effect's part in it."""

    name: str
    place: str  # actuator, strut, axis, port at a place of the platen, or "supply"
    unit: str
    own: Array  # (n,)
    rest: Array  # (n,) with the effect


def _named(base: OperatingPoint, one: AddedEffect, kind: str, own: Array, rest: Array, path: Path) -> list[_Column]:
    """Columns of a kind of residuals (n, k) with an effect's part `own` and the `rest`."""
    machine = base.plant.machine
    legs = [c for c in one.candidate.components if c in {a.name for a in machine.actuators}]
    if kind == "wrench" and legs and machine.motion == "free":
        rows = [machine.actuator_names.index(name) for name in legs]
        along = kinematic_jacobian(base.plant)[rows]
        lever = float(np.linalg.norm(along[:, 3:]) / np.linalg.norm(along[:, :3]))
        even = np.array([1.0, 1.0, 1.0, *3 * [1.0 / max(lever, 1e-6)]])
        # four legs in one plane have three forces and moments: what cancels among them is no force of theirs
        shares = even[:, None] * np.linalg.pinv(along * even, rcond=0.1)
        return [
            _Column(f"resisting force along {name}", name, "N", -own @ shares[:, i], -rest @ shares[:, i])
            for i, name in enumerate(legs)
        ]
    if kind == "wrench" and (ports := _at_places(base, one)):
        return [
            _Column(
                f"resisting force along {name}", port, "N", *(-np.einsum("nk,nk->n", x, share) for x in (own, rest))
            )
            for port, (name, share) in _shares_of_places(base, ports, path).items()
        ]
    if kind == "wrench":
        units = dict(zip(AXES, ["N"] * 3 + ["N m"] * 3, strict=True))
        free = [(AXES[k], k) for k in base.plant.axes.tolist()]
        return [_Column(f"resisting wrench, {x}", x, units[x], -own[:, k], -rest[:, k]) for x, k in free]
    actuators = machine.actuator_names
    chambers = [(f"{name} A", name) for name in actuators] + [(f"{name} B", name) for name in machine.double_acting]
    known: dict[str, tuple[str, str, list[tuple[str, str]]]] = {
        "flow": ("flow into", "m3/s", chambers),
        "gas": ("pressure of", "1", [(name, name) for name in machine.strut_names]),
        "servo": ("position of the spool of", "1", [(name, name) for name in actuators]),
        "supply": ("pressure of the", "Pa", [("supply", "supply")]),
        "force": ("force of", "N", [(name, name) for name in actuators]),
    }
    words, unit, places = known[kind]
    given = enumerate(places[: own.shape[1]])
    return [_Column(f"{words} {label}", place, unit, own[:, k], rest[:, k]) for k, (label, place) in given]


def _at_places(base: OperatingPoint, one: AddedEffect) -> list[str]:
    """Ports at places of the platen on which an effect acts."""
    (effect,) = (e for e in base.plant.machine.added_effects if e.name == one.candidate.name)
    return [port for port in effect.ports if place_of(port)]


def _shares_of_places(base: OperatingPoint, ports: Sequence[str], path: Path) -> dict[str, tuple[str, Array]]:
    """Direction in words of ports at one place, and shares (n, 6) of the wrench at C that are forces along them.

    By least squares, moments over their lever.
    """
    known = {port: found for port in ports if (found := place_of(port))}
    place = np.array(known[ports[0]][0])
    even = np.array([1.0, 1.0, 1.0, *3 * [1.0 / max(float(np.linalg.norm(place)), 1.0)]])
    force = path.ports.column[:, [base.plant.ports.index(port) for port in ports], :3]
    columns = np.concatenate([force, np.cross(place, force)], axis=2) * even
    inverse = np.linalg.pinv(columns.swapaxes(1, 2)) * even
    words = [f"({', '.join(f'{x:.2g}' for x in along)})" for _, along in known.values()]
    return {port: (name, inverse[:, k]) for k, (port, name) in enumerate(zip(ports, words, strict=True))}


def _state(base: OperatingPoint, over: str, test: MeasuredTest, place: str, path: Path) -> tuple[str, str, Array]:
    """The state `over` which a family is drawn, at a place along a test: what it is, its unit, and values (n,)."""
    machine, measured, motion = base.plant.machine, test.channels, test.motion
    if place_of(place):
        return "displacement of the point", "m", path.ports.s[:, base.plant.ports.index(place)]
    if place in AXES:
        axis = AXES.index(place)
        unit = "m" if axis < 3 else "rad"
        if over == "velocity":
            return f"velocity, {place}", f"{unit}/s", motion.velocity[:, axis]
        return f"displacement, {place}", unit, motion.displacement[:, axis]
    names = [c.name for c in machine.components]
    if place in names:
        if over in ("velocity", "displacement"):
            moved = leg_displacements(base.plant, motion.displacement, motion.velocity)[over == "velocity"]
            return f"{over} of {place}", "m/s" if over == "velocity" else "m", moved[:, names.index(place)]
        if over == "pressure difference" and "chamber_pressure_a" in measured and place in machine.double_acting:
            a = measured["chamber_pressure_a"][:, machine.actuator_names.index(place)]
            b = measured["chamber_pressure_b"][:, machine.double_acting.index(place)]
            return f"pressure difference of {place}", "Pa", a - b
        if over in ("pressure difference", "pressure rate") and "chamber_pressure_a" in measured:
            column = machine.actuator_names.index(place)
            if over == "pressure rate":
                return f"rate of pressure, {place} A", "Pa/s", test.rates["chamber_pressure_a"][:, column]
            return f"pressure, {place} A", "Pa", measured["chamber_pressure_a"][:, column]
        if over == "spool" and "spool_position" in measured:
            return f"spool of {place}", "1", measured["spool_position"][:, machine.actuator_names.index(place)]
    return "time", "s", np.asarray(test.dt * np.arange(test.samples), np.float64)
