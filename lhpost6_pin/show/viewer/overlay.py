"""What records shown over each other leave out of one another, and whether they are of one test."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...data.at_rest import at_rest
from .frames import record_title

__all__ = ["Overlay", "compare_overlaid"]

ALIKE = 0.9
"""Correlation of two motions, all axes together, below which they are not of the same test: at another scale, with
another controller or some milliseconds late a motion keeps more, and two earthquakes have far less."""


class Overlay(NamedTuple):
    """Records over the first: the time that all have, what is cut, and which are of another test."""

    shown: tuple[float, float]  # [s]
    cut: tuple[str, ...]  # a sentence for each record that is longer
    different: tuple[str, ...]  # a sentence for each record whose motion is another

    @property
    def sentences(self) -> tuple[str, ...]:
        """All of them."""
        return self.cut + self.different

    def entries(self) -> Mapping[str, Any]:
        """Plain entries."""
        return {"shown": self.shown, "cut": self.cut, "different": self.different}


def compare_overlaid(
    record: xr.Dataset, others: Sequence[xr.Dataset], names: Sequence[str] = (), frame: float = 1.0 / 30.0
) -> Overlay:
    """Compare records that are shown together, by `names` (default: titles); less than a `frame` [s] is not cut.

    Motions are compared by their targets, or else as the platen moved; without either, or where a record is of spools
    replayed in open loop, they are taken as alike.
    """
    every = [record, *others]
    names = names or [record_title(one) for one in every]
    times = [np.asarray(one["time"].values, float) for one in every]
    first, last = max(t[0] for t in times), min(t[-1] for t in times)
    cut = []
    for name, time in zip(names, times, strict=True):
        ends = [(first - time[0], "start"), (time[-1] - last, "end")]
        lost = " and ".join(f"{seconds:.2f} s at its {end}" for seconds, end in ends if seconds > frame)
        if lost:
            cut.append(f"{name} is cut by {lost}: only {first:.2f} to {last:.2f} s, which all records have, are shown")
    different = [
        f"{name} is not the same test as {names[0]}: {why}"
        for name, other in zip(names[1:], others, strict=True)
        if (why := _difference(record, other, first, last))
    ]
    return Overlay((first, last), tuple(cut), tuple(different))


def _difference(record: xr.Dataset, other: xr.Dataset, first: float, last: float) -> str:
    """Why two records are not of the same test; empty if they may be."""
    motions = [str(one.attrs.get("motion", "")) for one in (record, other)]
    if all(motions) and motions[0] != motions[1]:
        return f"its motion is {motions[1]}, not {motions[0]}"
    variable = next((v for v in ("reference_displacement", "platen_displacement") if v in record and v in other), None)
    replayed = any("spool_interpolation" in one.attrs for one in (record, other))
    if variable is None or (replayed and variable != "reference_displacement"):
        return ""  # a model driven by recorded spools drifts from what it replays
    moments = np.linspace(first, last, max(int(np.sum(record["time"].values <= last)), 2))
    a, b = (_varying(one, variable, moments) for one in (record, other))
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    moves = [not at_rest(x, place=True).all() for x in (a, b)]
    if not all(moves):
        return "one of them is at rest" if any(moves) else ""
    alike = float(np.sum(a * b)) / size
    return "" if alike >= ALIKE else f"the correlation of their motions is {alike:.2f}"


def _varying(record: xr.Dataset, variable: str, moments: Array) -> Array:
    """Variable (n, 6) at moments (n,) [s], means removed; what is not finite counts as zero."""
    values = np.nan_to_num(record[variable].transpose("time", ...).values.astype(float))
    found = np.stack([np.interp(moments, record["time"].values, column) for column in values.T], axis=1)
    return np.asarray(found - found.mean(axis=0))
