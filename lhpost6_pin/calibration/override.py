"""The override file that a calibration leaves: the numbers found, with where they come from."""

import json
from pathlib import Path

from ..files import write_whole
from ..parameters import Value
from .knobs import knob_changes
from .result import Calibration

__all__ = ["save_override"]


def save_override(calibration: Calibration, path: Path) -> Path:
    """Write the calibrated numbers as a TOML file for `--override`, whole or not at all.

    Knobs that the campaign has told little of are written, too: they go together with those it has told much of; and
    numbers that the machine had from an override before. A number's standard deviation is the predicted one.
    """
    machine, count = calibration.machine, len(calibration.knobs)
    values = knob_changes(machine, calibration.knobs, calibration.estimate[:count])
    deviations: dict[str, list[float]] = {}
    for i, knob in enumerate(calibration.knobs):
        sd = float(calibration.sd[i]) * (abs(knob.at(calibration.estimate[i])) if knob.relative else 1.0)
        for name, component in knob.paths:
            stated = machine.parameters[name].sd
            known = stated if isinstance(stated, tuple) else (stated or 0.0,)
            deviations.setdefault(name, list(known))[max(component, 0)] = sd
    source = f"calibrated from campaign {calibration.campaign}: {', '.join(calibration.tests)}"
    entries: dict[str, str] = {}
    for name, value in values.items():
        spread = deviations[name] if isinstance(value, list) else deviations[name][0]
        entries[name] = _entry(value, machine.parameters[name].unit, "calibrated", source, spread)
    for name, quantity in machine.parameters.items():
        earlier = quantity.evidence in ("override", "calibrated") and not name.endswith(".valves")  # those of the tests
        if earlier and name not in entries:
            entries[name] = _entry(quantity.value, quantity.unit, quantity.evidence, quantity.source, quantity.sd)
    kinds, names = ({getattr(c, which) for c in machine.components} for which in ("kind", "name"))
    groups: dict[str, list[str]] = {}
    for name, entry in entries.items():
        section, _, key = name.partition(".")
        group = f"kind.{section}" if section in kinds else f"component.{section}" if section in names else section
        groups.setdefault(group, []).append(f"{key} = {{ {entry} }}")
    title = " ".join(f"# Numbers of {machine.name}, {source}.".split())  # on one line
    lines = [title, "# sd is the predicted standard deviation."]
    for group, rows in groups.items():
        lines += ["", f"[{group}]", *rows]
    with write_whole(path) as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # TOML's basic strings are JSON's


def _entry(value: Value | list[float], unit: str, evidence: str, source: str, sd: Value | list[float] | None) -> str:
    spread = "" if sd is None else f", sd = {_toml(sd)}"
    return f'value = {_toml(value)}, unit = "{unit}", evidence = "{evidence}", source = {_text(source)}{spread}'


def _toml(value: Value | list[float]) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(repr(float(v)) for v in value)}]"
    return repr(float(value))
