"""The override file that a calibration leaves: the numbers found, with where they come from."""

import json
from pathlib import Path

from ..files import write_whole
from .knobs import knob_changes
from .result import Calibration

__all__ = ["save_override"]


def save_override(calibration: Calibration, path: Path) -> Path:
    """Write the calibrated numbers as a TOML file for `--override`, whole or not at all.

    Knobs that the campaign has told little of are written, too: they go together with those it has told much of.
    A number's standard deviation is the predicted one.
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
    groups: dict[str, list[str]] = {}
    kinds = {c.kind for c in machine.components}
    names = {c.name for c in machine.components}
    for name, value in values.items():
        section, _, key = name.partition(".")
        group = f"kind.{section}" if section in kinds else f"component.{section}" if section in names else section
        unit, deviation = machine.parameters[name].unit, deviations[name]
        entry = f'value = {_toml(value)}, unit = "{unit}", evidence = "calibrated", source = {_text(source)}'
        spread = _toml(deviation if isinstance(value, list) else deviation[0])
        groups.setdefault(group, []).append(f"{key} = {{ {entry}, sd = {spread} }}")
    title = " ".join(f"# Numbers of {machine.name}, {source}.".split())  # on one line
    lines = [title, "# sd is the predicted standard deviation."]
    for group, entries in groups.items():
        lines += ["", f"[{group}]", *entries]
    with write_whole(path) as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # TOML's basic strings are JSON's


def _toml(value: float | list[float]) -> str:
    if isinstance(value, list):
        return f"[{', '.join(repr(float(v)) for v in value)}]"
    return repr(float(value))
