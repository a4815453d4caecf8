"""Figures of a force decomposition: the rows of forces of Section 6.1, forces by effect, components, work."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.names import AXES
from ...identification.decompose import Decomposed, Work, WrenchAgreement
from ...identification.decompose.work import delivered_by
from .charts import Curve, Plot, grid_figure
from .page import Figure, Markup, details, figure
from .plots import ACHIEVED, SCALES, TARGET, VERMILLION, Row, Scale, Trace, envelope, palette, time_figure
from .run_motion import axis_scale

__all__ = ["component_blocks", "effect_blocks", "force_scale", "moved_axes", "six_row_blocks", "work_blocks"]

Array = NDArray[np.float64]

FORCE, MOMENT = Scale(1e-3, "kN"), Scale(1e-3, "kN m")
ENERGY, POWER = Scale(1e-3, "kJ"), Scale(1e-3, "kW")
RESIDUAL: dict[str, Any] = {"color": VERMILLION, "width": 1.0}
POINTS = 2500  # of a loop that is drawn: 60 a second of a record of 40 s
BUCKETS = 500  # stretches of a channel over time, each drawn by its least and greatest sample
STILL = 0.01  # fraction of an axis's travel below which it counts as at rest
CELL = 190  # [CSS px] height of a plot
ROWS = (
    ("Total actuator force", "time"),
    ("Total actuator force", "displacement"),
    ("Total actuator force", "velocity"),
    ("Strut force", "displacement"),
    ("Dissipative force", "displacement"),
    ("Dissipative force", "velocity"),
)
DRY = ("seal_friction", "pad_friction", "viscous")


def force_scale(axis: str) -> Scale:
    """Scale of forces, or moments, of an axis."""
    return FORCE if axis in "xyz" else MOMENT


def moved_axes(found: Decomposed) -> list[str]:
    """Axes that moved by more than a hundredth of their travel."""
    travel = np.array(found.plant.machine.limits.displacement)
    moved = np.abs(found.motion.displacement).max(axis=0) > STILL * travel
    return [AXES[k] for k in found.plant.axes if moved[k]]


def six_row_blocks(found: Decomposed) -> list[Markup]:
    """Return the six rows of Section 6.1 for the translations, and for the rotations that moved."""
    moved = moved_axes(found)
    free = [AXES[k] for k in found.plant.axes]
    groups = (("translations", [a for a in free if a in "xyz"]), ("rotations", [a for a in moved if a not in "xyz"]))
    blocks = []
    for name, axes in groups:
        if not axes:
            continue
        still = [axis for axis in axes if axis not in moved]
        words = "Measured in grey, modelled by inverse dynamics in blue; displacement and velocity as measured."
        if still:
            words += f" Almost at rest: {', '.join(still)}."
        blocks.append(figure(_six_rows(f"six-rows-{name}", f"Forces of the {name}", words, found, axes)))
    return blocks


def _six_rows(name: str, title: str, words: str, found: Decomposed, axes: Sequence[str]) -> Figure:
    forces = found.forces
    struts = forces.struts_measured
    pairs = {
        "Total actuator force": (forces.measured, forces.required),
        "Strut force": (struts, forces.struts),
        "Dissipative force": (forces.dissipative_measured, forces.dissipative),
    }

    def plot(what: str, against: str, axis: str) -> Plot:
        k, scale = AXES.index(axis), force_scale(axis)
        over, word = _over(found, against, k), what if axis in "xyz" else what.replace("force", "moment")
        curves = []
        for label, values, line in zip(("measured", "modelled"), pairs[what], (TARGET, ACHIEVED), strict=True):
            if values is not None:
                kept = _kept(values[:, k], against)
                curves.append(Curve(label, over[kept], values[kept, k] * scale.factor, line))
        return Plot(f"{word}, {axis} [{scale.unit}]", _against(axis, against), curves)

    rows = [[plot(what, against, axis) for axis in axes] for what, against in ROWS]
    return grid_figure(name, title, words, rows, cell=CELL, gap=0.14)


def _kept(values: Array, against: str) -> NDArray[np.int64]:
    """Samples to draw: envelope over time, evenly spaced along a loop."""
    if against == "time":
        return envelope(values, 2 * BUCKETS)
    return np.arange(0, len(values), max(1, -(-len(values) // POINTS)))


def _over(found: Decomposed, against: str, k: int) -> Array:
    if against == "time":
        return found.time
    return np.asarray(getattr(found.motion, against)[:, k] * axis_scale(AXES[k], against).factor)


def _against(axis: str, against: str) -> str:
    return "Time [s]" if against == "time" else f"{against.capitalize()}, {axis} [{axis_scale(axis, against).unit}]"


def effect_blocks(found: Decomposed, agreement: WrenchAgreement) -> list[Markup]:
    """Return the wrench of every effect over time; axes almost at rest are collapsed."""
    effects, wrench = delivered_by(found)
    actuators = {e.name for e in found.plant.machine.effects if e.spools}
    lines = dict(zip(effects[:-1], palette(len(effects) - 1), strict=True))
    moved = moved_axes(found)
    shown: list[Markup] = []
    folded: list[Markup] = []
    for k in found.plant.axes:
        axis = AXES[k]
        traces = {n: Trace(_label(n, n in actuators), wrench[:, i, k], lines[n]) for i, n in enumerate(effects[:-1])}
        large = [Trace("inertia", found.forces.ledger.inertia[:, k], TARGET)]
        large += [trace for name, trace in traces.items() if name not in DRY]
        scale = force_scale(axis)
        mean, most = float(agreement.residual.offset[k]), 2.0 * float(agreement.noise[k])
        band = {"mean ± 2 sigma (noise)": mean + most, "": mean - most} if most else {}
        rows = [
            Row("Actuators, struts, weight, inertia", large, scale),
            Row("Friction and viscous", [traces[n] for n in DRY if n in traces], scale),
            Row("Residual", [Trace("residual", wrench[:, -1, k], RESIDUAL)], scale, band),
        ]
        word = "Forces" if axis in "xyz" else "Moments"
        drawn = time_figure(
            f"effects-{axis}",
            f"{word} by effect, {axis}",
            "On the platen at the centre of its top (C), platen axes; effects and residual sum to the inertia.",
            [row for row in rows if row.traces],
            start=float(found.time[0]),
            step=found.dt,
            buckets=BUCKETS,
        )
        (shown if axis in moved else folded).append(figure(drawn))
    if folded:
        names = ", ".join(AXES[k] for k in found.plant.axes if AXES[k] not in moved)
        shown.append(details(f"Axes almost at rest: {names}", *folded))
    return shown


def _label(effect: str, measured: bool) -> str:
    return effect.replace("_", " ") + (", measured" if measured else "")


def component_blocks(found: Decomposed) -> list[Markup]:
    """Return the measured force along every actuator and strut."""
    machine = found.plant.machine
    kinds = {c.name: c.kind for c in machine.components}
    rows = []
    for kind in dict.fromkeys(kinds[name] for name in found.forces.component):
        members = [i for i, name in enumerate(found.forces.component) if kinds[name] == kind]
        lines = palette(len(members))
        traces = [
            Trace(found.forces.component[i], found.forces.component_force[:, i], line)
            for i, line in zip(members, lines, strict=True)
        ]
        rows.append(Row(kind.replace("_", " ").capitalize(), traces, SCALES["force"]))
    words = "Along each component, positive in compression (pushing its ends apart), in the compared band."
    drawn = time_figure(
        "components",
        "Forces along actuators and struts",
        words,
        rows,
        start=float(found.time[0]),
        step=found.dt,
        buckets=BUCKETS,
    )
    return [figure(drawn)]


def work_blocks(work: Work, dt: float) -> list[Markup]:
    """Return energy and power of every effect over time."""
    lines = [*palette(len(work.effects) - 1), RESIDUAL]
    names = [effect.replace("_", " ") for effect in work.effects]
    energy = [Trace(n, x, line) for n, x, line in zip(names, work.energy.T, lines, strict=True)]
    power = [Trace(n, x, line) for n, x, line in zip(names, work.power.T, lines, strict=True)]
    kinetic = [
        Trace("change of kinetic energy", work.kinetic, TARGET),
        Trace("work of all effects", work.inertia, ACHIEVED),
    ]
    rows = [Row("Energy", energy, ENERGY), Row("Kinetic energy", kinetic, ENERGY), Row("Power", power, POWER)]
    words = "Work on the platen since the first sample, and power; positive into the platen. Actuators as measured."
    start = float(work.time[0])
    return [
        figure(time_figure("work", "Energy and power by effect", words, rows, start=start, step=dt, buckets=BUCKETS))
    ]
