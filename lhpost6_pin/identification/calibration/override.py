"""The override file that a calibration leaves: the numbers found, with where they come from."""

from dataclasses import replace
from pathlib import Path

from ...core.files import write_whole
from ...machine.machine_toml import quantity_toml, section_of, sections_toml
from ...machine.parameters import Quantity
from .free_parameters import knob_changes
from .result import Calibration

__all__ = ["save_override"]


def save_override(calibration: Calibration, path: Path) -> Path:
    """Write the calibrated numbers as a TOML file for `--override`, whole or not at all.

    Knobs that the campaign has told little of are written, too: they go together with those it has told much of; and
    numbers that the machine had from an override before. A number's standard deviation is the predicted one; of a fit
    that did not converge none is written, which leaves the machine file's.
    """
    machine, count = calibration.machine, len(calibration.knobs)
    values = knob_changes(machine, calibration.knobs, calibration.estimate[:count])
    deviations: dict[str, list[float]] = {}
    for i, knob in enumerate(calibration.knobs):
        sd = float(calibration.sd[i]) * (1.0 if knob.form == "shift" else knob.value)
        for name, component in knob.paths:
            stated = machine.parameters[name].sd
            known = stated if isinstance(stated, tuple) else (stated or 0.0,)
            deviations.setdefault(name, list(known))[max(component, 0)] = sd
    tests = f"campaign {calibration.campaign}: {', '.join(calibration.tests)}"
    source = f"calibrated from {tests}" if calibration.converged else f"fit that did not converge, from {tests}"
    entries: dict[str, Quantity] = {}
    for name, value in values.items():
        spread: tuple[float, ...] | float | None = None
        origin = f"cut to leave oil in the chamber found, not measured itself; {source}"  # a stroke
        if name in deviations:
            origin = source
            if calibration.converged:
                spread = tuple(deviations[name]) if isinstance(value, list) else deviations[name][0]
        number = tuple(value) if isinstance(value, list) else value
        entries[name] = Quantity(number, machine.parameters[name].unit, "calibrated", origin, spread)
    for name, quantity in machine.parameters.items():
        earlier = quantity.evidence in ("override", "calibrated") and not name.endswith(".valves")  # those of the tests
        if earlier and name not in entries:
            entries[name] = replace(quantity, printed=None)
    groups: dict[str, list[str]] = {}
    for name, quantity in entries.items():
        section, key = section_of(machine, name)
        groups.setdefault(section, []).append(f"{key} = {quantity_toml(quantity)}")
    title = " ".join(f"Numbers of {machine.name}, {source}.".split())  # on one line
    about = "sd is the predicted standard deviation."
    if not calibration.converged:
        about = "They are where the fit stopped; nothing says how far off they are, so no sd is given."
    with write_whole(path) as beside:
        text = sections_toml([title, about], groups)
        beside.write_text(text, encoding="utf-8")
    return path
