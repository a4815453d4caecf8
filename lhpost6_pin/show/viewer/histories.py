"""Time histories under the scene: displacement and acceleration of C, force of a leg that is chosen."""

import base64
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...core.names import AXES
from ...machine.machine import Machine
from ..report.plots import CYCLE, envelope
from ..report.scales import SCALES, load_scale
from ..urdf import legs
from .frames import recorded_forces

__all__ = ["History", "packed_histories", "record_histories"]

BUCKETS = 500
"""Stretches that a channel is divided into, each drawn by its extremes: about one per pixel of a plot."""


class History(NamedTuple):
    """One plot: curves over the record's time, all of them or the one that is chosen."""

    title: str  # with its unit
    time: Array  # (n,) [s]
    curves: Mapping[str, Array]  # (n,) by name, in the unit of the title
    one: bool = False  # only the curve that is chosen, by its name


def record_histories(machine: Machine, record: xr.Dataset) -> list[History]:
    """Histories of what a record holds; those with gaps are left out."""
    time, found = np.asarray(record["time"].values, float), []
    axes = [str(axis) for axis in record["axis"].values] if "axis" in record.dims else []
    for quantity in ("displacement", "acceleration"):
        if (name := f"platen_{quantity}") in record:
            scale, values = SCALES[quantity], record[name].transpose("time", "axis").values
            curves = {a: scale.factor * values[:, axes.index(a)] for a in AXES[:3] if a in axes}
            found.append(History(f"{quantity.capitalize()} of C [{scale.unit}]", time, curves))
    if (force := recorded_forces(machine, record)) is not None:
        names = [leg.name for leg in legs(machine)]
        scale = load_scale("force", float(np.nanmax(np.abs(force), initial=0.0)))
        curves = dict(zip(names, scale.factor * force.T, strict=True))
        found.append(History(f"Force [{scale.unit}], push positive", time, curves, one=True))
    whole = [h._replace(curves={n: c for n, c in h.curves.items() if np.isfinite(c).all()}) for h in found]
    return [history for history in whole if history.curves]


def packed_histories(histories: Sequence[History], start: float) -> list[dict[str, Any]]:
    """The same for a page, over the time [s] since the first frame: extremes in single precision, as base64."""
    packed = []
    for history in histories:
        curves = []
        for k, (name, values) in enumerate(history.curves.items()):
            kept = envelope(values, BUCKETS)
            numbers = {"x": _packed(history.time[kept] - start), "y": _packed(values[kept])}
            curves.append({"name": name, "color": CYCLE[0 if history.one else k % len(CYCLE)]} | numbers)
        packed.append({"title": history.title, "one": history.one, "curves": curves})
    return packed


def _packed(values: Array) -> str:
    return base64.b64encode(np.ascontiguousarray(values, "<f4").tobytes()).decode("ascii")
