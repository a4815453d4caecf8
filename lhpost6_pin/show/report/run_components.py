"""Sections of a run report on the machine's components: actuators, chambers, struts, free joints of the specimen."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...data.channels import column_units
from ...data.metrics import channel, kinds, labels, peaks, sampling
from ...simulation.limit_use import TOLERANCE, Limits, force_use, shares_of_limit
from .page import Block, Figure, Table, bar, missing, number
from .plots import SUPPLY, Row, Trace, palette_traces, time_figure
from .scales import SCALES, load_scale

__all__ = ["draw_over_time", "force_blocks", "pressure_blocks", "specimen_blocks", "strut_blocks"]

OFF_SCALE = 0.4  # fraction of a limit below which its line is not drawn and the scale fits the data
JOINTS = (("rad", "Angle", "rotation"), ("m", "Position", "displacement"), ("1", "Quaternion", "ratio"))


def force_blocks(record: xr.Dataset, limits: Limits) -> list[Block]:
    """Return forces over time and the table of forces and strokes used."""
    names = ("actuator_force", "actuator_displacement")
    absent = [name for name in names if name not in record]
    blocks: list[Block] = [missing(absent, "The recorded part of forces and strokes is shown.")] if absent else []
    if "actuator_force" in record:
        words = "Chamber pressures times piston areas, P_A A₁ − P_B A₂; positive extends the actuator."
        rows = _channel_by_kind(record, "Force", "actuator_force", "actuator", "force")
        if "actuator_pull" in limits:
            rows = [_with_force_limits(row, record, limits) for row in rows]
            words += " Dashed lines: push and pull capacity, where the forces approach them."
        blocks.append(draw_over_time(record, "force", "Actuator forces over time", words, rows))
    if len(absent) < len(names):
        blocks.append(_use_of_actuators(record, limits))
    return blocks


def pressure_blocks(record: xr.Dataset, limits: Limits) -> list[Block]:
    """Return the pressures of both chambers with the supply."""
    absent = [name for name in ("chamber_pressure_a", "chamber_pressure_b") if name not in record]
    blocks: list[Block] = [missing(absent, "These chambers are not drawn.")] if absent else []
    supply = None
    if "supply_pressure" in record:
        supply = channel(record, "supply_pressure")
    elif "supply_pressure" in limits:
        supply = np.full(record.sizes["time"], limits["supply_pressure"][0])
    else:
        blocks.append(missing(["supply_pressure"], "The supply line is not drawn."))
    rows = []
    for side, dim in (("a", "actuator"), ("b", "horizontal")):
        if f"chamber_pressure_{side}" in record:
            name = f"chamber_pressure_{side}"
            rows += _channel_by_kind(record, f"Chamber {side.upper()},", name, dim, "pressure")
    if rows:
        words = "Pressure in each chamber."
        if supply is not None:
            near = OFF_SCALE * np.nanmax(supply, initial=0.0)
            for k, row in enumerate(rows):
                far = max(np.nanmax(trace.values, initial=0.0) for trace in row.traces) < near
                line = Trace("supply", supply, SUPPLY, folded="supply" if far else "")
                rows[k] = replace(row, traces=[*row.traces, line])
            words += " Dashed: the supply; where pressures stay far below it, the legend switches it on."
        blocks.append(draw_over_time(record, "pressure", "Chamber pressures over time", words, rows))
    return blocks


def strut_blocks(record: xr.Dataset, limits: Limits) -> list[Block]:
    """Return the struts' gas pressure and, where their area is known, their pull."""
    if "strut_pressure" not in record:
        return [missing(["strut_pressure"], "Hold-down struts are not drawn.")]
    rows = _channel_by_kind(record, "Gas pressure", "strut_pressure", "strut", "pressure")
    areas = limits.get("strut_area", np.array([]))
    words = "Nitrogen pressure in each hold-down strut."
    if len(areas) == record.sizes["strut"]:
        pull = channel(record, "strut_pressure") * areas
        rows += _rows_by_kind("Pull on the platen", pull, labels(record, "strut"), "force")
        words += " The pull is pressure times area."
    else:
        words += " The pull is not drawn: the area of the struts was not given."
    return [draw_over_time(record, "strut", "Hold-down struts over time", words, rows)]


