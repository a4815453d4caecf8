"""The report of a discovery: identified effects, held-out errors, misfit map, candidates considered."""

import math
from pathlib import Path

from ...discovery import Discovery, save_verdict
from ...discovery.verdict_file import advice
from ...discovery.verdict_summary import summary, title_of, where
from ...machine.library import find_family
from ...machine.machine_toml import save_machine_toml
from .control_blocks import load_of, numbers_used
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
)

__all__ = ["save_discovery", "write_discover_report"]

_LEVELS: dict[str, Level] = {"none": "good", "parameters_only": "good", "named": "good", "unexplained": "bad"}


def save_discovery(found: Discovery, folder: Path, title: str, command: str = "") -> list[Path]:
    """Write verdict.json, model.toml (headed by `title`) and report.html to a directory; returns the paths."""
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
        title=f"Effects missing from {found.machine.name}, by {found.campaign}",
        asked=f"Identify effects missing from the model of {load_of(found.machine)}, from {tests}{held}.",
        verdict=f"{verdict.word}: {summary(found)}",
        level=_LEVELS.get(verdict.word, "attention"),
        headlines=_headlines(found),
        sections=[
            Section("effects", "Identified effects", _effect_blocks(found)),
            Section("proof", "Errors on held-out tests", _proof_blocks(found)),
            Section("where", "Misfit by channel and band", map_blocks(found)),
            Section("considered", "Candidates considered", _considered(found)),
            Section("parameters", "Parameters and sensors", _parameter_blocks(found)),
            Section("assumptions", "Assumptions and numbers used", _assumptions(found)),
        ],
        command=command,
    )
    return save_page(page, path)


def _p_value(p: float) -> str:
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
                f"Largest normalised RMS error: {widest.phase}, {widest.test}",
                "refitted → with the effects; 1 is sensor noise",
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
                f"{family.equation}. Gain of log-likelihood {number(one.gain)}; p-value, corrected for the number of "
                f"candidates: {_p_value(one.p_value)}. Often confused with: {confused}."
            )
        )
    if lines := advice(found):
        blocks += [
            paragraph("The campaign does not distinguish the candidates. Tests that would:"),
            bullet_list(lines),
        ]
    if found.next_tests:
        blocks.append(_next_tests(found))
    if verdict.residual_function is not None:
        blocks.append(figure(residual_function_figure(verdict.residual_function)))
    elif verdict.word == "unexplained":
        words = "The residual exceeds noise and is not a function of an actuator's or strut's position or velocity."
        blocks.append(paragraph(words))
    if verdict.where:
        blocks.append(paragraph(f"The largest residuals are in: {'; '.join(s.description for s in verdict.where)}."))
    if verdict.nearest:
        near = " and ".join(map(title_of, verdict.nearest))
        blocks.append(
            paragraph(
                f"The closest library family is {near}, which leaves a significant residual; model.toml contains it."
            )
        )
    return blocks


def _next_tests(found: Discovery) -> Markup:
    """Tests simulated with one effect and fitted with the other."""
    rows = [
        (one.test, " or ".join(map(title_of, one.families)), _margin(one.margin), "yes" if one.informative else "no")
        for one in found.next_tests
    ]
    header = ("Test of models/procedures/next_test.toml", "Effects", "Log-likelihood difference", "Distinguishes")
    return table("Next tests, simulated", header, rows)


def _margin(value: float) -> str:
    return "not feasible" if math.isnan(value) else number(value)


def _proof_blocks(found: Discovery) -> list[Markup]:
    if found.proof is None:
        return [paragraph("No test was held out; name one with --hold-out.")]
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
        table("Normalised RMS error (1: sensor noise)", header, rows),
        paragraph(
            "Closure: (refitted − with the effects) ∕ (refitted − floor); –: not applicable, already at the floor."
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
        header = ("Family", "On", "Gain", "Cross-validated gain", "Closure", "Accepted")
        blocks.append(details(f"Round {k}: all families", table("Best candidate of each family", header, rows)))
        for contest in (a.contest for a in found.search.added if a.round == k - 1):
            tried = [(c.candidate.family.name, where(c.candidate.components), number(c.behind)) for c in contest]
            blocks.append(table("Full fits: log-likelihood below the best", ("Family", "On", "Difference"), tried))
    return blocks


def _parameter_blocks(found: Discovery) -> list[Markup]:
    verdict = found.verdict
    rows = [
        (name, f"{value.value:.5g}", f"{value.low:.5g} to {value.high:.5g}", value.unit)
        for name, value in verdict.changed.items()
    ]
    header = ("Parameter", "Value", "90 % interval", "Unit")
    blocks = [table("Recalibrated parameters", header, rows) if rows else paragraph("No parameter differs.")]
    if verdict.sensors:
        sensors = [
            (s.name, f"{s.estimate.value:.4g} {s.estimate.unit}", f"{s.stated:.3g}", s.family) for s in verdict.sensors
        ]
        blocks.append(table("Sensors outside their stated range", ("Error", "Value", "Stated", "Family"), sensors))
    else:
        blocks.append(paragraph("All sensors are within their stated ranges."))
    return blocks


def _assumptions(found: Discovery) -> list[Markup]:
    lines = [
        "Priors of parameters and ranges of sensor errors are from the machine's and the sensors' files; most are "
        "assumed. Noise is simulated from the sensors' file, not estimated from the residual.",
        "A fitted parameter within 3 sigma of its prior counts as calibration; beyond that it is reported as an "
        "effect of its family.",
        "Candidates are ranked to first order; the best are fitted in full together with all known unknowns.",
    ]
    if hidden := found.verdict.untestable:
        lines.append(f"Not testable with this campaign: {', '.join(hidden)}; typical sizes are within the noise.")
    return [bullet_list(lines), numbers_used(found.numbers)]
