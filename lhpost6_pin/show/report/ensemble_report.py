"""The report of an ensemble: risk against scale, results with their quantiles, spectra, and what they follow from."""

from pathlib import Path

import numpy as np
import xarray as xr

from ...studies.summary import QUANTILES, EnsembleSummary, ImportanceOf
from ..ensemble_tables import ensemble_verdict, importance_table, risk_table, spread_table
from .ensemble_plots import demand_figure, exceedance_figure, importance_figure, spectra_figures
from .page import Block, Headline, Level, Page, Section, Table, details, number, save_page
from .scales import percent

__all__ = ["write_ensemble_report"]

MOST = 6  # motions, specimens and controllers whose risk is drawn; all are in the table
TRACKED = "acceleration RRMSE, delay removed, worst axis"


def write_ensemble_report(results: xr.Dataset, found: EnsembleSummary, path: Path, command: str = "") -> Path:
    """Write the self-contained HTML report of an ensemble's results to `path` and return the path."""
    failed = sum(found.failures.values())
    level: Level = "attention" if failed or found.stopped or found.troubles or found.loops else "good"
    if any(loop.verdict == "unstable" for loop in found.loops):
        level = "bad"
    scale = int(np.flatnonzero(found.scales == found.shown_scale)[0])
    sections = [
        Section("risk", "Risk of reaching a limit", _risk_blocks(results, found, scale)),
        Section("results", "Results", _result_blocks(found)),
        Section("importance", "Which uncertain numbers matter", _importance_blocks(found)),
    ]
    if "psa" in results:
        sections.append(Section("spectra", "Response spectra", [*spectra_figures(results, scale)]))
    sections += [
        Section("machines", "Uncertain numbers", _machine_blocks(results)),
        Section("troubles", "Failures and troubles", _trouble_blocks(found)),
    ]
    sizes = [_count(results.sizes[name], name) for name in ("motion", "scale", "specimen", "controller", "machine")]
    page = Page(
        kind="Ensemble report",
        title=f"{found.name} on {found.table}",
        purpose=f"{' × '.join(sizes)}: {found.runs} runs.",
        verdict=ensemble_verdict(found),
        level=level,
        headlines=_headlines(found, scale, failed),
        sections=sections,
        command=command,
    )
    return save_page(page, path)


def _count(number: int, name: str) -> str:
    return f"{number} {name}{'s' * (number > 1)}"


def _headlines(found: EnsembleSummary, scale: int, failed: int) -> list[Headline]:
    whole: Level = "bad" if failed else "attention" if found.stopped or found.troubles else "good"
    note = f"of {found.runs}{'; troubles below' * bool(found.troubles)}"
    headlines = [Headline(f"{found.runs - failed - found.stopped}", "whole runs", note, whole)]
    if found.configurations:
        own = max(found.configurations, key=lambda own: np.nan_to_num(own.exceedances[0].share[scale]))
        one, count = own.exceedances[0], len(found.configurations)
        level: Level = "good" if not one.share[scale] > found.level else "attention"
        ends = " to ".join(percent(float(end[scale])) for end in (one.low, one.high))
        of = f", the worst of {count} configurations" if count > 1 else ""
        note = f"{ends}; {own.motion}, specimen {own.specimen}, controller {own.controller}{of}"
        label = f"probability of reaching any limit at scale {found.scales[scale]:g}"
        headlines.append(Headline(percent(float(one.share[scale])), label, note, level))
    at = [s for s in found.shown_spreads if s.result == TRACKED]
    if at:
        worst_of = max(at, key=lambda s: float(s.quantiles[1]))
        low, middle, high = (percent(float(q)) for q in worst_of.quantiles)
        note = f"{low} to {high} (5 to 95 %), {worst_of.motion} at scale {worst_of.scale:g}"
        headlines.append(Headline(middle, "median RRMSE of acceleration, delay removed, worst axis", note))
    return headlines


def _risk_blocks(results: xr.Dataset, found: EnsembleSummary, scale: int) -> list[Block]:
    if not found.configurations:
        return ["Demand over capacity is not among the quantities of this plan (group limits)."]
    figures = []
    if len(found.scales) > 1:
        figures = [
            exceedance_figure(f"risk-{k}", own, found.scales, found.level)
            for k, own in enumerate(found.configurations[:MOST])
        ]
    return [
        *figures,
        demand_figure(results, scale),
        "Demands are of what the table achieved: of a motion beyond it, valves saturate first, and displacement and "
        "velocity stay below their limits. What a target would demand is checked by `run`. "
        "A command is clipped at full spool, so that the demand on a spool is at most one: between two scales it "
        "counts as saturated from the upper one.",
        risk_table(found),
    ]


def _result_blocks(found: EnsembleSummary) -> list[Block]:
    blocks: list[Block] = [spread_table(found.shown_spreads)]
    if len(found.scales) > 1:
        blocks.append(details("All scales", spread_table(found.spreads)))
    return blocks


def _importance_blocks(found: EnsembleSummary) -> list[Block]:
    if not found.importance:
        return [found.no_importance]
    cells: dict[tuple[object, ...], list[ImportanceOf]] = {}
    for one in found.importance:
        cells.setdefault(one[:4], []).append(one)
    words = (
        "First-order Sobol indices by random balance designs (RBD-FAST), at the scale nearest to "
        "one. Chance is what the largest index of a permuted result exceeds in one case of twenty; smaller ones are "
        "not named."
    )
    figures = [importance_figure(f"importance-{k}", own) for k, own in enumerate(list(cells.values())[:4])]
    return [*figures, words, importance_table(found)]


def _machine_blocks(results: xr.Dataset) -> list[Block]:
    if "value" not in results or results.sizes["machine"] == 1:
        return ["The machine is as stated; no number was drawn."]
    rows, quantiles = [], np.quantile(results["value"].values, QUANTILES, axis=0)
    columns = (results["parameter"].values, results["unit"].values, *quantiles)
    for name, unit, low, middle, high in zip(*columns, strict=True):
        rows.append((str(name), str(unit), number(middle, 4), f"{number(low, 4)} to {number(high, 4)}"))
    header = ("Number", "Unit", "Median", "5 to 95 %")
    return ["Drawn from the standard deviations that the machine file states.", Table("Drawn numbers", header, rows)]


def _trouble_blocks(found: EnsembleSummary) -> list[Block]:
    rows = [("failure", why, count) for why, count in found.failures.items()]
    rows += [("trouble", why, count) for why, count in found.troubles.items()]
    if not rows:
        return ["All runs were made, without trouble."]
    return [Table("Failures and troubles", ("Kind", "Of the first such run", "Runs"), rows)]
