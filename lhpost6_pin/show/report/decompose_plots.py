"""Figures of a force decomposition: the rows of forces of Section 6.1, forces by effect, components, work."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...core.arrays import Array
from ...core.names import AXES
from ...identification.decompose import Decomposed, Work, WrenchAgreement
from ...identification.decompose.dataset import delivered_by
from .force_grid import SIX_ROWS, force_grid
from .page import Block, Figure, details
from .plots import ACHIEVED, BLACK, TARGET, Row, Trace, palette, palette_traces, time_figure
from .scales import ROTATIONS, SCALES, Scale, force_scale

__all__ = ["component_figure", "effect_blocks", "moved_axes", "six_row_blocks", "work_figure"]


ENERGY, POWER = Scale(1e-3, "kJ"), Scale(1e-3, "kW")
RESIDUAL: dict[str, Any] = {"color": BLACK, "width": 1.0, "dash": "dot"}
"""A style that no effect has."""
POINTS = 2500  # of a curve in the six rows
BUCKETS = 500  # stretches of a channel over time, each drawn by its least and greatest sample
STILL = 0.01  # fraction of an axis's travel below which it counts as at rest
DRY = ("seal_friction", "pad_friction", "viscous")


def moved_axes(found: Decomposed) -> list[str]:
    """Axes that moved by more than a hundredth of their travel."""
    travel = np.array(found.plant.machine.limits.displacement)
    moved = np.abs(found.motion.displacement).max(axis=0) > STILL * travel
    return [AXES[k] for k in found.plant.axes if moved[k]]


def six_row_blocks(found: Decomposed) -> list[Block]:
    """Return the six rows of Section 6.1 for the translations, and for the rotations that moved."""
    moved, forces = moved_axes(found), found.forces
    pairs = {
        "wrench": (forces.measured, forces.required),
        "struts": (forces.struts_measured, forces.struts),
        "dissipative": (forces.dissipative_measured, forces.dissipative),
    }

    def sides(force: str, over: str, axis: str) -> Iterator[tuple[str, Array, Array]]:
        k = AXES.index(axis)
        x = found.time if over == "time" else getattr(found.motion, over)[:, k]
        for label, values in zip(("measured", "modelled"), pairs[force], strict=True):
            if values is not None:
                yield label, x, values[:, k]

    straight = [AXES[k] for k in found.plant.axes if AXES[k] not in ROTATIONS]
    blocks: list[Block] = []
    for name, axes in (("translations", straight), ("rotations", [a for a in moved if a in ROTATIONS])):
        words = "Measured in grey, modelled by inverse dynamics in blue; displacement and velocity as measured."
        if still := [axis for axis in axes if axis not in moved]:
            words += f" Almost at rest: {', '.join(still)}."
        if axes:
            title = f"Forces of the {name}"
            blocks.append(force_grid(f"six-rows-{name}", title, words, SIX_ROWS, axes, sides, points=POINTS))
    return blocks


def effect_blocks(found: Decomposed, agreement: WrenchAgreement) -> list[Block]:
    """Return the wrench of every effect over time; axes almost at rest are collapsed."""
    effects, wrench = delivered_by(found)
    measured = {e.name for e in found.plant.machine.effects if e.spools}
    names = {n: n.replace("_", " ") + ", measured" * (n in measured) for n in effects[:-1]}
    lines = dict(zip(names, palette(len(names)), strict=True))
    moved = moved_axes(found)
    shown: list[Block] = []
    collapsed: dict[str, Figure] = {}
    for k in found.plant.axes:
        axis, scale = AXES[k], force_scale(AXES[k])
        traces = {n: Trace(names[n], wrench[:, i, k], lines[n]) for i, n in enumerate(names)}
        inertia = Trace("inertia", found.forces.ledger.inertia[:, k], TARGET)
        mean, most = float(agreement.residual.offset[k]), 2.0 * float(agreement.noise[k])
        band = {"mean ± 2 sigma (noise)": mean + most, "": mean - most} if most else {}
        large, dry = [t for n, t in traces.items() if n not in DRY], [traces[n] for n in DRY if n in traces]
        rows = [
            Row("Actuators, struts, weight, inertia", [inertia, *large], scale),
            *([Row("Friction and viscous", dry, scale)] if dry else []),
            Row("Residual", [Trace("residual", wrench[:, -1, k], RESIDUAL)], scale, band),
        ]
        title = f"{'Moments' if axis in ROTATIONS else 'Forces'} by effect, {axis}"
        words = "On the platen at the centre of its top (C), platen axes; effects and residual sum to the inertia."
        drawn = _over_time(found, f"effects-{axis}", title, words, rows)
        if axis in moved:
            shown.append(drawn)
        else:
            collapsed[axis] = drawn
    if collapsed:
        shown.append(details(f"Axes almost at rest: {', '.join(collapsed)}", *collapsed.values()))
    return shown


def component_figure(found: Decomposed) -> Figure:
    """Return the measured force along every actuator and strut."""
    kinds = {c.name: c.kind for c in found.plant.machine.components}
    names, force = found.forces.component, found.forces.component_force
    rows = []
    for kind in dict.fromkeys(kinds[name] for name in names):
        own = [i for i, name in enumerate(names) if kinds[name] == kind]
        traces = palette_traces([names[i] for i in own], force[:, own])
        rows.append(Row(kind.replace("_", " ").capitalize(), traces, SCALES["force"]))
    words = "Along each component, positive in compression (pushing its ends apart), in the compared band."
    return _over_time(found, "components", "Forces along actuators and struts", words, rows)


def work_figure(found: Decomposed, work: Work) -> Figure:
    """Return energy and power of every effect over time."""
    lines = [*palette(len(work.effects) - 1), RESIDUAL]
    names = [effect.replace("_", " ") for effect in work.effects]
    energy, power = (
        [Trace(*one) for one in zip(names, values.T, lines, strict=True)] for values in (work.energy, work.power)
    )
    kinetic = Trace("change of kinetic energy", work.kinetic, TARGET)
    total = Trace("work of all effects", work.inertia, ACHIEVED)
    rows = [Row("Energy", energy, ENERGY), Row("Kinetic energy", [kinetic, total], ENERGY), Row("Power", power, POWER)]
    words = "Work on the platen since the first sample, and power; positive into the platen. Actuators as measured."
    return _over_time(found, "work", "Energy and power by effect", words, rows)


def _over_time(found: Decomposed, name: str, title: str, words: str, rows: list[Row]) -> Figure:
    return time_figure(name, title, words, rows, start=float(found.time[0]), step=found.dt, buckets=BUCKETS)
