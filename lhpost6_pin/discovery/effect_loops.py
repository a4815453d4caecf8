"""What an effect does, over the state that it depends on: the residual of a test without it and with it.

Everything else is as fitted. The effect's own part is the difference of both residuals, in the column where it is
largest against what is left: a force along a leg or an axis, a flow into a chamber, a pressure, a spool's position. Its
band is that of its amplitude's 90 % interval. Forces are drawn as friction is: positive against a positive velocity.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES
from ..data.signals import Band
from ..identification.calibration.problem import OperatingPoint
from ..identification.prepare import MeasuredTest
from ..identification.residual_change import Evaluated, change_of
from ..identification.residuals import RESIDUALS, follow, kinds_shown
from ..mechanics.plant import make_plant
from ..mechanics.pose import kinematic_jacobian, leg_displacements
from .estimates import Estimate, amplitude_of
from .search_state import AddedEffect, Search

__all__ = ["EffectLoop", "effect_loops"]


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
    explained: float  # share of the variance of `before`


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
                columns += _named(base, one, kind, own, rest)
        if not columns:
            continue
        name, unit, own, rest = max(columns, key=lambda c: float(np.mean(c[2] ** 2)) / (float(np.var(c[3])) or 1.0))
        low_pass = Band(high=bands[-1])
        own, rest = (low_pass.apply(x, test.dt) for x in (own, rest))
        over, over_unit, state = _state(base, one, test, name)
        whole = own + rest
        left = float(np.var(rest) / np.var(whole)) if np.var(whole) > 0.0 else 0.0
        yield EffectLoop(
            *(one.candidate.family.named, test.name, name, unit, over, over_unit, state),
            before=whole, after=rest, own=own, spread=spread, explained=1.0 - left,
        )  # fmt: skip


def _named(
    base: OperatingPoint, one: AddedEffect, kind: str, own: Array, rest: Array
) -> list[tuple[str, str, Array, Array]]:
    """Columns of a kind of residuals by name and unit, with the effect's part and the rest (n,)."""
    machine = base.plant.machine
    legs = [c for c in one.candidate.components if c in {a.name for a in machine.actuators}]
    if kind == "wrench" and legs and machine.motion == "free":
        places = [machine.actuator_names.index(name) for name in legs]
        along = kinematic_jacobian(base.plant)[places]
        lever = float(np.linalg.norm(along[:, 3:]) / np.linalg.norm(along[:, :3]))
        even = np.array([1.0, 1.0, 1.0, *3 * [1.0 / max(lever, 1e-6)]])
        # four legs in one plane have three forces and moments: what cancels among them is no force of theirs
        shares = even[:, None] * np.linalg.pinv(along * even, rcond=0.1)
        return [
            (f"resisting force along {name}", "N", -own @ shares[:, i], -rest @ shares[:, i])
            for i, name in enumerate(legs)
        ]
    if kind == "wrench":
        units = ["N"] * 3 + ["N m"] * 3
        return [(f"resisting wrench, {AXES[k]}", units[k], -own[:, k], -rest[:, k]) for k in base.plant.axes.tolist()]
    chambers = [f"{name} A" for name in machine.actuator_names] + [f"{name} B" for name in machine.double_acting]
    labels, words, unit = {
        "flow": (chambers, "flow into", "m3/s"),
        "gas": (list(machine.strut_names), "pressure of", "1"),
        "servo": (list(machine.actuator_names), "position of the spool of", "1"),
        "supply": (["supply"], "pressure of the", "Pa"),
        "force": (list(machine.actuator_names), "force of", "N"),
    }[kind]
    return [(f"{words} {label}", unit, own[:, k], rest[:, k]) for k, label in enumerate(labels) if k < own.shape[1]]


def _state(base: OperatingPoint, one: AddedEffect, test: MeasuredTest, name: str) -> tuple[str, str, Array]:
    """The state that an effect's family depends on, along a test: what it is, its unit, and values (n,)."""
    machine, measured = base.plant.machine, test.channels
    motion, over = test.motion, one.candidate.family.over
    label = name.rpartition(" ")[2] if not name.endswith((" A", " B")) else name.split()[-2]
    if name.startswith("resisting wrench, "):
        axis = AXES.index(name.removeprefix("resisting wrench, "))
        unit = "m" if axis < 3 else "rad"
        if over == "velocity":
            return f"velocity, {AXES[axis]}", f"{unit}/s", motion.velocity[:, axis]
        return f"displacement, {AXES[axis]}", unit, motion.displacement[:, axis]
    names = [c.name for c in machine.components]
    if label in names:
        if over in ("velocity", "displacement"):
            moved = leg_displacements(base.plant, motion.displacement, motion.velocity)[over == "velocity"]
            return f"{over} of {label}", "m/s" if over == "velocity" else "m", moved[:, names.index(label)]
        if over == "pressure difference" and "chamber_pressure_a" in measured and label in machine.double_acting:
            a = measured["chamber_pressure_a"][:, machine.actuator_names.index(label)]
            b = measured["chamber_pressure_b"][:, machine.double_acting.index(label)]
            return f"pressure difference of {label}", "Pa", a - b
        if over in ("pressure difference", "pressure rate") and "chamber_pressure_a" in measured:
            place = machine.actuator_names.index(label)
            if over == "pressure rate":
                return f"rate of pressure, {label} A", "Pa/s", test.rates["chamber_pressure_a"][:, place]
            return f"pressure, {label} A", "Pa", measured["chamber_pressure_a"][:, place]
        if over == "spool" and "spool_position" in measured:
            return f"spool of {label}", "1", measured["spool_position"][:, machine.actuator_names.index(label)]
    return "time", "s", np.asarray(test.dt * np.arange(test.samples), np.float64)
