"""What a search leaves in its folder: verdict.json."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.files import write_whole
from ..core.jsonable import as_json
from ..machine.library import find_family
from .discover import Discovery
from .verdict import EffectFinding, Estimate

__all__ = ["save_verdict", "verdict_entries"]


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
        entry = {key: round(value, 4) for key, value in asdict(gap).items() if key not in ("phase", "test")}
        share = None if math.isnan(gap.closure) else round(gap.closure, 4)
        closure.setdefault(gap.phase, {})[gap.test] = {**entry, "floor": 1.0, "closure": share}
    return {
        "verdict": verdict.word,
        "effects": [_effect(one) for one in verdict.effects],
        "parameters_changed": {name: _interval(value) for name, value in verdict.changed.items()},
        "sensor_findings": [
            {"name": s.name, "family": s.family, **_interval(s.estimate), "stated_range": s.stated}
            for s in verdict.sensors
        ],
        "closure": closure,
        "ambiguity": [[one.family, *one.rivals] for one in verdict.effects if one.rivals],
        "unexplained": None if verdict.word != "unexplained" else _left(found),
        "not_testable": list(verdict.untestable),
        "next_test": [
            {"test": n.test, "tells": list(n.families), "margin": _finite(n.margin), "told": n.informative}
            for n in found.next_tests
        ],
        "advice": advice(found),
        "campaign": found.campaign,
        "machine": found.machine.name,
        "tests": list(found.used),
        "held_out": list(found.held_out),
        "seed": found.seed,
        "versions": {"lhpost6_pin": __version__},
        "inputs": found.hashes,
    }


def _finite(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 1)


def advice(found: Discovery) -> list[str]:
    """Tests that would tell rivals apart, in words of the library."""
    rivals = [name for one in found.verdict.effects if one.rivals for name in (one.family, *one.rivals)]
    return [f"{name}: {find_family(name).tell_apart}" for name in dict.fromkeys(rivals)]


def _effect(one: EffectFinding) -> dict[str, Any]:
    return {
        "name": one.family,
        "family": one.family,
        "form": one.form,
        "components": list(one.components),
        "parameters": {name: _interval(value) for name, value in one.parameters.items()},
        "gain": one.gain,
        "p_value": one.p_value,
    }


def _interval(value: Estimate) -> dict[str, Any]:
    return {"value": value.value, "unit": value.unit, "ci90": [value.low, value.high]}


def _left(found: Discovery) -> dict[str, Any] | None:
    left = found.verdict.residual_function
    known = {
        "nearest": list(found.verdict.nearest),
        "where": [
            {"residual": s.kind, "column": s.label, "band": list(s.band), "misfit": round(s.misfit, 2)}
            for s in found.verdict.where
        ],
    }
    if left is None:
        return {**known, "component": None, "depends_on": "not known"}
    formula = left.formula
    return {
        **known,
        "component": left.components[0] if len(left.components) == 1 else None,
        "components": list(left.components),
        "depends_on": left.state,
        "memory": left.memory or None,
        "gain": left.gain,
        "nodes": left.nodes.tolist(),
        "value": left.value.tolist(),
        "sd": left.sd.tolist(),
        "unit": "N",
        "domain": [float(left.nodes[0]), float(left.nodes[-1]), left.unit],
        "formula": {"text": formula.text("N"), "share": formula.share},
    }
