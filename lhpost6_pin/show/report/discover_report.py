"""The report of a discovery: identified effects, held-out errors, misfit map, candidates considered."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from ...data.records import save_record
from ...discovery import Discovery, save_verdict
from ...discovery.balances import Balance
from ...discovery.estimates import Estimate
from ...discovery.finding import EffectFinding
from ...discovery.held_out import Proof
from ...discovery.verdict import SensorFinding, Verdict, Word
from ...discovery.verdict_file import advice, summary, title_of, where, worse_note
from ...discovery.verdict_notes import (
    EXPECTED_SCATTER,
    balance_note,
    before_screening,
    drift_note,
    fading_note,
    floor_note,
    form_note,
    interval_note,
    open_share,
)
from ...machine.library import find_family
from ...machine.machine_toml import save_machine_toml
from .closing_plots import closing_blocks
from .control_blocks import load_of, numbers_used
from .curve_plots import curve_blocks
from .discover_plots import (
    gain_figure,
    gap_figure,
    held_out_errors,
    map_blocks,
    residual_function_figure,
)
from .page import Block, Headline, Level, Page, Section, Table, bullet_list, details, number, save_page

__all__ = ["discovery_tables", "save_discovery", "verdict_sentence", "write_discover_report"]

_VERDICTS: dict[Word, tuple[str, Level]] = {
    "none": ("no missing effect", "good"),
    "parameters_only": ("parameters differ", "good"),
    "sensor": ("sensor beyond its range", "attention"),
    "named": ("effect identified", "good"),
    "ambiguous": ("effects not distinguished", "attention"),
    "unexplained": ("unexplained residual", "bad"),
    "not_testable": ("not testable", "attention"),
}

PARTLY = 0.5
"""Share of the held-out error that effects leave, from which the verdict says that they explain it in part only."""


def save_discovery(found: Discovery, folder: Path, title: str, command: str = "") -> list[Path]:
    """Write verdict.json, model.toml (headed by `title`), report.html and residual forces to view; returns paths."""
    named = found.residual_forces.items()
    forces = {folder / f"residual_{name.replace(' ', '_')}.nc": record for name, record in named}
    for path, record in forces.items():
        save_record(record, path)
    return [
        *forces,
        save_verdict(found, folder / "verdict.json"),
        save_machine_toml(found.fitted, folder / "model.toml", title),
        write_discover_report(found, folder / "report.html", command=command),
    ]


def write_discover_report(found: Discovery, path: Path | str, command: str = "") -> Path:
    """Write the self-contained HTML report of a search to `path` and return the path."""
    tests = f"{len(found.used)} test{'s' * (len(found.used) != 1)}: {', '.join(found.used)}"
    held = f"; {', '.join(found.held_out)} held out" if found.held_out else ""
    page = Page(
        kind="Discovery",
        title=f"Search for missing effects: {found.machine.name}, by {found.campaign}",
        purpose=f"Identify effects missing from the model of {load_of(found.machine)}, from {tests}{held}.",
        verdict=verdict_sentence(found),
        level=_verdict_of(found)[1],
        headlines=_headlines(found),
        sections=[
            Section("closing", "Error before and after", closing_blocks(found)),
            Section("effects", "Identified effects", _effect_blocks(found)),
            Section("proof", "Errors on held-out tests", _proof_blocks(found)),
            Section("curves", "Friction and valves", curve_blocks(found.curves, found.machine, _acted_on(found))),
            Section("where", "Misfit by channel and band", map_blocks(found)),
            Section("considered", "Candidates considered", _considered(found)),
            Section("parameters", "Parameters and sensors", _parameter_blocks(found)),
            Section("assumptions", "Assumptions and numbers used", _assumptions(found)),
        ],
        command=command,
    )
    return save_page(page, path)


def _verdict_of(found: Discovery) -> tuple[str, Level]:
    """The verdict in a few words, and its level; an effect that leaves most of the error is no good news alone."""
    words, level = _VERDICTS[found.verdict.word]
    if found.verdict.word in ("named", "ambiguous") and (left := open_share(found)) > PARTLY:
        return f"{words}, {100.0 * left:.0f} % of the held-out error remains", "attention"
    return words, "attention" if level == "good" and worse_note(found) else level


def verdict_sentence(found: Discovery) -> str:
    """Return the verdict in words, and what was identified."""
    text = summary(found)
    if text.startswith("no missing effect"):
        return text[0].upper() + text[1:]
    words = _verdict_of(found)[0]
    return f"{words[0].upper()}{words[1:]}: {text}"


def discovery_tables(found: Discovery) -> list[Table | str]:
    """Return the tables of a verdict: effects, recalibrated parameters, sensors, errors on held-out tests, notes."""
    verdict = found.verdict
    changed = []
    if verdict.changed:
        changed.append(_changed_table(verdict))
    if verdict.scale and verdict.ratios:
        changed.append(_estimates(f"Ratios to {verdict.scale.name}", "Number", verdict.ratios))
    sensors = [_sensor_table(verdict.sensors)] if verdict.sensors else []
    proof = [_proof_table(found.proof)] if found.proof else []
    balances = [_balance_table(found.balances)] if found.balances else []
    words = [balance_note(found.balances)] if found.balances else []
    effects = list(map(_effect_table, verdict.effects))
    narrow = [interval_note(found), form_note(found)] if effects or changed else []
    return [*effects, *changed, *narrow, *sensors, *proof, floor_note(found), *balances, *words]


def _balance_table(balances: Sequence[Balance]) -> Table:
    """Balances on held-out tests: as delivered, refitted, with the effects."""

    def three(values: tuple[float, float, float] | None, form: str) -> str:
        return " → ".join(form.format(v) for v in values) if values else "–"

    rows = [
        (
            f"{one.kind}, {one.test}",
            three(one.error, "{:.2f}"),
            three(one.share, "{:.1%}"),
            three(one.explained, "{:.3f}"),
        )
        for one in balances
    ]
    header = ("Balance and test", "Error over expected scatter", "Error over measured force", "R²")
    return Table("Balances of held-out tests: as delivered → refitted → with the effects", header, rows)


def _sensor_table(sensors: Sequence[SensorFinding]) -> Table:
    rows = [
        (
            s.name,
            f"{s.estimate.value:.4g} {s.estimate.unit}" + f" relative to {s.reference}" * bool(s.reference),
            f"{s.stated:.3g}",
            s.family,
        )
        for s in sensors
    ]
    return Table("Sensors beyond the ranges of the sensors file", ("Error", "Value", "At most", "Family"), rows)


def _effect_table(one: EffectFinding) -> Table:
    return _estimates(
        f"{find_family(one.form or one.family).title}, on {where(one.components)}", "Number", one.parameters
    )


def _changed_table(verdict: Verdict) -> Table:
    """Parameters that differ, and the sums of those that are known as a sum alone."""
    alone = {name: "only the sum is known" for names in verdict.sums for name in names}
    alone |= dict.fromkeys(verdict.bounded, "at its bound")
    sums = {" + ".join(names): total for names, total in verdict.sums.items()}
    return _estimates("Recalibrated parameters", "Parameter", {**verdict.changed, **sums}, alone)


def _estimates(
    caption: str, what: str, estimates: Mapping[str, Estimate], why: Mapping[str, str] | None = None
) -> Table:
    """Estimates with their intervals, or `why` they have none."""
    none = why or {}
    rows = [(n, f"{e.value:.5g}", none.get(n, f"{e.low:.5g} to {e.high:.5g}"), e.unit) for n, e in estimates.items()]
    return Table(caption, (what, "Value", "90 % interval", "Unit"), rows)


def _proof_table(proof: Proof) -> Table:
    rows = [
        (
            f"{gap.phase}, {gap.test}",
            *(number(error) for error in (gap.delivered, gap.refitted, gap.after)),
            number(gap.floor),
            "–" if math.isnan(gap.closure) else f"{100 * gap.closure:.0f} %",
        )
        for gap in proof.gaps
    ]
    header = ("Phase and test", "As delivered", "Refitted", "With the effects", "Floor", "Closure")
    return Table("Normalised RMS error on held-out tests (1: sensor noise alone)", header, rows)


def _acted_on(found: Discovery) -> set[str]:
    """Components that the identified effects act on."""
    return {component for one in found.verdict.effects for component in one.components}


def _headlines(found: Discovery) -> list[Headline]:
    verdict = found.verdict
    families = [one.family for one in verdict.effects]  # two of one are told apart by their components
    named = [title_of(e.family) + f" ({where(e.components)})" * (families.count(e.family) > 1) for e in verdict.effects]
    words, _, left = _verdict_of(found)[0].partition(", ")
    shown = [Headline(words, "Verdict", left)]
    if verdict.word == "sensor":
        first = verdict.sensors[0]
        size = f"{first.estimate.value:.4g} {first.estimate.unit}"
        shown.append(Headline(first.name, "Sensor", f"{size}; sensors file: at most {first.stated:.3g}"))
    else:
        shown.append(Headline(", ".join(named) or "none", "Effects"))
    if errors := held_out_errors(found):
        (widest, unit), (_, refitted, after) = max(errors.items(), key=lambda one: one[1][1])
        shown.append(
            Headline(
                f"{number(refitted)} → {number(after)}",
                f"Largest normalised RMS error: {widest}",
                f"refitted → with the effects; in units of {unit}",
            )
        )
    return shown


def _effect_blocks(found: Discovery) -> list[Block]:
    verdict = found.verdict
    if not verdict.effects and verdict.word != "unexplained":
        return ["No effect is missing."]
    blocks: list[Block] = []
    rivals = [one for one in verdict.effects if len(one.alternatives) > 1]
    if rivals:
        chances = [
            (where(e.components), title_of(a.family), f"{a.probability:.2f}") for e in rivals for a in e.alternatives
        ]
        blocks.append(Table("Families fitted in an effect's place", ("On", "Family", "Probability"), chances))
    if verdict.remainder:
        left = [(kind, f"{100.0 * share:.2g} %") for kind, share in verdict.remainder.items()]
        blocks.append(
            Table("Remainder of the squares beyond the expected scatter", ("Residual", "Share of the refit's"), left)
        )
    for one in verdict.effects:
        family = find_family(one.form or one.family)
        p_value = "less than 1e-300" if one.p_value < 1e-300 else f"{one.p_value:.1g}"
        confused = ", ".join(map(title_of, family.confused_with))
        blocks += [
            _effect_table(one),
            f"{family.equation}. Gain of log-likelihood {number(one.gain)}; p-value, corrected for the number of "
            f"candidates: {p_value}. Often confused with: {confused}.",
        ]
    if verdict.effects:
        blocks += filter(None, [interval_note(found)])
    if lines := advice(found):
        blocks += ["The campaign does not distinguish the candidates. Tests that would:", bullet_list(lines)]
    if found.next_tests:  # simulated with one effect and fitted with the other
        rows = [
            (
                one.test,
                " or ".join(map(title_of, one.families)),
                _margin(one.margin),
                "yes" if one.informative else "no",
            )
            for one in found.next_tests
        ]
        header = ("Test of models/procedures/next_test.toml", "Effects", "Log-likelihood difference", "Distinguishes")
        blocks.append(Table("Next tests, simulated", header, rows))
    if verdict.residual_function is not None:
        blocks.append(residual_function_figure(verdict.residual_function))
    elif verdict.word == "unexplained":
        none = "The residual is no function of an actuator's or strut's position or velocity"
        blocks.append(f"{drift_note(verdict) or fading_note(verdict) or none}.")
    if verdict.where:
        blocks.append(f"The largest residuals are in: {'; '.join(s.description for s in verdict.where)}.")
    if verdict.nearest:
        near = " and ".join(map(title_of, verdict.nearest))
        words = "which leaves a significant residual; model.toml contains it."
        blocks.append(f"The closest library family is {near}, {words}")
    return blocks


def _margin(value: float) -> str:
    return "not feasible" if math.isnan(value) else number(value)


def _proof_blocks(found: Discovery) -> list[Block]:
    if found.proof is None:
        return ["No test was held out; name one with --hold-out."]
    closure = (
        "Floor: expected of a model that lacks nothing, by sensor noise, uncertain numbers and oil that warms. "
        "Closure: (refitted − with the effects) ∕ (refitted − floor), by chance above 100 %; –: already at the floor."
    )
    return [
        gap_figure(found),
        _proof_table(found.proof),
        closure,
        _balance_table(found.balances),
        balance_note(found.balances),
    ]


def _considered(found: Discovery) -> list[Block]:
    gates = [found.numbers.number(f"accept.{gate}") for gate in ("gain", "confusable")]
    blocks: list[Block] = [*before_screening(found.search)]
    for k, one in enumerate(found.search.rounds, start=1):
        blocks.append(gain_figure(one, k, *gates))
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
        blocks.append(details(f"Round {k}: all families", Table("Best candidate of each family", header, rows)))
        for contest in (a.contest for a in found.search.added if a.round == k - 1):
            tried = [(c.candidate.family.name, where(c.candidate.components), number(c.behind)) for c in contest]
            blocks.append(Table("Full fits: log-likelihood below the best", ("Family", "On", "Difference"), tried))
    return blocks


def _parameter_blocks(found: Discovery) -> list[Block]:
    changed, sensors = found.verdict.changed, found.verdict.sensors
    narrow = filter(None, [interval_note(found), form_note(found)] if changed else [])
    return [
        _changed_table(found.verdict) if changed else "No parameter differs.",
        *narrow,
        _sensor_table(sensors) if sensors else "All sensors are within the ranges of the sensors file.",
    ]


def _assumptions(found: Discovery) -> list[Block]:
    lines = [
        EXPECTED_SCATTER,
        "Priors of parameters and ranges of sensor errors are from the machine's and the sensors' files; most are "
        "assumed. Noise is simulated from the sensors' file, not estimated from the residual.",
        "A fitted parameter within 3 sigma of its prior counts as calibration; beyond that it is reported as an "
        "effect of its family.",
        "Candidates are ranked to first order; the best are fitted in full together with all known unknowns.",
    ]
    if hidden := found.verdict.untestable:
        lines.append(
            f"Not testable with this campaign: {', '.join(hidden)}; typical sizes are within the expected scatter."
        )
    return [bullet_list(lines), numbers_used(found.numbers)]
