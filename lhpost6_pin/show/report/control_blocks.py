"""Blocks that the reports of the control tools share: what was controlled, settings, assumptions."""

from collections.abc import Sequence

import numpy as np

from ...control import ControllerSettings
from ...core.names import AXES
from ...machine.machine import Machine
from ...machine.parameters import Value
from ...tuning.identify import tuning_numbers
from .page import Markup, bullet_list, details, number, paragraph, table
from .plots import palette
from .run_motion import DIRECTIONS

__all__ = ["AXIS_LINES", "assumption_blocks", "axis_title", "decibels", "degrees", "gain_table", "gains_of", "load_of"]

AXIS_LINES = dict(zip(AXES, palette(len(AXES)), strict=True))
"""Line of each axis where several share a plot."""


def load_of(machine: Machine) -> str:
    """Return the machine and what stands on it, in words."""
    specimen = machine.specimen
    return f"{machine.name}, {f'specimen {specimen.name}' if specimen else 'bare table'}"


def axis_title(axis: str) -> str:
    """Return the heading of what is shown of one axis."""
    return f"Axis {axis} ({DIRECTIONS[axis]})" if axis in DIRECTIONS else f"Axis {axis}"


def decibels(factor: float, *, sign: bool = False) -> str:
    """Return a factor in dB; "∞" for one without bound, an en dash for no number."""
    if np.isposinf(factor):
        return "∞"
    value = 20.0 * np.log10(factor) if factor > 0.0 else np.nan
    if not np.isfinite(value):
        return "–"
    value = round(value, 1) + 0.0  # no negative zero
    return f"{value:{'+' if sign else ''}.1f}\N{NO-BREAK SPACE}dB".replace("-", "−")


def degrees(angle: float) -> str:
    """Return an angle [rad] in degrees; "∞" for one without bound, an en dash for no number."""
    if np.isposinf(angle):
        return "∞"
    return f"{number(float(np.degrees(angle)))}°" if np.isfinite(angle) else "–"


def gains_of(settings: ControllerSettings) -> dict[str, tuple[float, ...]]:
    """Return the numbers of a panel that are per degree of freedom, in its order; depths of notches in use."""
    found = {name: value for name, value in vars(settings).items() if isinstance(value, tuple) and name != "notches"}
    for k, notch in enumerate(settings.notches, 1):
        if any(notch.depth):
            found |= {f"notch_{k}.{name}": value for name, value in vars(notch).items()}
    return found


def gain_table(before: ControllerSettings, after: ControllerSettings, axes: Sequence[str]) -> list[Markup]:
    """Return what changed from one panel to another, per axis, and what stayed folded away."""
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
    return [*blocks, details(f"Kept as they were ({len(kept)})", table("Kept, SI", header, kept))]


def assumption_blocks(machine: Machine, sections: Sequence[str]) -> list[Markup]:
    """Return the numbers of `tuning.toml` that were used, whole sections or single ones, with evidence and source."""
    numbers = tuning_numbers()
    rows = [
        (
            path,
            q.printed or f"{_shown(q.value)}{f' {q.unit}' if q.unit != '1' else ''}",
            q.evidence,
            q.source.replace("`", ""),
        )
        for path, q in numbers.items()
        if path in sections or path.split(".")[0] in sections
    ]
    guessed = sum(evidence == "assumed" for _, _, evidence, _ in rows)
    doubt = sum(q.assumed for q in machine.parameters.values())
    said = bullet_list(
        [
            f"{guessed} of the {len(rows)} numbers below are assumed: nobody has published them.",
            f"{doubt} of the {len(machine.parameters)} numbers of {machine.name} are assumed as well; "
            "“lhpost6 info” lists them.",
        ]
    )
    caption = "Numbers used, where the command gives no other"
    return [said, table(caption, ("Number", "Value", "Evidence", "Source"), rows)]


def _shown(value: Value) -> str:
    return ", ".join(f"{v:g}" for v in np.atleast_1d(value))
