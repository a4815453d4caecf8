"""The override file of a calibration: calibrated numbers with their source."""

from dataclasses import replace
from pathlib import Path

from ...core.files import write_whole
from ...machine.machine_toml import quantity_toml, section_of, sections_toml
from ...machine.parameters import Quantity
from .free_parameters import parameter_changes
from .result import Calibration, verdict_on

__all__ = ["save_override"]


def save_override(calibration: Calibration, path: Path) -> Path:
    """Write the calibrated numbers as a TOML file for `--override`, whole or not at all.

    Poorly identified parameters are written as well, since they are correlated with the others; so are numbers
    from an earlier override. A number's standard deviation is the predicted one; a fit that did not converge
    writes none, and the machine file's remains in force.
    """
    machine, count = calibration.machine, len(calibration.parameters)
    values = parameter_changes(machine, calibration.parameters, calibration.estimate[:count])
    deviations: dict[str, list[float]] = {}
    stopped: set[str] = set()  # numbers at a bound, which are no estimates
    for i, parameter in enumerate(calibration.parameters):
        sd = float(calibration.sd[i]) * (1.0 if parameter.form == "shift" else parameter.value)
        if verdict_on(calibration, i) == "at its bound":
            stopped |= {name for name, _ in parameter.paths}
        for name, component in parameter.paths:
            stated = machine.parameters[name].sd
            known = stated if isinstance(stated, tuple) else (stated or 0.0,)
            deviations.setdefault(name, list(known))[max(component, 0)] = sd
    tests = f"campaign {calibration.campaign}: {', '.join(calibration.tests)}"
    source = f"calibrated from {tests}" if calibration.converged else f"fit that did not converge, from {tests}"
    entries: dict[str, Quantity] = {}
    for name, value in values.items():
        spread: tuple[float, ...] | float | None = None
        origin = f"reduced to the length of the identified chamber, not measured itself; {source}"  # a stroke
        if name in deviations:
            origin = source
            if calibration.converged:
                spread = tuple(deviations[name]) if isinstance(value, list) else deviations[name][0]
        number, evidence = tuple(value) if isinstance(value, list) else value, "calibrated"
        if name in stopped:
            evidence, origin = "at_bound", f"at the bound of its range, no estimate; {origin}"
        entries[name] = Quantity(number, machine.parameters[name].unit, evidence, origin, spread)
    for name, quantity in machine.parameters.items():
        earlier = quantity.evidence in ("override", "calibrated", "at_bound") and not name.endswith(
            ".valves"
        )  # those of the tests
        if earlier and name not in entries:
            entries[name] = replace(quantity, printed=None)
    groups: dict[str, list[str]] = {}
    for name, quantity in entries.items():
        section, key = section_of(machine, name)
        groups.setdefault(section, []).append(f"{key} = {quantity_toml(quantity)}")
    title = " ".join(f"Numbers of {machine.name}, {source}.".split())  # on one line
    about = "sd is the predicted standard deviation."
    if not calibration.converged:
        about = "The fit did not converge: these are the values of its last step, without standard deviations."
    with write_whole(path) as beside:
        text = sections_toml([title, about], groups)
        beside.write_text(text, encoding="utf-8")
    return path
