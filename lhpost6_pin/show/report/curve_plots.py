"""Figures of the curves of friction and of valves, measured and by the model before and after."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ...core.arrays import Array
from ...identification.calibration.curves import Curves
from ...identification.curves import FrictionCurve, ValveCurve
from ...machine.machine import Machine
from .charts import Curve, Plot, grid_figure
from .page import Block, Figure
from .plots import AFTER, BEFORE, TARGET
from .scales import SCALES, Scale, force_scale

__all__ = ["curve_blocks"]

POINTS = 2000  # of a side in a plot
CLOSE = 0.2  # of the largest value: the close-up at low velocity, and at small openings
CELL, GAP = 230, 0.14  # [CSS px] height of a plot; free at the left of a column, as a share of it
SLOW, OPENING = Scale(1e3, "mm/s"), Scale(100.0, "%")

_Side = tuple[str, Array, Array, Mapping[str, Any]]
"""Name, abscissa (n,) and ordinate (n,) in SI, and style."""


def curve_blocks(curves: Curves, machine: Machine, named: Collection[str] = ()) -> list[Block]:
    """Return the friction curve of every direction, and the valve curves of `named` actuators.

    Without one of those, of the first actuator of each kind.
    """
    first = {a.kind: a.name for a in reversed(machine.actuators)}
    chosen = [name for name in curves.valves if name in named] or [n for n in curves.valves if n in first.values()]
    blocks: list[Block] = []
    if curves.friction:
        blocks.append(_friction_figure(curves))
    if chosen:
        blocks.append(_valve_figure(curves, chosen))
    return blocks or ["Not shown: neither forces, nor pressures with spools or valve commands, were measured."]


def _friction_figure(curves: Curves) -> Figure:
    rows = []
    for axis, by_model in curves.friction.items():
        scale = force_scale(axis)
        fast, slow, path = (_friction_sides(by_model, over) for over in ("velocity", "velocity", "displacement"))
        rows.append(
            (
                _plot(f"Friction, {axis} [{scale.unit}]", "Velocity", fast, SCALES["velocity"], scale),
                _plot(f"At low velocity, {axis} [{scale.unit}]", "Velocity", slow, SLOW, scale, close=True),
                _plot(f"Along the path, {axis} [{scale.unit}]", "Displacement", path, SCALES["displacement"], scale),
            )
        )
    words = (
        f"{_tests(curves)}. Measured: the actuators' force less inertia, weight and all else that the model has beside "
        "friction, positive where it opposes a positive velocity; sensors corrected by the fit. Modelled: friction of "
        "the model at the same samples. Samples at which noise hides the direction of slip are left out."
    )
    return grid_figure("friction-curves", "Friction, measured and modelled", words, rows, cell=CELL, gap=GAP)


def _valve_figure(curves: Curves, chosen: Sequence[str]) -> Figure:
    rows = []
    for name in chosen:
        sides = _valve_sides(curves.valves[name])
        whole = _plot(f"Velocity without load, {name} [m/s]", "Opening", sides, OPENING, SCALES["velocity"])
        null = _plot(f"Near null, {name} [mm/s]", "Opening", sides, OPENING, SLOW, close=True)
        rows.append((whole, null))
    words = (
        f"{_tests(curves)}. Flow of the valve over the piston's area, at a pressure drop of half the supply's across "
        "each path in place of the one at that instant: the velocity of the actuator without load. Measured: the flow "
        "that velocity, rate of pressure and leakage take. Opening: the measured spool, else the command after the "
        "valve's delay, of full command. Its zero is the null, its slope the gain, a flat part overlap."
    )
    return grid_figure("valve-curves", "Valve flow, measured and modelled", words, rows, cell=CELL, gap=GAP)


def _tests(curves: Curves) -> str:
    return f"Test{'s' * (len(curves.tests) != 1)} {', '.join(curves.tests)}"


def _friction_sides(by_model: Mapping[str, FrictionCurve], over: str) -> list[_Side]:
    """Measured by the last model, then every model's own."""
    last = list(by_model.values())[-1]
    own = [(f"model {name}", getattr(curve, over), curve.modelled) for name, curve in by_model.items()]
    return _styled([("measured", getattr(last, over), last.measured), *own])


def _valve_sides(by_model: Mapping[str, ValveCurve]) -> list[_Side]:
    last = list(by_model.values())[-1]
    own = [(f"model {name}", curve.spool, curve.modelled) for name, curve in by_model.items()]
    return _styled([("measured", last.spool, last.measured), *own])


def _styled(sides: Sequence[tuple[str, Array, Array]]) -> list[_Side]:
    """Measured, before and after in their colours; a single model in that of after."""
    styles = (TARGET, AFTER) if len(sides) == 2 else (TARGET, BEFORE, AFTER)
    return [(*side, style) for side, style in zip(sides, styles, strict=True)]


def _plot(title: str, over: str, sides: Sequence[_Side], across: Scale, up: Scale, *, close: bool = False) -> Plot:
    """Samples of every side, evenly thinned; of a close-up those about zero."""
    span = CLOSE * max((float(np.abs(x).max()) for _, x, _, _ in sides if x.size), default=0.0) if close else np.inf
    drawn = []
    for name, x, y, style in sides:
        near = np.flatnonzero(np.abs(x) <= span)
        kept = near[:: max(1, -(-near.size // POINTS))]
        drawn.append(Curve(name, x[kept] * across.factor, y[kept] * up.factor, style, "markers"))
    return Plot(title, f"{over} [{across.unit}]", drawn)