def specimen_blocks(record: xr.Dataset) -> list[Block]:
    """Return the positions of the free joints of the specimen; the record must have some."""
    values, names = channel(record, "specimen_joint_position"), labels(record, "specimen_joint")
    units = column_units(record["specimen_joint_position"])
    rows = []
    for unit, title, scale in JOINTS:
        own = [k for k, its in enumerate(units) if its == unit]
        named = f"{title} {names[own[0]]}" if len(own) == 1 else title
        if own:
            rows.append(Row(named, palette_traces([names[k] for k in own], values[:, own]), SCALES[scale]))
    words = "Positions of the specimen's free joints, as its URDF names them."
    return [draw_over_time(record, "specimen", "Specimen joints over time", words, rows)]


def draw_over_time(record: xr.Dataset, name: str, title: str, words: str, rows: Sequence[Row]) -> Figure:
    """Return a figure over the record's time."""
    start, step = sampling(record)
    return time_figure(f"plot-{name}", title, words, rows, start=start, step=step)


def _with_force_limits(row: Row, record: xr.Dataset, limits: Limits) -> Row:
    """Row with lines of push and pull capacity, if forces approach them and all its actuators share them."""
    actuators = labels(record, "actuator")
    own = [actuators.index(trace.name) for trace in row.traces]
    lines = {}
    names = (1.0, "actuator_force"), (-1.0, "actuator_pull")
    for (sign, name), use in zip(names, force_use(record, limits), strict=True):
        bounds = limits.get(name, np.array([]))
        level = set(bounds[own]) if max(own) < len(bounds) else set()
        if len(level) == 1 and np.nanmax(use.share[own], initial=0.0) >= OFF_SCALE:
            lines[f"{use.words} capacity"] = sign * float(level.pop())
    return replace(row, lines=lines)


def _use_of_actuators(record: xr.Dataset, limits: Limits) -> Table:
    columns: list[tuple[str, Sequence[object]]] = [("Actuator", labels(record, "actuator"))]
    uses = force_use(record, limits)
    scale = load_scale("force", max((float(np.nanmax(use.peak, initial=0.0)) for use in uses), default=0.0))
    for words, peak, share in uses:
        columns.append((f"Peak {words} [{scale.unit}]", [number(value * scale.factor) for value in peak]))
        if "actuator_force" in limits or "actuator_pull" in limits:
            columns.append(("Demand / capacity", [bar(value, TOLERANCE) for value in share]))
    if "actuator_displacement" in record:
        scale, largest = SCALES["displacement"], peaks(channel(record, "actuator_displacement"))
        columns.append((f"Peak displacement [{scale.unit}]", [number(peak * scale.factor) for peak in largest]))
        if "actuator_stroke" in limits:
            shares = shares_of_limit(largest, limits, "actuator_stroke")
            columns.append(("of the stroke", [bar(share, TOLERANCE) for share in shares]))
    header, cells = zip(*columns, strict=True)
    return Table("Forces and strokes: demand over capacity", header, list(zip(*cells, strict=True)))


def _channel_by_kind(record: xr.Dataset, title: str, name: str, dim: str, scale: str) -> list[Row]:
    return _rows_by_kind(title, channel(record, name), labels(record, dim), scale)


def _rows_by_kind(title: str, values: Array, names: Sequence[str], scale: str) -> list[Row]:
    """One row per kind of component: H1 to H4 in one, V1 to V6 in the next."""
    rows, shown = [], SCALES[scale]
    if scale == "force":
        shown = load_scale(scale, float(np.nanmax(np.abs(values), initial=0.0)))
    for own in kinds(names):
        span = names[own[0]] if len(own) == 1 else f"{names[own[0]]}–{names[own[-1]]}"
        traces = palette_traces([names[k] for k in own], values[:, own])
        rows.append(Row(f"{title} {span}", traces, shown))
    return rows
