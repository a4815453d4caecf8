"""Sections of a run report on the machine's components: actuators, chambers, struts."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .page import Markup, bar, figure, missing, number, table
from .plots import SCALES, SUPPLY, Row, Scale, Trace, palette, time_figure
from .run_metrics import channel, peaks, sampling

__all__ = [
    "TOLERANCE",
    "ForceUse",
    "Limits",
    "draw_over_time",
    "force_blocks",
    "force_use",
    "kinds",
    "pressure_blocks",
    "share_of_limit",
    "shares_of_limit",
    "specimen_blocks",
    "strut_blocks",
]

Limits = Mapping[str, NDArray[np.float64]]

OFF_SCALE = 0.4  # fraction of a limit below which its line is not drawn and the scale fits the data
JOINTS = (("rad", "Angle", "rotation"), ("m", "Position", "displacement"), ("1", "Quaternion", "ratio"))
TOLERANCE = 1e-3  # relative excess of a sampled peak over its limit that still counts as within


class ForceUse(NamedTuple):
    """Peak forces of the actuators in one direction, and demand over capacity."""

    words: str  # "push", "pull", or "force" for both
    peak: NDArray[np.float64]  # (n_act,) magnitude [N]
    share: NDArray[np.float64]  # (n_act,) not-a-number without a limit, infinity for a pull without capacity


def force_blocks(record: xr.Dataset, limits: Limits) -> list[Markup]:
    """Return forces over time and the table of forces and strokes used."""
    names = ("actuator_force", "actuator_displacement")
    absent = [name for name in names if name not in record]
    blocks = [missing(absent, "The recorded part of forces and strokes is shown.")] if absent else []
    if "actuator_force" in record:
        words = "Chamber pressures times piston areas, P_A A₁ − P_B A₂; positive extends the actuator."
        rows = _group_rows(record, "Force", "actuator_force", "actuator", SCALES["force"])
        if "actuator_pull" in limits:
            rows = [_with_force_limits(row, record, limits) for row in rows]
            words += " Dashed lines: push and pull capacity, where the forces approach them."
        blocks.append(draw_over_time(record, "force", "Actuator forces over time", words, rows))
    if len(absent) < len(names):
        blocks.append(_use_of_actuators(record, limits))
    return blocks


def pressure_blocks(record: xr.Dataset, limits: Limits) -> list[Markup]:
    """Return the pressures of both chambers with the supply."""
    absent = [name for name in ("chamber_pressure_a", "chamber_pressure_b") if name not in record]
    blocks = [missing(absent, "These chambers are not drawn.")] if absent else []
    n, supply = record.sizes["time"], None
    if "supply_pressure" in record:
        supply = np.asarray(record["supply_pressure"].values, dtype=np.float64)
    elif "supply_pressure" in limits:
        supply = np.full(n, limits["supply_pressure"][0])
    else:
        blocks.append(missing(["supply_pressure"], "The supply line is not drawn."))
    rows = []
    for side, dim in (("a", "actuator"), ("b", "horizontal")):
        name = f"chamber_pressure_{side}"
        if name in record:
            rows += _group_rows(record, f"Chamber {side.upper()},", name, dim, SCALES["pressure"])
    if rows:
        words = "Pressure in each chamber."
        if supply is not None:
            rows = [_with_supply(row, supply) for row in rows]
            words += " Dashed: the supply; where pressures stay far below it, the legend switches it on."
        blocks.append(draw_over_time(record, "pressure", "Chamber pressures over time", words, rows))
    return blocks


def strut_blocks(record: xr.Dataset, limits: Limits) -> list[Markup]:
    """Return the struts' gas pressure and, where their area is known, their pull."""
    if "strut_pressure" not in record:
        return [missing(["strut_pressure"], "Hold-down struts are not drawn.")]
    rows = _group_rows(record, "Gas pressure", "strut_pressure", "strut", SCALES["pressure"])
    areas = limits.get("strut_area", np.array([]))
    words = "Nitrogen pressure in each hold-down strut."
    if len(areas) == record.sizes["strut"]:
        record = record.assign(strut_pull=record["strut_pressure"] * xr.DataArray(areas, dims="strut"))
        rows += _group_rows(record, "Pull on the platen", "strut_pull", "strut", SCALES["force"])
        words += " The pull is pressure times area."
    else:
        words += " The pull is not drawn: the area of the struts was not given."
    return [draw_over_time(record, "strut", "Hold-down struts over time", words, rows)]


def specimen_blocks(record: xr.Dataset) -> list[Markup]:
    """Return the positions of the free joints of the specimen; the record must have some."""
    joints = record["specimen_joint_position"]
    values = channel(record, "specimen_joint_position", "specimen_joint")
    names = [str(name) for name in joints["specimen_joint"].values]
    units = str(joints.attrs["joint_units"]).split()
    rows = []
    for unit, title, scale in JOINTS:
        own = [k for k, its in enumerate(units) if its == unit]
        traces = [Trace(names[k], values[:, k], line) for k, line in zip(own, palette(len(own)), strict=True)]
        named = title if len(own) > 1 else " ".join([title, *(names[k] for k in own)])
        rows += [Row(named, traces, SCALES[scale])] if own else []
    words = "Positions of the specimen's free joints, as its URDF names them."
    return [draw_over_time(record, "specimen", "Specimen joints over time", words, rows)]


