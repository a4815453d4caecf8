"""The verdict of a search: in a sentence or two, and as a file, verdict.json."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..core.files import write_whole
from ..core.jsonable import as_json
from ..data.campaign import skipped_summary
from ..identification.calibration.scale import scale_summary
from ..machine.library import find_family
from .discover import Discovery
from .estimates import Estimate
from .finding import EffectFinding
from .floor import NOISE
from .search_state import Round
from .unexplained import forces_explained
from .verdict import SensorFinding
from .verdict_notes import before_screening, drift_note, fading_note, interval_note, open_summary, refit_summary
from .withdrawal import Why

__all__ = ["advice", "save_verdict", "summary", "title_of", "verdict_entries", "where", "worse_note"]


_WITHDRAWN: dict[Why, str] = {
    "at_bound": "of which a number is at the bound of its range",
    "zero": "whose size cannot be distinguished from zero",
    "own_form": "which is no more than what the form of friction may be off by",
    "friction": "beside which a number of the report's friction is at the bound of its range, so that it replaces that",
    "held_out": "which lowers the residual of the tests searched, but not of those held out",
}
"""Why an effect that was added is no finding."""

CONSIDERED = 1.0
"""Gain of log-likelihood from which a candidate is listed."""

REMAINS = 0.01
"""Share of the squares beyond the expected scatter from which what remains is stated."""

WORSE, RAISED = 1.05, 1.5
"""Normalised RMS error on a held-out test over that before, from which it counts as worse: of balances, and of phases,
whose errors friction's path changes by chance."""


def save_verdict(found: Discovery, path: Path) -> Path:
    """Write the verdict as JSON, whole or not at all."""
    with write_whole(path) as beside:
        beside.write_text(as_json(verdict_entries(found)) + "\n", encoding="utf-8")
    return path


def verdict_entries(found: Discovery) -> dict[str, Any]:
    """The verdict as plain entries."""
    verdict = found.verdict
    closure: dict[str, Any] = {}
    for gap in found.proof.gaps if found.proof else ():
        entry = {key: value for key, value in asdict(gap).items() if key not in ("phase", "test")}
        closure.setdefault(gap.phase, {})[gap.test] = {**entry, "closure": _known(gap.closure)}
    return {
        "verdict": verdict.word,
        "effects": [
            {
                "name": one.family,
                "family": one.family,
                "form": one.form,
                "kind": one.kind,
                "probability": one.probability,
                "alternatives": [{"family": a.family, "probability": a.probability} for a in one.alternatives],
                "components": list(one.components),
                "parameters": {name: _interval(value) for name, value in one.parameters.items()},
                "gain": one.gain,
                "p_value": one.p_value,
            }
            for one in verdict.effects
        ],
        "parameters_changed": {name: _interval(value) for name, value in verdict.changed.items()},
        "sums": [{"of": list(names), **_interval(total)} for names, total in verdict.sums.items()],
        "scale": _scale(found),
        "sensor_findings": [
            {
                "name": s.name,
                "family": s.family,
                **_interval(s.estimate),
                "stated_range": s.stated,
                "relative_to": s.reference,
            }
            for s in verdict.sensors
        ],
        "closure": closure,
        "ambiguity": [[one.family, *one.rivals] for one in verdict.effects if one.rivals],
        "unexplained": None if verdict.word != "unexplained" else _unexplained(found),
        "not_testable": list(verdict.untestable),
        "at_bound": list(verdict.bounded),
        "remainder": dict(found.verdict.remainder),
        "intervals_too_narrow": bool(interval_note(found)),
        "before_screening": before_screening(found.search),
        "considered": [_considered(one) for one in found.search.rounds],
        "withdrawn": [
            {"name": w.name, "family": w.family, "why": w.why, "numbers": list(w.numbers), "gain": _known(w.gain)}
            for w in verdict.withdrawn
        ],
        "rejected_on_held_out": {w.family: w.gain for w in verdict.withdrawn if w.why == "held_out"},
        "beyond_search": [one._asdict() for one in found.beyond],
        "held_out_balances": [asdict(one) for one in found.balances],
        "next_test": [
            {"test": n.test, "tells": list(n.families), "margin": _known(n.margin), "told": n.informative}
            for n in found.next_tests
        ],
        "advice": advice(found),
        "campaign": found.campaign,
        "machine": found.machine.name,
        "tests": list(found.used),
        "held_out": list(found.held_out),
        "skipped": dict(found.skipped),
        "seed": found.seed,
        "versions": {"lhpost6_pin": __version__},
        "inputs": found.hashes,
    }


