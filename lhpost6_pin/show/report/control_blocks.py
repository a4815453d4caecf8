"""Blocks shared by reports: machine and load, controller settings, assumptions, numbers used."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...control import ControllerSettings
from ...core.names import AXES
from ...machine.machine import Machine
from ...machine.parameters import Quantity
from ...tuning.identify import tuning_numbers
from .page import Markup, bullet_list, details, number, paragraph, table
from .plots import palette
from .run_motion import DIRECTIONS

__all__ = ["AXIS_LINES", "DEFAULTS", "assumed_in", "assumption_blocks", "axis_title", "decibels", "degrees"]
__all__ += ["gain_table", "gains_of", "load_of", "numbers_used"]

AXIS_LINES = dict(zip(AXES, palette(len(AXES)), strict=True))
"""Line style of each axis in plots of several."""

DEFAULTS = "Numbers used unless an option replaces them"


def load_of(machine: Machine) -> str:
    """Return the machine and its load as text."""
    specimen = machine.specimen
    return f"{machine.name}, {f'specimen {specimen.name}' if specimen else 'bare table'}"


def axis_title(axis: str) -> str:
    """Return the heading of an axis."""
    return f"Axis {axis} ({DIRECTIONS[axis]})" if axis in DIRECTIONS else f"Axis {axis}"


def decibels(factor: float, *, sign: bool = False) -> str:
    """Return a factor in dB; "∞" for infinity, an en dash for not-a-number."""
    if np.isposinf(factor):
        return "∞"
    value = 20.0 * np.log10(factor) if factor > 0.0 else np.nan
    if not np.isfinite(value):
        return "–"
    value = round(value, 1) + 0.0  # no negative zero
    return f"{value:{'+' if sign else ''}.1f}\N{NO-BREAK SPACE}dB".replace("-", "−")


def degrees(angle: float) -> str:
    """Return an angle [rad] in degrees; "∞" for infinity, an en dash for not-a-number."""
    if np.isposinf(angle):
        return "∞"
    return f"{number(float(np.degrees(angle)))}°" if np.isfinite(angle) else "–"


def gains_of(settings: ControllerSettings) -> dict[str, tuple[float, ...]]:
    """Return the settings per degree of freedom, in the order of the panel, and the notches in use."""
    found = {name: value for name, value in vars(settings).items() if isinstance(value, tuple) and name != "notches"}
    for k, notch in enumerate(settings.notches, 1):
        if any(notch.depth):
            found |= {f"notch_{k}.{name}": value for name, value in vars(notch).items()}
    return found


def gain_table(before: ControllerSettings, after: ControllerSettings, axes: Sequence[str]) -> list[Markup]:
    """Return the settings that changed, per axis; unchanged ones collapsed."""
    changed, kept = [], []
    old, new = gains_of(before), gains_of(after)
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
    blocks = [table("Changed, SI", header, changed)] if changed else [paragraph("No setting changed.")]
    return [*blocks, details(f"Unchanged ({len(kept)})", table("Unchanged, SI", header, kept))]


def assumption_blocks(machine: Machine, sections: Sequence[str]) -> list[Markup]:
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


def numbers_used(stated: Mapping[str, Quantity], caption: str = "Numbers used") -> Markup:
    """Return the table of stated numbers with unit, evidence and source."""
    rows = []
    for path, q in stated.items():
        values = ", ".join(f"{v:g}" for v in np.atleast_1d(q.value))
        shown = q.printed or f"{values}{f' {q.unit}' if q.unit != '1' else ''}"
        rows.append((path, shown, q.evidence, q.source.replace("`", "")))
    return table(caption, ("Number", "Value", "Evidence", "Source"), rows)