def draw_over_time(record: xr.Dataset, name: str, title: str, words: str, rows: Sequence[Row]) -> Markup:
    """Return a figure over the record's time."""
    start, step = sampling(record)
    return figure(time_figure(f"plot-{name}", title, words, rows, start=start, step=step))


def share_of_limit(peak: float, limits: Limits, name: str, k: int) -> float:
    """Return peak over limit; not-a-number where no limit was given."""
    bounds = limits.get(name, np.array([]))
    return float(peak / bounds[k]) if k < len(bounds) else float("nan")


def shares_of_limit(peak: NDArray[np.float64], limits: Limits, name: str) -> NDArray[np.float64]:
    """Return the peaks (n,) over the limits of as many axes or actuators."""
    return np.array([share_of_limit(value, limits, name, k) for k, value in enumerate(peak)])


def force_use(record: xr.Dataset, limits: Limits) -> list[ForceUse]:
    """Return demand over capacity of actuator forces: push and pull where `actuator_pull` is given, else magnitude."""
    if "actuator_force" not in record:
        return []
    force = channel(record, "actuator_force", "actuator")

    if "actuator_pull" not in limits:
        return [ForceUse("force", peaks(force), shares_of_limit(peaks(force), limits, "actuator_force"))]
    push, pull = peaks(np.maximum(force, 0.0)), peaks(np.maximum(-force, 0.0))
    allowed = np.pad(limits["actuator_pull"], (0, len(pull)), constant_values=np.nan)[: len(pull)]
    known = np.nan_to_num(np.pad(limits.get("actuator_force", np.array([])), (0, len(pull)))[: len(pull)])
    # without pull capacity, the tolerance of the push applies
    none = np.where(pull > TOLERANCE * known, np.inf, np.where(np.isnan(pull), np.nan, 0.0))
    share = np.where(allowed == 0.0, none, pull / np.where(allowed == 0.0, np.nan, allowed))
    return [ForceUse("push", push, shares_of_limit(push, limits, "actuator_force")), ForceUse("pull", pull, share)]


def _with_force_limits(row: Row, record: xr.Dataset, limits: Limits) -> Row:
    """Row with lines of push and pull capacity, if forces approach them and all its actuators share them."""
    labels = [str(label) for label in record["actuator"].values]
    own = [labels.index(trace.name) for trace in row.traces]
    lines = {}
    for sign, use, name in zip(
        (1.0, -1.0), force_use(record, limits), ("actuator_force", "actuator_pull"), strict=True
    ):
        bounds = limits.get(name, np.array([]))
        level = set(bounds[own]) if max(own) < len(bounds) else set()
        if len(level) == 1 and np.nanmax(use.share[own], initial=0.0) >= OFF_SCALE:
            lines[f"{use.words} capacity"] = sign * float(level.pop())
    return replace(row, lines=lines)


def _use_of_actuators(record: xr.Dataset, limits: Limits) -> Markup:
    columns: list[list[object]] = [list(record["actuator"].values)]
    header = ["Actuator"]
    for words, peak, share in force_use(record, limits):
        header.append(f"Peak {words} [{SCALES['force'].unit}]")
        columns.append([number(value * SCALES["force"].factor) for value in peak])
        if "actuator_force" in limits or "actuator_pull" in limits:
            header.append("Demand / capacity")
            columns.append([bar(value, TOLERANCE) for value in share])
    if "actuator_displacement" in record:
        scale, largest = SCALES["displacement"], peaks(channel(record, "actuator_displacement", "actuator"))
        header.append(f"Peak displacement [{scale.unit}]")
        columns.append([number(peak * scale.factor) for peak in largest])
        if "actuator_stroke" in limits:
            header.append("of the stroke")
            columns.append([bar(share, TOLERANCE) for share in shares_of_limit(largest, limits, "actuator_stroke")])
    return table("Forces and strokes: demand over capacity", header, zip(*columns, strict=True))


def _with_supply(row: Row, supply: NDArray[np.float64]) -> Row:
    far = max(np.nanmax(trace.values, initial=0.0) for trace in row.traces) < OFF_SCALE * np.nanmax(supply, initial=0.0)
    return replace(row, traces=[*row.traces, Trace("supply", supply, SUPPLY, folded="supply" if far else "")])


def _group_rows(record: xr.Dataset, title: str, name: str, dim: str, scale: Scale) -> list[Row]:
    """One row per kind of component: H1 to H4 in one, V1 to V6 in the next."""
    values = channel(record, name, dim)
    labels = [str(label) for label in record[dim].values]
    rows = []
    for own in kinds(labels):
        traces = [Trace(labels[k], values[:, k], line) for k, line in zip(own, palette(len(own)), strict=True)]
        first, last = labels[own[0]], labels[own[-1]]
        rows.append(Row(f"{title} {first if len(own) == 1 else f'{first}–{last}'}", traces, scale))
    return rows


def kinds(labels: Sequence[str]) -> list[list[int]]:
    """Return the places of the components of each kind, by their names less the number: H1 to H4, V1 to V6."""
    places = groupby(range(len(labels)), key=lambda k: re.sub(r"\d+$", "", labels[k]))
    return [list(own) for _, own in places]
