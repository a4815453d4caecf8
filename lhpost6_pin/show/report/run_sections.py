"""The sections of a run report in reading order, and its tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from .page import Markup, Section, bar, details, missing, number, paragraph, table
from .plots import SCALES
from .run_components import (
    TOLERANCE,
    Limits,
    force_blocks,
    pressure_blocks,
    share_of_limit,
    specimen_blocks,
    strut_blocks,
)
from .run_limits import LimitUse, limit_blocks
from .run_metrics import QUANTITIES, SpoolUse, Tracking
from .run_motion import axis_scale, drift_blocks, percent, shown_as, spectrum_blocks, tracking_blocks
from .run_spools import spool_blocks

__all__ = ["run_sections"]


def run_sections(
    record: xr.Dataset,
    found: Sequence[Tracking],
    spools: Sequence[SpoolUse],
    limits: Limits,
    uses: Sequence[LimitUse],
    machine_table: Sequence[Sequence[Any]],
) -> list[Section]:
    """Return the sections of the report; each names channels missing from the record."""
    moves = "specimen_joint_position" in record
    specimen = [Section("specimen", "Specimen", specimen_blocks(record))] if moves else []
    return [
        Section("tracking", "Target and achieved", tracking_blocks(record, found)),
        Section("spectra", "Response spectra", spectrum_blocks(record)),
        Section("forces", "Actuator forces", force_blocks(record, limits)),
        Section("pressures", "Chamber pressures", pressure_blocks(record, limits)),
        Section("spools", "Servovalve spools", spool_blocks(record, spools)),
        Section("struts", "Hold-down struts", strut_blocks(record, limits)),
        *specimen,
        Section("drift", "Drift", drift_blocks(record)),
        Section("limits", "Demand over capacity", limit_blocks(uses)),
        Section("metrics", "Table of metrics", [_metrics(found, limits)]),
        Section("assumptions", "Assumptions and sources", _assumptions(machine_table)),
        Section("record", "The record", _contents(record)),
    ]


def _metrics(found: Sequence[Tracking], limits: Limits) -> Markup:
    if not found:
        return missing([f"platen_{quantity}" for quantity in QUANTITIES], "Peaks and tracking are not tabulated.")
    rows = []
    for row in found:
        scale = axis_scale(row.axis, row.quantity)
        used = share_of_limit(row.peak_achieved, limits, row.quantity, row.place)
        rows.append(
            (
                f"{row.axis} {row.quantity}",
                scale.unit,
                number(row.peak_target * scale.factor),
                number(row.peak_achieved * scale.factor),
                bar(used, TOLERANCE),
                percent(row.rrmse),
                shown_as(row.delay, SCALES["time"]) if np.isfinite(row.delay) else "–",
                percent(row.rrmse_aligned),
            )
        )
    header = (
        "Motion",
        "Unit",
        "Peak target",
        "Peak achieved",
        "Demand / capacity",
        "RRMSE",
        "Delay",
        "RRMSE, delay removed",
    )
    return table("Peaks and tracking of every axis", header, rows)


def _assumptions(rows: Sequence[Sequence[Any]]) -> list[Markup]:
    if not rows:
        return [paragraph("The numbers of the machine are not available.")]
    header = ("Quantity", "Value", "Unit", "Source")
    assumed = [(name, _shown(value), unit, source) for name, value, unit, source, guess in rows if guess]
    known = [(name, _shown(value), unit, source) for name, value, unit, source, guess in rows if not guess]
    blocks = [paragraph(f"{len(assumed)} of the {len(rows)} numbers of this machine are assumed, not published.")]
    if assumed:
        blocks.append(table("Assumed", header, assumed))
    if known:
        blocks.append(details(f"Published or estimated ({len(known)})", table("Published or estimated", header, known)))
    return blocks


def _contents(record: xr.Dataset) -> list[Markup]:
    variables = [
        (name, " × ".join(map(str, v.dims)), v.attrs.get("units", "–"), v.attrs.get("long_name", "–"))
        for name, v in record.data_vars.items()
    ]
    header = ("Variable", "Dimensions", "Unit", "Meaning")
    return [
        table("Attributes", ("Attribute", "Value"), record.attrs.items()),
        details(f"Variables ({len(variables)})", table("Variables", header, variables)),
    ]


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else ", ".join(f"{float(v):.6g}" for v in np.atleast_1d(value))