def _considered(one: Round) -> list[dict[str, Any]]:
    """The best candidates of a round of the search, one a family, and why each is not accepted as it is."""
    return [
        {
            "family": s.candidate.family.named,
            "form": s.candidate.family.name,
            "components": list(s.candidate.components),
            "gain": s.gain,
            "cross_validated": float(s.score.held_out.sum()),
            "refused": s.refused,
        }
        for s in one.best.values()
        if s.gain > CONSIDERED
    ]


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def advice(found: Discovery) -> list[str]:
    """Tests that would discriminate between rivals, as the library states them."""
    rivals = [name for one in found.verdict.effects if one.rivals for name in (one.family, *one.rivals)]
    return [f"{name}: {find_family(name).tell_apart}" for name in dict.fromkeys(rivals)]


def _interval(value: Estimate) -> dict[str, Any]:
    return {"value": value.value, "unit": value.unit, "ci90": [value.low, value.high]}


def _scale(found: Discovery) -> dict[str, Any] | None:
    """What the scale is taken from that nothing measured fixes, and the ratios that are known."""
    scale = found.verdict.scale
    if scale is None:
        return None
    stated = {"value": scale.value, "unit": scale.unit} if scale.unit else {}
    each = {name: _interval(ratio) for name, ratio in found.verdict.ratios.items()}
    return {"fixed_by": scale.name, **stated, "why": scale_summary(scale), "ratios": each}


def _unexplained(found: Discovery) -> dict[str, Any] | None:
    function = found.verdict.residual_function
    known = {
        "nearest": list(found.verdict.nearest),
        "where": [
            {"residual": s.kind, "column": s.label, "band": list(s.band), "misfit": s.misfit}
            for s in found.verdict.where
        ],
        "fading": [
            {"effect": one.candidate.name, "memory": one.memory, "gain": one.gain} for one in found.verdict.fading
        ],
    }
    if function is None:
        return {**known, "component": None, "depends_on": "not known"}
    formula = function.formula
    return {
        **known,
        "component": function.components[0] if len(function.components) == 1 else None,
        "components": list(function.components),
        "depends_on": function.state,
        "memory": function.memory or None,
        "gain": function.gain,
        "nodes": function.nodes.tolist(),
        "value": function.value.tolist(),
        "sd": function.sd.tolist(),
        "unit": "N",
        "domain": [float(function.nodes[0]), float(function.nodes[-1]), function.unit],
        "formula": {"text": formula.text("N"), "share": formula.share},
    }


def summary(found: Discovery) -> str:
    """What was identified; and that it is not validated, where no test was held out."""
    verdict = found.verdict
    effects = " and ".join(f"{_name_of(one)} ({where(one.components)})" for one in verdict.effects)
    if verdict.word == "unexplained":
        text = _unexplained_summary(found, effects)
    else:
        rivals = "; ".join(_rivals_of(one) for one in verdict.effects if one.rivals)
        changed = f"{len(verdict.changed)} parameter{' differs' if len(verdict.changed) == 1 else 's differ'}"
        text = {
            "none": "no missing effect; no parameter differs from the machine file.",
            "not_testable": f"no missing effect, but {len(verdict.untestable)} families are not testable with this "
            "campaign: it needs more excitation, or sensors that observe them (lhpost6 check).",
            "parameters_only": f"no missing effect; {changed}: {', '.join(verdict.changed)}.",
            "sensor": f"no missing effect; {_beyond(verdict.sensors)}.",
            "named": f"{effects}.",
            "ambiguous": f"{effects}. {rivals}",
        }[verdict.word]
    if verdict.sensors and verdict.word != "sensor":
        beyond = _beyond(verdict.sensors)
        text += f" {beyond[0].upper()}{beyond[1:]}."
    if verdict.word in ("named", "ambiguous"):
        left = [f"{100.0 * share:.2g} % ({kind})" for kind, share in verdict.remainder.items() if share > REMAINS]
        text += f" Of the squares beyond the expected scatter remain {', '.join(left)}." if left else ""
        text += open_summary(found)
    if verdict.word in ("none", "parameters_only", "sensor"):
        text += refit_summary(found)
    identified = {one.family for one in verdict.effects}
    for why, reason in _WITHDRAWN.items():
        gone = dict.fromkeys(one.family for one in verdict.withdrawn if one.why == why)
        if names := [title_of(family) for family in gone if family not in identified]:
            text += f" Not identified: {' and '.join(names)}, {reason}."
    for one in found.beyond:
        far = f"{one.test} moves {one.component} by {one.reached:.3g} m, the tests searched by {one.searched:.3g} m"
        text += f" {far}: beyond that, {title_of(one.family)} is extrapolated."
    if worse := worse_note(found):
        text += f" {worse}"
    if (scatter := _scatter(found)) is not None:
        text += f" {scatter}"
    if verdict.bounded:
        text += f" At the bound of their ranges, and no estimates: {', '.join(verdict.bounded)}."
    if verdict.scale is not None:
        text += f" {scale_summary(verdict.scale)}"
    if found.skipped:
        text += f" {skipped_summary(found.skipped)}"
    if verdict.effects and found.proof is None:
        return f"{text} Not validated, as no test was held out: add tests, or name one with --hold-out."
    return text


