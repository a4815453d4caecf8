"""Blocks shared by reports: machine and load, controller settings, assumptions, numbers used."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...control import ControllerSettings
from ...core.names import AXES
from ...machine.machine import Machine
from ...machine.parameters import Quantity
from ...tuning.identify import tuning_numbers
from .page import Block, Table, bullet_list, details, number
from .plots import palette

__all__ = ["AXIS_LINES", "DEFAULTS", "assumed_in", "assumption_blocks", "gain_table", "load_of", "loop_sentence"]
__all__ += ["numbers_used"]

AXIS_LINES = dict(zip(AXES, palette(len(AXES)), strict=True))
"""Line style of each axis in plots of several."""

DEFAULTS = "Numbers used unless an option replaces them"


def load_of(machine: Machine) -> str:
    """Return the machine and its load as text."""
    specimen = machine.specimen
    return f"{machine.name}, {f'specimen {specimen.name}' if specimen else 'bare table'}"


def loop_sentence(facts: Mapping[str, Any]) -> tuple[str, bool]:
    """Return the sentence on a control loop that is not stable, or thinly, empty for others; and if it is unstable.

    facts: the attributes `loop`, `loop_summary` and `loop_remedy` of a record, as far as they are known.
    """
    loop = str(facts.get("loop", "stable"))
    if loop == "stable":
        return "", False
    remedy = f" (mend it by “{facts['loop_remedy']}”)" if "loop_remedy" in facts else ""
    return f"{facts.get('loop_summary', f'The control loop is {loop}')}{remedy}.", loop == "unstable"


def _gains_of(settings: ControllerSettings) -> dict[str, tuple[float, ...]]:
    """Return the settings per degree of freedom, in the order of the panel, and the notches in use."""
    found = {name: value for name, value in vars(settings).items() if isinstance(value, tuple) and name != "notches"}
    for k, notch in enumerate(settings.notches, 1):
        if any(notch.depth):
            found |= {f"notch_{k}.{name}": value for name, value in vars(notch).items()}
    return found


def gain_table(before: ControllerSettings, after: ControllerSettings, axes: Sequence[str]) -> list[Block]:
    """Return the settings that changed, per axis; unchanged ones collapsed."""
    changed, kept = [], []
    old, new = _gains_of(before), _gains_of(after)
    for name, values in new.items():
        pairs = [(old.get(name, (np.nan,) * len(AXES))[k], values[k]) for k in map(AXES.index, axes)]
        label = name.replace("_", " ")
        if any(a != b for a, b in pairs):
            changed.append((label, *(f"{number(a)} → {number(b)}" if a != b else number(b) for a, b in pairs)))
        else:
            kept.append((label, *(number(b) for _, b in pairs)))
    for name in ("rate", "spool_limit", "force_cut_in", "balance_gain"):
        kept.append((name.replace("_", " "), number(getattr(after, name))))
    header = ("Setting", *axes)
    first = Table("Changed, SI", header, changed) if changed else "No setting changed."
    return [first, details(f"Unchanged ({len(kept)})", Table("Unchanged, SI", header, kept))]


def assumption_blocks(machine: Machine, sections: Sequence[str]) -> list[Block]:
    """Return the numbers of `tuning.toml` used, by section or dotted name, and how many numbers are assumed."""
    used = {p: q for p, q in tuning_numbers().items() if p in sections or p.split(".")[0] in sections}
    guessed = sum(q.assumed for q in used.values())
    return [
        bullet_list([f"{guessed} of the {len(used)} numbers below are assumed, not published.", assumed_in(machine)]),
        numbers_used(used, DEFAULTS),
    ]


def assumed_in(machine: Machine) -> str:
    """Return the sentence on the assumed numbers of a machine."""
    guessed, total = sum(q.assumed for q in machine.parameters.values()), len(machine.parameters)
    return f"{guessed} of the {total} numbers of {machine.name} are assumed; “lhpost6 info” lists them."


def numbers_used(stated: Mapping[str, Quantity], caption: str = "Numbers used") -> Table:
    """Return the table of stated numbers with unit, evidence and source."""
    rows = []
    for path, q in stated.items():
        values = ", ".join(f"{v:g}" for v in np.atleast_1d(q.value))
        shown = q.printed or f"{values}{f' {q.unit}' if q.unit != '1' else ''}"
        rows.append((path, shown, q.evidence, q.source.replace("`", "")))
    return Table(caption, ("Number", "Value", "Evidence", "Source"), rows)
