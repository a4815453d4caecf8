"""Whether a target lies within what the table can do, and the scale at which it would."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, Context
from typing import NamedTuple

import numpy as np

from ..core.errors import OutOfRangeError
from .motion import AXES
from .process import Target

__all__ = ["LegCheck", "LegUtilisation", "LimitsSummary", "MotionLimits", "check_limits", "largest_scale"]

_QUANTITIES = ("displacement", "velocity", "acceleration")
_FULL = 1 + 1e-6  # a motion at exactly the limit passes whatever its rounding


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Largest magnitudes of the target by axis; infinity where there is none."""

    displacement: np.ndarray  # (6,) [m, rad]
    velocity: np.ndarray  # (6,) [m/s, rad/s]
    acceleration: np.ndarray  # (6,) [m/s^2, rad/s^2]

    def __post_init__(self) -> None:
        """Store arrays and refuse limits that are no limits."""
        for quantity in _QUANTITIES:
            values = np.array(getattr(self, quantity), dtype=float)
            if values.shape != (len(AXES),) or not (values > 0).all():
                raise ValueError(f"limits of {quantity} are {values}; give six positive numbers")
            values.flags.writeable = False
            object.__setattr__(self, quantity, values)


class LegUtilisation(NamedTuple):
    """How much of each actuator a motion needs, as parts of what it has; above 1 is too much."""

    velocity: np.ndarray  # (n, n_legs) leg velocity over the velocity its valves can feed
    names: Sequence[str]  # (n_legs,)
    stroke: np.ndarray  # (n, n_legs) elongation over half stroke


LegCheck = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, Sequence[str], np.ndarray]]
"""From displacement and velocity (n, 6) to a `LegUtilisation` (or a plain tuple in its order)."""


@dataclass(frozen=True)
class LimitsSummary:
    """Largest part used of each limit, by quantity (or "leg velocity", "leg stroke"), then axis or leg."""

    utilisation: dict[str, dict[str, float]]

    @property
    def highest(self) -> tuple[str, str, float]:
        """Quantity, axis or leg, and value of the highest utilisation."""
        return max(
            ((quantity, name, value) for quantity, row in self.utilisation.items() for name, value in row.items()),
            key=lambda item: item[2],
        )


class _Peak(NamedTuple):
    quantity: str
    name: str
    utilisation: float
    sample: int
    text: str  # value against limit


def check_limits(target: Target, limits: MotionLimits, leg_check: LegCheck | None = None) -> LimitsSummary:
    """Utilisation of the table by a target.

    `leg_check` adds the actuators' strokes and the flow of their valves. Raises OutOfRangeError with the largest
    scale that would fit, then a clause for each quantity exceeded, axes before legs: the worst axis or leg with
    its value against the limit, time and sample, and the names of the others beyond theirs.
    """
    peaks = _axis_peaks(target, limits) + (_leg_peaks(target, leg_check, 1.0) if leg_check else [])
    over = [peak for peak in peaks if peak.utilisation > _FULL]
    if over:
        fits = largest_scale(target, limits, leg_check)
        raise OutOfRangeError(
            f"{target.reference.motion} at scale {target.reference.scale:g} is more than the table can give. "
            f"The largest scale that fits is {fits:g}; beyond the limits: {'; '.join(_clauses(over, target.time))}",
            fits,
        )
    utilisation: dict[str, dict[str, float]] = {}
    for peak in peaks:
        utilisation.setdefault(peak.quantity, {})[peak.name] = peak.utilisation
    return LimitsSummary(utilisation)


def largest_scale(target: Target, limits: MotionLimits, leg_check: LegCheck | None = None) -> float:
    """Largest scale of the target's motion within all limits, rounded down to three digits.

    Infinity for a target that does not move, or less than a floating-point number can resolve. Leg lengths are
    not linear in the pose, so with `leg_check` the scale is found by bisection below the one the axes allow.
    """
    highest = max(peak.utilisation for peak in _axis_peaks(target, limits))
    if highest < np.finfo(float).tiny:
        return float("inf")
    factor = 1 / highest
    if leg_check is not None:

        def too_much(trial: float) -> bool:
            return max(peak.utilisation for peak in _leg_peaks(target, leg_check, trial)) > _FULL

        if too_much(factor):
            low, high = 0.0, factor
            while high - low > 1e-4 * high:
                middle = (low + high) / 2
                low, high = (low, middle) if too_much(middle) else (middle, high)
            factor = low
    return _round_down(factor * abs(target.reference.scale))


def _clauses(over: Sequence[_Peak], time: np.ndarray) -> list[str]:
    """One clause for each quantity: its worst axis or leg in full, the others by name; axes before legs."""
    ranked = sorted(over, key=lambda peak: (peak.quantity not in _QUANTITIES, -peak.utilisation))
    groups: dict[str, list[_Peak]] = {}
    for peak in ranked:
        groups.setdefault(peak.quantity, []).append(peak)
    clauses = []
    for quantity, (worst, *others) in groups.items():
        where = f"at t = {time[worst.sample]:.3f} s (sample {worst.sample})"
        also = f", also {', '.join(peak.name for peak in others)}" if others else ""
        clauses.append(f"{worst.name} {quantity} {worst.text} {where}{also}")
    return clauses


def _axis_peaks(target: Target, limits: MotionLimits) -> list[_Peak]:
    peaks = []
    for quantity in _QUANTITIES:
        values = np.abs(getattr(target, quantity))
        for i, axis in enumerate(AXES):
            sample = int(np.argmax(values[:, i]))
            value, limit = float(values[sample, i]), float(getattr(limits, quantity)[i])
            unit = _unit(quantity, rotation=i >= 3)
            text = f"{value:.4g} {unit} against {limit:.4g} {unit}"
            peaks.append(_Peak(quantity, axis, value / limit, sample, text))
    return peaks


def _leg_peaks(target: Target, leg_check: LegCheck, factor: float) -> list[_Peak]:
    with np.errstate(all="ignore"):  # a pose too far away to have a leg length is beyond every stroke: infinite
        velocity, names, stroke = leg_check(factor * target.displacement, factor * target.velocity)
    peaks = []
    for quantity, shares, of in (
        ("leg velocity", velocity, "of what its valves can give"),
        ("leg stroke", stroke, "of its stroke"),
    ):
        values = np.nan_to_num(np.abs(shares), nan=np.inf, posinf=np.inf)
        for i, name in enumerate(names):
            sample = int(np.argmax(values[:, i]))
            value = float(values[sample, i])
            share = f"{100 * value:.4g} %" if np.isfinite(value) else "a countless multiple"
            peaks.append(_Peak(quantity, name, value, sample, f"{share} {of}"))
    return peaks


def _unit(quantity: str, rotation: bool) -> str:
    length = "rad" if rotation else "m"
    return {"displacement": length, "velocity": f"{length}/s", "acceleration": f"{length}/s^2"}[quantity]


def _round_down(value: float) -> float:
    """Three significant digits, never above `value` by more than rounding."""
    return float(Context(prec=3, rounding=ROUND_DOWN).create_decimal(value * _FULL))
