"""The report of one test on the table, simulated or measured."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ...data.metrics import QUANTITIES, SpoolUse, Tracking, commanded_axes, sampling, spool_use, track
from ...data.motion_measures import MotionMeasures, motion_measures
from ...motions import Peak
from ...simulation.divergence import recorded_divergence
from ...simulation.limit_use import (
    TOLERANCE,
    LimitUse,
    checked_limits,
    governing_limits,
    limit_uses,
    uses_of_peaks,
)
from ...tuning.interaction import Interaction
from .interaction_section import interaction_blocks
from .page import Block, Headline, Level, Page, Section, Table, bar, details, missing, number, save_page
from .performance_plots import Load, motion_peaks, performance_blocks
from .run_components import force_blocks, pressure_blocks, strut_blocks
from .run_limits import limit_blocks
from .run_motion import drift_blocks, tracking_blocks
from .run_oil import oil_blocks
from .run_spectra import spectrum_blocks
from .run_spools import spool_blocks
from .run_verdict import headlines, verdict_of_run
from .scales import axis_scale, milliseconds, percent, scaled_number, shown_as
from .specimen_section import response_blocks

__all__ = ["RunSummary", "lead_summary", "machine_blocks", "metrics_table", "write_run_report"]

EXPECTED = (
    *(f"platen_{q}" for q in QUANTITIES),
    *(f"reference_{q}" for q in QUANTITIES),
    "actuator_displacement",
    "actuator_force",
    "chamber_pressure_a",
    "chamber_pressure_b",
    "strut_pressure",
    "spool_command",
    "spool_position",
)


@dataclass(frozen=True)
class RunSummary:
    """Summary of a run report, for a terminal or another report."""

    path: Path | None  # None: no page was written
    verdict: str
    level: Level
    headlines: tuple[Headline, ...]
    tracking: tuple[Tracking, ...]
    spools: tuple[SpoolUse, ...]
    limits: tuple[LimitUse, ...]  # of every axis and actuator whose limit is known
    measures: tuple[MotionMeasures, ...]  # of every commanded axis
    missing: tuple[str, ...]  # variables of the record layout that the record lacks

    @property
    def governing(self) -> list[LimitUse]:
        """Largest demand over capacity of each quantity, the governing limit first."""
        return governing_limits(self.limits)


def write_run_report(
    record: xr.Dataset,
    path: Path | str | None,
    *,
    limits: Mapping[str, ArrayLike] | None = None,
    notes: Sequence[str] | None = None,
    command: str | None = None,
    machine_table: Iterable[Sequence[Any]] | None = None,
    interaction: Interaction | None = None,
    demands: Sequence[Peak] = (),
    loads: Sequence[Load] = (),
    fits: str = "",
) -> RunSummary:
    """Write the self-contained HTML report of a test to `path`, if there is one, and return its summary.

    `limits` are capacities by name (`checked_limits`), `notes` warnings of the run, `command` repeats it,
    `machine_table` has rows (name, value, unit, source, assumed), `interaction` is that of table and specimen.
    `demands` are those of the motion on forces and strengths, `loads` the performance of the table, with `fits` in
    words at what scale the motion would be within it. Missing channels are named in their sections.
    Raises `RecordError` without a uniform time of two samples or more, `UnknownNameError` for an unknown
    limit.
    """
    bounds = checked_limits(limits or {})
    sampling(record)
    found = [row for quantity in QUANTITIES for row in track(record, quantity)]
    spools, measures = spool_use(record), motion_measures(record)
    notes = [*(notes or ()), *_gaps(record)]
    uses = [*limit_uses(record, found, spools, bounds), *uses_of_peaks(demands)]
    verdict, level = verdict_of_run(record, found, spools, uses, notes)
    absent = tuple(name for name in EXPECTED if name not in record)
    lists = tuple(headlines(record, found, uses)), tuple(found), tuple(spools), tuple(uses), tuple(measures), absent
    summary = RunSummary(None if path is None else Path(path), verdict, level, *lists)
    if summary.path is None:
        return summary
    if why := recorded_divergence(record.attrs):
        save_page(_page(record, summary, _diverged(record, why, machine_table), notes, command), summary.path)
        return summary
    paper = performance_blocks(loads, motion_peaks(record), fits, source="the target") if loads else []
    motion = [f"platen_{quantity}" for quantity in QUANTITIES]
    response = response_blocks(record)
    sections = [
        Section("tracking", "Target and achieved", tracking_blocks(record, found)),
        Section("limits", "Demand over capacity", limit_blocks(uses)),
        *([Section("specimen", "Specimen response", response)] if response else []),
        *(
            [Section("interaction", "Table and specimen", interaction_blocks(record, interaction))]
            if interaction
            else []
        ),
        Section("spectra", "Intensity and response spectra", spectrum_blocks(measures)),
        Section("forces", "Actuator forces", force_blocks(record, bounds)),
        Section("pressures", "Chamber pressures", pressure_blocks(record, bounds)),
        Section("spools", "Servovalve spools", spool_blocks(record, spools)),
        Section("oil", "Oil supply", oil_blocks(record)),
        Section("struts", "Hold-down struts", strut_blocks(record, bounds)),
        Section("drift", "Drift", drift_blocks(record)),
        *([Section("performance", "Performance curves", paper)] if paper else []),
        Section(
            "metrics",
            "Table of metrics",
            [metrics_table(found, uses), *filter(None, [lead_summary(found)])]
            if found
            else [missing(motion, "Peaks and tracking are not tabulated.")],
        ),
        Section("assumptions", "Assumptions and sources", machine_blocks(list(machine_table or ()))),
        Section("record", "The record", _contents(record)),
    ]
    save_page(_page(record, summary, sections, notes, command), summary.path)
    return summary


def _page(
    record: xr.Dataset, summary: RunSummary, sections: Sequence[Section], notes: Sequence[str], command: str | None
) -> Page:
    return Page(
        kind=f"Run report · {record.attrs.get('kind', 'test')}",
        title=str(record.attrs.get("title") or record.attrs.get("test") or "Test on the shake table"),
        purpose=_purpose(record, summary.tracking),
        verdict=summary.verdict,
        level=summary.level,
        headlines=() if recorded_divergence(record.attrs) else summary.headlines,
        sections=sections,
        notes=notes,
        command=command,
    )


def _diverged(record: xr.Dataset, why: str, rows: Iterable[Sequence[Any]] | None) -> list[Section]:
    """Sections of a run that its scheme made diverge: no number that it computed is among them."""
    words = f"The run {why}. Its numbers are the scheme's, not the table's: none is shown, and all are in the record."
    return [
        Section("tracking", "Why there are no results", [words]),
        Section("assumptions", "Assumptions and sources", machine_blocks(list(rows or ()))),
        Section("record", "The record", _contents(record)),
    ]


def _gaps(record: xr.Dataset) -> list[str]:
    """Channels with non-finite samples, and the time of the first."""
    found = []
    for name, variable in record.data_vars.items():
        if "time" not in variable.dims or variable.dtype.kind != "f":
            continue
        gaps = ~np.isfinite(variable.transpose("time", ...).values).reshape(record.sizes["time"], -1)
        if gaps.any():
            first = float(record["time"].values[gaps.any(axis=1).argmax()])
            found.append(f"{name} has non-finite samples, the first at {first:.4f} s.")
    return found


def _purpose(record: xr.Dataset, found: Sequence[Tracking]) -> str:
    _, step = sampling(record)
    length = f"{number(record.sizes['time'] * step)} s at {1.0 / step:.6g} samples a second"
    if (full := record.attrs.get("thinned_from_hz")) is not None:
        length += f" (thinned from {float(full):.6g} without a filter: peaks and errors are of the samples kept)"
    if "reference_displacement" not in record:
        return f"{length}; the record has no target."
    commanded = commanded_axes(record)
    peaks = [row for row in found if row.quantity == "displacement" and row.axis in commanded]
    words = ", ".join(f"{row.axis} {shown_as(row.peak_target, axis_scale(row.axis, 'displacement'))}" for row in peaks)
    specimen = str(record.attrs.get("specimen", "none"))
    load = "bare table" if specimen == "none" else f"specimen {specimen}"
    count = f"{len(commanded)} of {record.sizes['axis']} axes"
    return f"Track a motion on {count} (peak target displacement {words}), {length}, {load}."


def metrics_table(found: Sequence[Tracking], uses: Sequence[LimitUse]) -> Table:
    """Return peaks, tracking and demand over capacity of every quantity and axis."""
    shares, rows = {(use.quantity, use.name): use.share for use in uses}, []
    for row in found:
        scale, used = axis_scale(row.axis, row.quantity), shares.get((row.quantity, row.axis), np.nan)
        peaks = (scaled_number(peak, scale) for peak in (row.peak_target, row.peak_achieved))
        late = milliseconds(row.delay) if np.isfinite(row.delay) else "–"
        errors = percent(row.rrmse), late, percent(row.rrmse_aligned)
        rows.append((f"{row.axis} {row.quantity}", scale.unit, *peaks, bar(used, TOLERANCE), *errors))
    header = ("Motion", "Unit", "Peak target", "Peak achieved", "Demand / capacity")
    return Table("Peaks and tracking of every axis", (*header, "RRMSE", "Delay", "RRMSE, delay removed"), rows)


def lead_summary(found: Sequence[Tracking]) -> str:
    """What negative delays mean, with the motions that have one; empty if none has."""
    ahead = [f"{row.axis} {row.quantity}" for row in found if row.delay < 0.0]
    if not ahead:
        return ""
    return (
        f"A negative delay: the achieved motion is ahead of its target ({', '.join(ahead)}), by the controller's "
        "feed-forward; in a displacement also by a slow error that the shift reduces, and in measured data where "
        "channels are late."
    )


def machine_blocks(rows: Sequence[Sequence[Any]]) -> list[Block]:
    """Return the numbers of a machine, assumed ones first, of rows (name, value, unit, source, assumed)."""
    if not rows:
        return ["The numbers of the machine are not available."]
    header = ("Quantity", "Value", "Unit", "Source")
    assumed, known = (
        [(name, _value(value), unit, source) for name, value, unit, source, guess in rows if bool(guess) == wanted]
        for wanted in (True, False)
    )
    blocks: list[Block] = [f"{len(assumed)} of the {len(rows)} numbers of this machine are assumed, not published."]
    if assumed:
        blocks.append(Table("Assumed", header, assumed))
    if known:
        blocks.append(details(f"Published or estimated ({len(known)})", Table("Published or estimated", header, known)))
    return blocks


def _contents(record: xr.Dataset) -> list[Block]:
    variables = [
        (name, " × ".join(map(str, v.dims)), v.attrs.get("units", "–"), v.attrs.get("long_name", "–"))
        for name, v in record.data_vars.items()
    ]
    header = ("Variable", "Dimensions", "Unit", "Meaning")
    return [
        Table("Attributes", ("Attribute", "Value"), list(record.attrs.items())),
        details(f"Variables ({len(variables)})", Table("Variables", header, variables)),
    ]


def _value(value: Any) -> str:
    return value if isinstance(value, str) else ", ".join(f"{float(v):.6g}" for v in np.atleast_1d(value))
