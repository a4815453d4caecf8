"""The report of a search for missing effects: where the gap is, its name, what else was considered, how it shrinks."""

import math
from pathlib import Path

import numpy as np

from ...discovery import Discovery, save_verdict
from ...discovery.verdict_file import advice
from ...discovery.verdict_summary import said, title_of, where
from ...machine.library import find_family
from ...machine.machine_toml import save_machine_toml
from .control_blocks import load_of
from .discover_plots import gain_figure, gap_figure, map_blocks, residual_function_figure
from .page import (
    Headline,
    Level,
    Markup,
    Page,
    Section,
    bullet_list,
    details,
    figure,
    number,
    paragraph,
    save_page,
    table,
    versions,
)

__all__ = ["save_discovery", "write_discover_report"]

_LEVELS: dict[str, Level] = {"none": "good", "parameters_only": "good", "named": "good", "unexplained": "bad"}


def save_discovery(found: Discovery, folder: Path, title: str, command: str = "") -> list[Path]:
    """Leave verdict.json, model.toml (with `title` on top) and report.html in a folder, and say where."""
    return [
        save_verdict(found, folder / "verdict.json"),
        save_machine_toml(found.fitted, folder / "model.toml", title),
        write_discover_report(found, folder / "report.html", command=command),
    ]


def write_discover_report(found: Discovery, path: Path | str, command: str = "") -> Path:
    """Write the self-contained HTML report of a search to `path` and return the path."""
    verdict = found.verdict
    tests = f"{len(found.used)} test{'s' * (len(found.used) != 1)}: {', '.join(found.used)}"
    held = f"; {', '.join(found.held_out)} held out" if found.held_out else ""
    page = Page(
        kind="Discovery",
        title=f"What {found.machine.name} lacks to explain {found.campaign}",
        asked=f"Find effects that the model of {load_of(found.machine)} lacks, from {tests}{held}.",
        verdict=f"{verdict.word}: {said(found)}",
        level=_LEVELS.get(verdict.word, "attention"),
        headlines=_headlines(found),
        sections=[
            Section("effects", "What was found", _effect_blocks(found)),
            Section("proof", "The gap, before and after", _proof_blocks(found)),
            Section("where", "Where the gap is", map_blocks(found)),
            Section("considered", "What was considered, and why not", _considered(found)),
            Section("parameters", "Parameters and sensors", _parameter_blocks(found)),
            Section("assumptions", "Assumptions and numbers used", _assumptions(found)),
        ],
        command=command or None,
        versions=versions(),
    )
    return save_page(page, path)


def _chance(p: float) -> str:
    return "less than 1e-300" if p < 1e-300 else f"{p:.1g}"


def _headlines(found: Discovery) -> list[Headline]:
    verdict = found.verdict
    named = ", ".join(title_of(one.family) for one in verdict.effects) or "none"
    shown = [Headline(verdict.word.replace("_", " "), "Verdict"), Headline(named, "Effects")]
    if found.proof and found.proof.gaps:
        widest = max(found.proof.gaps, key=lambda gap: gap.refitted)
        shown.append(
            Headline(
                f"{number(widest.refitted)} → {number(widest.after)}",
                f"Widest gap: {widest.phase}, {widest.test}",
                "over sensor noise; 1 is noise alone",
            )
        )
    return shown


def _effect_blocks(found: Discovery) -> list[Markup]:
    verdict = found.verdict
    if not verdict.effects and verdict.word != "unexplained":
        return [paragraph("No effect is missing.")]
    blocks: list[Markup] = []
    for one in verdict.effects:
        family = find_family(one.form or one.family)
        rows = [
            (name, f"{value.value:.4g}", f"{value.low:.4g} to {value.high:.4g}", value.unit)
            for name, value in one.parameters.items()
        ]
        header = ("Number", "Value", "90 % interval", "Unit")
        blocks.append(table(f"{family.title}, on {where(one.components)}", header, rows))
        confused = ", ".join(map(title_of, family.confused_with))
        blocks.append(
            paragraph(
                f"{family.equation}. Gain of log-likelihood {number(one.gain)}; chance of as much by noise alone, of "
                f"all candidates, {_chance(one.p_value)}. Often confused with: {confused}."
            )
        )
    if lines := advice(found):
        blocks += [paragraph("The campaign cannot tell these apart. What would:"), bullet_list(lines)]
    if found.next_tests:
        blocks.append(_next_tests(found))
    if verdict.residual_function is not None:
        blocks.append(figure(residual_function_figure(verdict.residual_function)))
    elif verdict.word == "unexplained":
        blocks.append(paragraph("More than noise is left, and no leg's position or speed, now or lately, explains it."))
    if verdict.where:
        blocks.append(paragraph(f"Most of what is left is in: {'; '.join(s.words for s in verdict.where)}."))
    if verdict.nearest:
        near = " and ".join(map(title_of, verdict.nearest))
        blocks.append(
            paragraph(f"Of the library, {near} comes nearest, but leaves too much to be its name; model.toml has it.")
        )
    return blocks


