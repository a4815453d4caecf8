"""Forces over time and against motion, measured and modelled: the rows of the report's Section 6.1."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from ...core.arrays import Array
from .charts import Curve, Plot, grid_figure
from .page import Figure
from .plots import ACHIEVED, TARGET, envelope
from .scales import ROTATIONS, Scale, axis_scale, force_scale

__all__ = ["FORCES", "SIX_ROWS", "force_grid"]


FORCES = {"wrench": "Total actuator force", "struts": "Strut force", "dissipative": "Dissipative force"}
SIX_ROWS = (
    ("wrench", "time"),
    ("wrench", "displacement"),
    ("wrench", "velocity"),
    ("struts", "displacement"),
    ("dissipative", "displacement"),
    ("dissipative", "velocity"),
)
CELL = 180  # [CSS px] height of a plot
GAP = 0.12  # free at the left of a column, as a share of it


def force_grid(
    name: str,
    title: str,
    words: str,
    rows: Sequence[tuple[str, str]],
    axes: Sequence[str],
    sides: Callable[[str, str, str], Iterable[tuple[str, Array, Array]]],
    *,
    points: int,
) -> Figure:
    """Return forces over time or against motion, a row each of `rows`, a column for every axis.

    `sides` gives, for a force, "time" or a quantity of motion, and an axis, measured and modelled side: label, abscissa
    (n,) and force (n,), SI. Of each side at most `points` samples are drawn, evenly spaced; over time its envelope.
    """

    def plot(force: str, over: str, axis: str) -> Plot:
        scale, across = force_scale(axis), Scale(1.0, "s") if over == "time" else axis_scale(axis, over)
        word, curves = FORCES[force].replace("force", "moment") if axis in ROTATIONS else FORCES[force], []
        for (label, x, y), line in zip(sides(force, over, axis), (TARGET, ACHIEVED), strict=False):
            kept = envelope(y, points // 4) if over == "time" else np.arange(0, len(y), -(-len(y) // points))
            curves.append(Curve(label, x[kept] * across.factor, y[kept] * scale.factor, line))
        return Plot(f"{word}, {axis} [{scale.unit}]", f"{over.capitalize()} [{across.unit}]", curves)

    plots = [[plot(force, over, axis) for axis in axes] for force, over in rows]
    return grid_figure(name, title, words, plots, cell=CELL, gap=GAP)
