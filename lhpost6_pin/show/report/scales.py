"""How quantities are shown: units, scales, and numbers as text."""

from dataclasses import dataclass

import numpy as np
from scipy.constants import g

from .page import number

__all__ = [
    "ROTATIONS",
    "SCALES",
    "Scale",
    "axis_scale",
    "axis_title",
    "decibels",
    "degrees",
    "force_scale",
    "load_scale",
    "late_or_ahead",
    "milliseconds",
    "percent",
    "scaled_number",
    "shown_as",
    "signed",
]

DIRECTIONS = {"x": "longitudinal", "y": "transverse", "z": "vertical"}
ROTATIONS = ("roll", "pitch", "yaw")


ROUND_OFF = 1e-11
"""In the unit shown: what is smaller is round-off of a sum that should be zero, and shown as 0."""


@dataclass(frozen=True)
class Scale:
    """How an SI quantity is shown: shown value = SI value times `factor`, in `unit`."""

    factor: float
    unit: str
    round_off: float = ROUND_OFF  # in `unit`


SCALES: dict[str, Scale] = {
    "displacement": Scale(1e3, "mm"),
    "velocity": Scale(1.0, "m/s"),
    "acceleration": Scale(1.0 / g, "g"),
    "rotation": Scale(180.0 / np.pi, "deg"),
    "rotation velocity": Scale(180.0 / np.pi, "deg/s"),
    "rotation acceleration": Scale(180.0 / np.pi, "deg/s²"),
    "force": Scale(1e-6, "MN"),
    "moment": Scale(1e-6, "MN m"),
    "pressure": Scale(1e-6, "MPa"),
    "ratio": Scale(1.0, "1"),
}


def axis_scale(axis: str, quantity: str) -> Scale:
    """Return how a quantity of the motion of an axis is shown."""
    if axis not in ROTATIONS:
        return SCALES[quantity]
    return SCALES["rotation" if quantity == "displacement" else f"rotation {quantity}"]


def force_scale(axis: str) -> Scale:
    """Return how the force, or moment, of an axis is shown."""
    return Scale(1e-3, "kN m" if axis in ROTATIONS else "kN", 1e-9)  # below 1 uN, 1 uN m: of forces of some kN


SMALL_LOAD = 1e5
"""Force [N] or moment [N m] below which the largest of a table is shown in thousands, not in millions."""


def load_scale(quantity: str, largest: float) -> Scale:
    """Return how forces or moments ("force", "moment") of a table are shown, the largest [N, N m] of which is given."""
    scale = SCALES[quantity]
    if not largest < SMALL_LOAD:
        return scale
    return Scale(1e3 * scale.factor, scale.unit.replace("MN", "kN"), 1e3 * scale.round_off)


def axis_title(axis: str) -> str:
    """Return the heading of an axis."""
    return f"Axis {axis} ({DIRECTIONS[axis]})" if axis in DIRECTIONS else f"Axis {axis}"


def percent(fraction: float) -> str:
    """Return a share in per cent; an en dash where it is not finite."""
    return f"{_visible(100 * fraction)}\N{NO-BREAK SPACE}%" if np.isfinite(fraction) else "–"


def shown_as(value: float, scale: Scale) -> str:
    """Return an SI value in the unit it is shown in."""
    return f"{scaled_number(value, scale)}\N{NO-BREAK SPACE}{scale.unit}"


def scaled_number(value: float, scale: Scale) -> str:
    """Return an SI value as a number in the unit it is shown in."""
    return _visible(value * scale.factor, scale.round_off)


def _visible(value: float, round_off: float = ROUND_OFF) -> str:
    return number(0.0 if abs(value) < round_off else value)


def milliseconds(seconds: float) -> str:
    """Return a time [s] in milliseconds."""
    return shown_as(seconds, Scale(1e3, "ms"))


def late_or_ahead(delay: float) -> str:
    """Return a delay [s] in words: of a motion behind its target, or if it is negative, ahead of it; or none."""
    if np.isnan(delay):
        return "no single delay"
    return f"delay {milliseconds(delay)}" if not delay < 0.0 else f"{milliseconds(-delay)} ahead of the target"


def signed(value: float, digits: int) -> str:
    """Return a number with its sign, none on a rounded zero; an en dash where it is not finite."""
    if not np.isfinite(value):
        return "–"
    value = round(value, digits) + 0.0  # no negative zero
    return f"{value:{'+' if value else ''}.{digits}f}".replace("-", "−")


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