def _next_tests(found: Discovery) -> Markup:
    """Tests simulated with the one effect and explained by the other."""
    rows = [
        (one.test, " or ".join(map(title_of, one.families)), _margin(one.margin), "yes" if one.informative else "no")
        for one in found.next_tests
    ]
    header = ("Test of models/procedures/next_test.toml", "Effects", "Log-likelihood between them", "Tells them apart")
    return table("Next tests, simulated", header, rows)


def _margin(value: float) -> str:
    return "cannot be run" if math.isnan(value) else number(value)


def _proof_blocks(found: Discovery) -> list[Markup]:
    if found.proof is None:
        return [paragraph("No test was held out; give one with --hold-out.")]
    rows = [
        (
            f"{gap.phase}, {gap.test}",
            number(gap.delivered),
            number(gap.refitted),
            number(gap.after),
            "1",
            "–" if math.isnan(gap.closure) else f"{100 * gap.closure:.0f} %",
        )
        for gap in found.proof.gaps
    ]
    header = ("Phase and test", "As delivered", "Refitted", "With the effects", "Floor", "Closure")
    return [
        figure(gap_figure(found)),
        table("Gap over sensor noise", header, rows),
        paragraph(
            "Closure is (refitted − with the effects) over (refitted − floor); – where next to nothing was open."
        ),
    ]


def _considered(found: Discovery) -> list[Markup]:
    gates = [found.numbers.number(f"accept.{gate}") for gate in ("gain", "confusable")]
    blocks: list[Markup] = []
    for k, one in enumerate(found.search.rounds, start=1):
        blocks.append(figure(gain_figure(one, k, *gates)))
        rows = [
            (
                s.candidate.family.name,
                where(s.candidate.components),
                number(s.gain),
                number(float(s.score.held_out.sum())),
                f"{100 * s.closure:.0f} %" if s.closure else "–",
                s.refused or "passes",
            )
            for s in one.best.values()
        ]
        header = ("Family", "On", "Gain", "On tests not fitted", "Of the gap", "Added?")
        blocks.append(details(f"Round {k}: all families", table("Best candidate of each family", header, rows)))
        for contest in (a.contest for a in found.search.added if a.round == k - 1):
            tried = [(c.candidate.family.name, where(c.candidate.components), number(c.behind)) for c in contest]
            blocks.append(table("Fitted in full, by log-likelihood behind the best", ("Family", "On", "Behind"), tried))
    return blocks


def _parameter_blocks(found: Discovery) -> list[Markup]:
    verdict = found.verdict
    rows = [
        (name, f"{value.value:.5g}", f"{value.low:.5g} to {value.high:.5g}", value.unit)
        for name, value in verdict.changed.items()
    ]
    header = ("Parameter", "Value", "90 % interval", "Unit")
    blocks = [table("Parameters that differ, within calibration", header, rows) if rows else paragraph("None differs.")]
    if verdict.sensors:
        sensors = [
            (s.name, f"{s.estimate.value:.4g} {s.estimate.unit}", f"{s.stated:.3g}", s.family) for s in verdict.sensors
        ]
        blocks.append(table("Sensors beyond what is stated", ("Error", "Value", "Stated", "Family"), sensors))
    else:
        blocks.append(paragraph("No sensor is off beyond what its file states."))
    return blocks


def _assumptions(found: Discovery) -> list[Markup]:
    lines = [
        "Priors of parameters and ranges of sensor errors are those of the machine's and the sensors' files; most are "
        "assumed. Noise is simulated from the sensors' file, not estimated from what is left.",
        "A parameter beyond three stated deviations counts as an effect of its family; within them, as calibration.",
        "Candidates are ranked to first order; the best are fitted in full with everything else.",
    ]
    rows = [
        (path, ", ".join(f"{x:g}" for x in np.atleast_1d(q.value)), q.evidence, q.source)
        for path, q in found.numbers.items()
    ]
    if hidden := found.verdict.untestable:
        lines.append(f"This campaign is no test of {', '.join(hidden)}: their typical sizes do not stand clear of it.")
    return [bullet_list(lines), table("Numbers used", ("Number", "Value", "Evidence", "Source"), rows)]