def _name_of(one: EffectFinding) -> str:
    """Title of an effect's family, or what it and its rivals have in common."""
    return one.kind if one.rivals and one.kind else title_of(one.family)


def _rivals_of(one: EffectFinding) -> str:
    """Which families explain an effect, how probable each is, and the test that distinguishes them."""
    rivals = {one.family, *one.rivals}
    each = [f"{title_of(a.family)} ({a.probability:.2f})" for a in one.alternatives if a.family in rivals]
    tests = dict.fromkeys(find_family(name).tell_apart for name in (one.family, *one.rivals))
    return f"On {where(one.components)} it is {' or '.join(each)}; to be distinguished by {'; or '.join(tests)}."


def _beyond(sensors: Sequence[SensorFinding]) -> str:
    """Sensors beyond their ranges, with values and ranges."""
    each = []
    for one in sensors:
        value, stated, unit = one.estimate.value, one.stated, one.estimate.unit
        if unit == "s":
            value, stated, unit = 1e3 * value, 1e3 * stated, "ms"
        size = f"{value:.3g}{'' if unit == '1' else f' {unit}'}" + f" relative to {one.reference}" * bool(one.reference)
        each.append(one.name if one.name.startswith("sign ") else f"{one.name} {size} (at most {stated:.3g})")
    return f"sensors beyond the ranges of the sensors file: {', '.join(each)}"


def worse_note(found: Discovery) -> str:
    """That a refit is worse than the machine as delivered on held-out tests; empty where it is not."""
    worse = [
        f"{one.kind} of {one.test} {one.error[0]:.2f} to {one.error[1]:.2f}"
        for one in found.balances
        if one.error[1] > WORSE * max(one.error[0], NOISE)
    ]
    worse += [
        f"{one.phase} of {one.test} {one.delivered:.2f} to {one.refitted:.2f} times sensor noise"
        for one in (found.proof.gaps if found.proof else ())
        if one.refitted > RAISED * max(one.delivered, one.floor, NOISE)
    ]
    if not worse:
        return ""
    start = "The refit without effects is worse than the machine as delivered on held-out tests"
    return f"{start} ({', '.join(worse)}): do not take parameters that differ before that is explained."


def _scatter(found: Discovery) -> str | None:
    """That forces exceed the expected scatter, but are explained well enough for friction; None where they do not."""
    n, misfit = found.numbers.number, found.search.misfit("wrench")
    if not (misfit > n("verdict.unexplained") and forces_explained(found.search)):
        return None
    share = np.sqrt(found.search.calibration.number("friction.enough"))
    return (
        f"The residual of forces is {np.sqrt(misfit):.3g} times the expected scatter, but within {100.0 * share:g} % "
        "of the forces, as friction varies from stroke to stroke."
    )


def _unexplained_summary(found: Discovery, effects: str) -> str:
    verdict = found.verdict
    function, place = verdict.residual_function, "the residual exceeds the expected scatter"
    if function is not None:
        place = f"an effect acts on {where(function.components)}, as a function of {function.description}"
    elif note := drift_note(verdict) or fading_note(verdict):
        place = note
    near = f" Nearest family: {' and '.join(map(title_of, verdict.nearest))}." if verdict.nearest else ""
    return f"{effects + '; in addition ' if effects else ''}{place}; no family of the library explains it.{near}"


def title_of(family: str) -> str:
    """Title of a family."""
    return find_family(family).title


def where(components: tuple[str, ...]) -> str:
    """Components, abbreviated."""
    return ", ".join(components) if len(components) < 4 else f"{components[0]} to {components[-1]}"
