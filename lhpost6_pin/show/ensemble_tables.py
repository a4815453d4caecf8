"""Tables of an ensemble, for a terminal, a report and JSON."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.rounding import rounded_down
from ..studies.exceedance import ANY, Exceedance
from ..studies.summary import Configuration, EnsembleSummary, ImportanceOf, Spread
from .report.page import Table, number
from .report.scales import SCALES, Scale
from .terminal import print_blocks

__all__ = ["ensemble_entries", "ensemble_verdict", "importance_table", "print_ensemble", "risk_table", "spread_table"]

_SCALES = {"N": SCALES["force"], "N m": SCALES["moment"], "1": Scale(100.0, "%")}


def ensemble_verdict(found: EnsembleSummary) -> str:
    """The outcome in a few sentences."""
    words = [f"{found.runs} runs on {found.table}"]
    failed = sum(found.failures.values())
    words.append(f", {failed} of which could not be made" if failed else "")
    words.append(f", {found.stopped} stopped on the way" if found.stopped else "")
    sentences = ["".join(words) + "."]
    many = len(found.configurations) > 1
    if found.configurations:
        worst = [own for own in found.configurations if _rank(own) == min(map(_rank, found.configurations))]
        one, alike = worst[0], len(worst) == len(found.configurations)
        if many and alike:
            sentences.append(f"All {len(worst)} configurations alike:")
        elif many:
            also = f", {len(worst)} of them alike" if len(worst) > 1 else ""
            sentences.append(f"The worst of {len(found.configurations)} configurations{also}:")
        names = "; ".join(f"{own.motion}, specimen {own.specimen}, controller {own.controller}" for own in worst)
        which = f" ({names})" if many and not alike else ""
        sentences.append(f"{_risk_words(one.exceedances[0], found)}{which}.")
    if found.configurations and "strengths" not in found.groups:
        sentences.append("Strengths and the unloading of actuators were not evaluated (group strengths).")
    for loop in found.loops:
        sentences.append(f"With specimen {loop.specimen}, controller {loop.controller}: {loop.summary}.")
    return " ".join(sentences)


def _rank(own: Configuration) -> tuple[float, ...]:
    """Order of configurations, the worst first: the scale of the stated risk, then the shares at the scales."""
    first = own.exceedances[0]
    return (np.nan_to_num(first.risk_scale, nan=np.inf), *(-np.nan_to_num(first.share)).tolist())


def _risk_words(one: Exceedance, found: EnsembleSummary) -> str:
    """The scale of the stated risk, or with one scale the share beyond a limit, in words."""
    if math.isnan(one.risk_scale):
        return f"{one.limit.capitalize()}: demand unknown"
    if len(one.critical) == 1:
        return _of_one_machine(one, found)
    if len(found.scales) == 1:
        share = f"{_percent(one.share[0])} ({_percent(one.low[0])} to {_percent(one.high[0])})"
        return f"At scale {found.scales[0]:g}, {share} of the runs reach {one.limit}"
    risk = f"The risk of reaching {one.limit} is {_percent(found.level)}"
    if one.where == "beyond the largest run":
        n = len(one.critical)
        few = f"{round(float(one.share[-1]) * n)} of {n} machines reach {one.limit} up to scale {found.scales[-1]:g}"
        return f"{few}, the largest run: the risk there is at most {_percent(one.high[-1])}"
    if one.where == "at or below the smallest run":
        return f"{risk} or more at scale {found.scales[0]:g} already, the smallest run"
    if one.risk_after:
        return f"{risk} between the scales {one.risk_after:.3g} and {_end(one.risk_scale)}"
    low = f"{_end(one.risk_low)} to " if one.risk_low else "too few machines for a lower bound; up to "
    return f"{risk} at scale {_end(one.risk_scale)} ({low}{_end(one.risk_high)})"


def _of_one_machine(one: Exceedance, found: EnsembleSummary) -> str:
    """Where the only machine reaches a limit; no risk can be stated of it."""
    scale, least, most = float(one.critical[0]), found.scales[0], found.scales[-1]
    where = f"at scale {_end(scale)}"
    if math.isinf(scale):
        where = f"at no scale up to {most:g}, the largest run"
    elif scale <= least:
        where = f"at scale {least:g} already, the smallest run"
    limit = "a limit" if one.limit == ANY else one.limit
    return f"The machine as stated reaches {limit} {where}: a risk is that of many (--machines)"


def _end(scale: float) -> str:
    """A scale to three digits, never above it but for rounding of the last bit: at that scale the risk is no larger."""
    return "beyond the largest" if math.isinf(scale) else f"{rounded_down(scale * (1.0 + 1e-12), 3):g}"


def risk_table(found: EnsembleSummary) -> Table:
    """Return, for each configuration and limit, the scale of the stated risk and the share beyond it at each scale."""
    rows, varying = [], [k for k in range(3) if len({own[k] for own in found.configurations}) > 1]
    for own in found.configurations:
        for one in own.exceedances:
            below = "≤ " if one.where == "at or below the smallest run" else ""
            below = f"{one.risk_after:.3g} to " if one.risk_after else below
            scale = below + _end(one.risk_scale) if one.where != "unknown" else "–"
            rows.append((one.limit, *(str(own[k]) for k in varying), scale, len(one.critical), *_shares(one)))
    names = ("Motion", "Specimen", "Controller")
    alone = all(len(one.critical) <= 1 for own in found.configurations for one in own.exceedances)
    at = "Scale at which it is reached" if alone else f"Scale of {_percent(found.level)} risk"
    header = ("Limit", *(names[k] for k in varying), at, "Machines")
    return Table("Exceedance of limits", (*header, *(f"Scale {s:g}" for s in found.scales)), rows)


def _shares(one: Exceedance) -> list[str]:
    """Share of machines that reach a limit at each scale, with its interval; of one machine whether it does."""
    if len(one.critical) == 1:
        return ["reached" if share else "–" for share in one.share]
    each = zip(one.share, one.low, one.high, strict=True)
    return [f"{_percent(share)} ({_percent(low)} to {_percent(high)})" for share, low, high in each]


def _percent(share: float) -> str:
    """A probability to a tenth of a per cent."""
    return f"{100.0 * float(share):.3g} %" if math.isfinite(share) else "–"


def spread_table(spreads: Sequence[Spread]) -> Table:
    """Return quantiles of each result by motion, scale, specimen and controller; one scale stands in the title."""
    rows, shown = [], _varying(spreads)
    for one in spreads:
        scale = _SCALES.get(one.units, Scale(1.0, one.units))
        low, middle, high = (_shown(float(q), scale) for q in one.quantiles)
        ends = f"{low} to {high}", _shown(one.most, scale)
        rows.append((one.result, *_where(one, shown), scale.unit, middle, *ends, one.runs))
    header = ("Result", *shown, "Unit", "Median", "5 to 95 %", "Largest", "Runs")
    scales = {one.scale for one in spreads}
    at = f" at scale {scales.pop():g}" if len(scales) == 1 else ""
    return Table(f"Results{at}", header, rows)


def _varying(rows: Sequence[Spread | ImportanceOf]) -> list[str]:
    """Which of motion, scale, specimen and controller differ between rows: the others need no column."""
    names = ("Motion", "Scale", "Specimen", "Controller")
    return [name for k, name in enumerate(names) if len({row[k] for row in rows}) > 1]


def _where(row: Spread | ImportanceOf, shown: Sequence[str]) -> list[str]:
    values = [getattr(row, name.lower()) for name in shown]
    return [f"{value:g}" if isinstance(value, float) else str(value) for value in values]


def _shown(value: float, scale: Scale) -> str:
    return "∞" if math.isinf(value) else number(value * scale.factor)


def importance_table(found: EnsembleSummary) -> Table:
    """Return the three numbers that each result follows from most."""
    rows, shown = [], _varying(found.importance)
    for one in found.importance:
        first = [f"{i.parameter} {i.first_order:.2f}" for i in one.indices[:3] if i.sure]
        words = ", ".join(first) or "none beyond chance"
        rows.append((one.result, *_where(one, shown), words, f"{one.indices[0].chance:.2f}"))
    header = ("Result", *shown, "Share of variance explained alone", "Chance")
    return Table("Which uncertain numbers matter", header, rows)


def print_ensemble(found: EnsembleSummary) -> None:
    """Print the verdict, exceedance, results, what they follow from, and failures."""
    print_blocks(
        spread_table(found.shown_spreads),
        *([risk_table(found)] if found.configurations else []),
        importance_table(found) if found.importance else found.no_importance,
        *(f"{count} runs: {why}" for why, count in (*found.failures.items(), *found.troubles.items())),
        ensemble_verdict(found),
    )


def ensemble_entries(found: EnsembleSummary) -> dict[str, Any]:
    """The summary as plain data; critical scales of single machines are in the file."""
    entries = found._asdict()
    entries["verdict"] = ensemble_verdict(found)
    entries["configurations"] = [
        own._asdict() | {"exceedances": [_without_critical(one) for one in own.exceedances]}
        for own in found.configurations
    ]
    return entries


def _without_critical(one: Exceedance) -> dict[str, Any]:
    return {key: value for key, value in one._asdict().items() if key != "critical"}
