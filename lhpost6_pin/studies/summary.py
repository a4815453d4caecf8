"""What an ensemble shows: quantiles of results, exceedance of limits, and the numbers that matter most."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import ParameterError
from ..machine.parameters import Parameters
from .exceedance import Exceedance, exceedances
from .importance import Importance, importances
from .plan import DIMENSIONS
from .quantities import DECIDING

__all__ = ["CONFIGURATION", "QUANTILES", "Configuration", "EnsembleSummary", "ImportanceOf", "LoopOf", "Spread"]
__all__ += ["places_of", "summarise"]

CONFIGURATION = ("motion", "specimen", "controller")
"""Dimensions of a configuration, whose risk is over scales and machines."""

QUANTILES = (0.05, 0.5, 0.95)
"""Shares at which results are stated."""

_WORST = {
    "rrmse_acceleration": "acceleration RRMSE, worst axis",
    "rrmse_aligned": "acceleration RRMSE, delay removed, worst axis",
    "rrmse_displacement": "displacement RRMSE, worst axis",
    "peak_force": "largest actuator force",
    "valve_saturation": "time at full spool, worst valve",
    "base_shear": "base shear of the specimen",
    "base_moment": "overturning moment of the specimen",
}
"""Results stated as one number for each run: the largest of all axes or actuators."""


class Spread(NamedTuple):
    """A result of the machines of one motion, scale, specimen and controller."""

    motion: str
    scale: float
    specimen: str
    controller: str
    result: str  # in words
    units: str
    quantiles: Array  # (3,) at QUANTILES
    least: float
    most: float
    runs: int  # with a finite result


class ImportanceOf(NamedTuple):
    """Which numbers a result follows from, of one motion, scale, specimen and controller."""

    motion: str
    scale: float
    specimen: str
    controller: str
    result: str
    indices: tuple[Importance, ...]  # the largest first


class Configuration(NamedTuple):
    """Exceedance of limits by a motion, with one specimen and controller, over machines."""

    motion: str
    specimen: str
    controller: str
    exceedances: tuple[Exceedance, ...]  # of any limit, then of each


class LoopOf(NamedTuple):
    """A control loop that is unstable, or has thin margins, on the machine as stated."""

    specimen: str
    controller: str
    verdict: str
    summary: str


class EnsembleSummary(NamedTuple):
    """Summary of an ensemble."""

    name: str
    table: str
    runs: int
    failures: Mapping[str, int]  # runs that could not be made, by reason
    troubles: Mapping[str, int]  # runs with trouble, likewise
    groups: tuple[str, ...]  # of quantities that were evaluated
    stopped: int  # runs that stopped on the way
    scales: Array
    spreads: tuple[Spread, ...]
    configurations: tuple[Configuration, ...]
    importance: tuple[ImportanceOf, ...]
    no_importance: str  # why none is estimated; empty if it is
    level: float  # risk whose scale is stated
    loops: tuple[LoopOf, ...] = ()  # those that are not stable

    @property
    def shown_scale(self) -> float:
        """The scale whose results are shown first."""
        return shown_scale(self.scales)

    @property
    def shown_spreads(self) -> tuple[Spread, ...]:
        """Results at that scale."""
        return tuple(one for one in self.spreads if one.scale == self.shown_scale)


def shown_scale(scales: Array) -> float:
    """The scale nearest to that of the motions as they are."""
    return float(scales[np.argmin(np.abs(np.log(scales)))])


def summarise(results: xr.Dataset, numbers: Parameters) -> EnsembleSummary:
    """Summary of results; variables are read one at a time."""
    scales = results["scale"].values.astype(float)
    failures, troubles = (_counted(results[name].values.ravel()) for name in ("failure", "trouble"))
    spreads: list[Spread] = []
    columns: dict[str, Array] = {}
    for result, units, values in _results(results):
        columns[result] = values
        spreads += _spreads(results, result, units, values)
    importance, why = _importance(results, columns, numbers, shown_scale(scales))
    return EnsembleSummary(
        name=str(results.attrs["name"]),
        table=str(results.attrs["table"]),
        runs=int(results["seconds"].size),
        failures=failures,
        troubles=troubles,
        groups=tuple(str(results.attrs["groups"]).split()),
        stopped=int(_stopped(results).sum()),
        scales=scales,
        spreads=tuple(spreads),
        configurations=_configurations(results, numbers),
        importance=importance,
        no_importance=why,
        level=numbers.number("risk.level"),
        loops=tuple(_loops(results)),
    )


def _loops(results: xr.Dataset) -> Iterator[LoopOf]:
    """Loops that are not stable."""
    if "loop" not in results:
        return
    for place, (specimen, controller) in places_of(results, "specimen", "controller"):
        verdict = str(results["loop"].values[place])
        if verdict not in ("", "stable"):
            yield LoopOf(specimen, controller, verdict, str(results["loop_summary"].values[place]))


def _counted(words: Array) -> dict[str, int]:
    """How many texts there are of each kind, by its first, the most frequent kind first; numbers make no difference."""
    first: dict[str, str] = {}
    count: dict[str, int] = {}
    for word in filter(None, map(str, words)):
        kind = first.setdefault(re.sub(r"\b[-+]?\d[\d.e+-]*", "#", word), word)
        count[kind] = count.get(kind, 0) + 1
    return dict(sorted(count.items(), key=lambda item: -item[1]))


def _stopped(results: xr.Dataset) -> Array:
    """Runs (motion, ..., machine) that began but stopped on the way."""
    seconds = results["seconds"].values
    longest = results["duration"].values[:, None, None, None, None]
    return np.asarray(seconds < longest - 1e-9)  # not-a-number of runs that could not be made: false


def _results(results: xr.Dataset) -> Iterator[tuple[str, str, Array]]:
    """Results of one number for each run: in words, unit, values (motion, scale, specimen, controller, machine)."""
    for name, words in _WORST.items():
        if name in results:
            values = results[name].values
            yield words, str(results[name].attrs["units"]), _largest(values) if values.ndim > 5 else values
    if "limit_use" in results:
        values, limits = results["limit_use"].values, list(map(str, results["limit"].values))
        for k, limit in enumerate(limits):
            if not np.isnan(values[..., k]).all():
                yield f"demand over capacity, {limit}", "1", values[..., k]


def _largest(values: Array) -> Array:
    """The largest over the last dimension; not-a-number where there is none."""
    top = np.where(np.isnan(values), -np.inf, values).max(axis=-1)
    return np.where(np.isneginf(top), np.nan, top)


def places_of(results: xr.Dataset, *names: str) -> Iterator[tuple[tuple[int, ...], tuple[Any, ...]]]:
    """Places along some dimensions, every one with every other, with their labels."""
    labels = [results[name].values.tolist() for name in names]
    for place in np.ndindex(*map(len, labels)):
        yield place, tuple(one[k] for one, k in zip(labels, place, strict=True))


def _spreads(results: xr.Dataset, result: str, units: str, values: Array) -> Iterator[Spread]:
    for place, (motion, scale, specimen, controller) in places_of(results, *DIMENSIONS[:-1]):
        own = values[place]
        own = own[~np.isnan(own)]
        if own.size:
            with np.errstate(invalid="ignore"):  # of infinite demands
                quantiles = np.quantile(own, QUANTILES, method="inverted_cdf")
            quantiles[QUANTILES.index(0.5)] = np.median(own)
            where, ends = (motion, scale, specimen, controller), (float(own.min()), float(own.max()))
            yield Spread(*where, result, units, quantiles, *ends, len(own))


def _configurations(results: xr.Dataset, numbers: Parameters) -> tuple[Configuration, ...]:
    if "limit_use" not in results:
        return ()
    use, trouble = results["limit_use"].values, _stopped(results) | (results["trouble"].values.astype(str) != "")
    limits, found = tuple(map(str, results["limit"].values)), []
    scales = results["scale"].values.astype(float)
    level, confidence = numbers.number("risk.level"), numbers.number("risk.confidence")
    for (m, s, c), (motion, specimen, controller) in places_of(results, *CONFIGURATION):
        own = use[m, :, s, c], trouble[m, :, s, c]
        risks = exceedances(*own, limits, scales, level=level, confidence=confidence)
        found.append(Configuration(motion, specimen, controller, risks))
    return tuple(found)


def _importance(
    results: xr.Dataset, columns: Mapping[str, Array], numbers: Parameters, scale: float
) -> tuple[tuple[ImportanceOf, ...], str]:
    """Indices of each result at one scale, for every motion, specimen and controller."""
    if "coordinate" not in results or results.sizes["machine"] == 1:
        return (), "No number was drawn: the machine is as stated."
    names, coordinates = list(map(str, results["parameter"].values)), results["coordinate"].values
    wanted = {result: values for result, values in columns.items() if _matters(result)}
    found = []
    try:
        for place, (motion, at, specimen, controller) in places_of(results, *DIMENSIONS[:-1]):
            if at != scale:
                continue
            for result, values in wanted.items():
                if indices := importances(names, coordinates, values[place], numbers):
                    found.append(ImportanceOf(motion, at, specimen, controller, result, indices))
    except ParameterError as error:
        return (), f"{error}."
    return tuple(found), "" if found else "Too few machines for indices, or no result varies between them."


def _matters(result: str) -> bool:
    """Whether a result is one whose causes are of interest: tracking, loads, and limits that decide."""
    kind, _, limit = result.partition("demand over capacity, ")
    return bool(kind) or limit in DECIDING
