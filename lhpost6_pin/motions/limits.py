"""Demand of a target over the capacity of the table, and the largest scale within it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, Context
from typing import NamedTuple

import numpy as np

from ..core.errors import OutOfRangeError
from .motion import AXES
from .process import Target

__all__ = ["ActuatorCheck", "ActuatorUtilisation", "LimitsSummary", "MotionLimits", "check_limits", "largest_scale"]

_QUANTITIES = ("displacement", "velocity", "acceleration")
_FULL = 1 + 1e-6  # a motion exactly at the limit passes despite rounding


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Largest magnitudes of the target by axis; infinity where there is none."""

    displacement: np.ndarray  # (6,) [m, rad]
    velocity: np.ndarray  # (6,) [m/s, rad/s]
    acceleration: np.ndarray  # (6,) [m/s^2, rad/s^2]

    def __post_init__(self) -> None:
        """Convert to read-only arrays; raises ValueError unless all are positive."""
        for quantity in _QUANTITIES:
            values = np.array(getattr(self, quantity), dtype=float)
            if values.shape != (len(AXES),) or not (values > 0).all():
                raise ValueError(f"limits of {quantity} are {values}; give six positive numbers")
            values.flags.writeable = False
            object.__setattr__(self, quantity, values)


class ActuatorUtilisation(NamedTuple):
    """Demand of a motion over capacity, by actuator; above 1 it exceeds the capacity."""

    velocity: np.ndarray  # (n, n_actuators) velocity over that of the unloaded piston at full spool
    names: Sequence[str]  # (n_actuators,)
    stroke: np.ndarray  # (n, n_actuators) elongation over half stroke


ActuatorCheck = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, Sequence[str], np.ndarray]]
"""From displacement and velocity (n, 6) to an `ActuatorUtilisation` (or a tuple in its order)."""


@dataclass(frozen=True)
class LimitsSummary:
    """Demand over capacity by quantity ("actuator velocity" and "actuator stroke" included), then axis or actuator."""

    utilisation: dict[str, dict[str, float]]

    @property
    def highest(self) -> tuple[str, str, float]:
        """Quantity, axis or actuator, and value of the governing utilisation."""
        rows = ((quantity, name, value) for quantity, row in self.utilisation.items() for name, value in row.items())
        return max(rows, key=lambda item: item[2])


class _Peak(NamedTuple):
    quantity: str
    name: str
    utilisation: float
    sample: int
    text: str  # value against limit


def check_limits(target: Target, limits: MotionLimits, actuator_check: ActuatorCheck | None = None) -> LimitsSummary:
    """Utilisation of the table by a target.

    `actuator_check` adds the actuators' strokes and the flow of their valves. Raises OutOfRangeError with the largest
    scale within the limits, then a clause per exceeded quantity, axes before actuators: the governing one with its
    value, limit, time and sample, and the names of the others.
    """
    peaks = _axis_peaks(target, limits) + (_actuator_peaks(target, actuator_check, 1.0) if actuator_check else [])
    over = [peak for peak in peaks if peak.utilisation > _FULL]
    if over:
        fits = largest_scale(target, limits, actuator_check)
        raise OutOfRangeError(
            f"{target.reference.motion} at scale {target.reference.scale:g} exceeds the capacity of the table. "
            f"The largest scale that fits is {fits:g}; exceeded: {'; '.join(_clauses(over, target.time))}",
            fits,
        )
    utilisation: dict[str, dict[str, float]] = {}
    for peak in peaks:
        utilisation.setdefault(peak.quantity, {})[peak.name] = peak.utilisation
    return LimitsSummary(utilisation)


def largest_scale(target: Target, limits: MotionLimits, actuator_check: ActuatorCheck | None = None) -> float:
    """Largest scale of the target's motion within all limits, rounded down to three digits.

    Infinity for a target at rest (or below floating-point resolution). Actuator lengths are not linear in the pose:
    with `actuator_check` the scale is found by bisection below that of the axes.
    """
    highest = max(peak.utilisation for peak in _axis_peaks(target, limits))
    if highest < np.finfo(float).tiny:
        return float("inf")

    def exceeds(trial: float) -> bool:
        peaks = _actuator_peaks(target, actuator_check, trial) if actuator_check else []
        return any(peak.utilisation > _FULL for peak in peaks)

    factor = 1 / highest
    if exceeds(factor):
        low, high = 0.0, factor
        while high - low > 1e-4 * high:
            middle = (low + high) / 2
            low, high = (low, middle) if exceeds(middle) else (middle, high)
        factor = low
    return _round_down(factor * abs(target.reference.scale))


def _clauses(over: Sequence[_Peak], time: np.ndarray) -> list[str]:
    """One clause per quantity: its governing axis or actuator in full, the others by name; axes first."""
    groups: dict[str, list[_Peak]] = {}
    for peak in sorted(over, key=lambda peak: (peak.quantity not in _QUANTITIES, -peak.utilisation)):
        groups.setdefault(peak.quantity, []).append(peak)
    clauses = []
    for quantity, (worst, *others) in groups.items():
        where = f"at t = {time[worst.sample]:.3f} s (sample {worst.sample})"
        also = f", also {', '.join(peak.name for peak in others)}" if others else ""
        clauses.append(f"{worst.name} {quantity} {worst.text} {where}{also}")
    return clauses


def _axis_peaks(target: Target, limits: MotionLimits) -> list[_Peak]:
    peaks = []
    for quantity, per in zip(_QUANTITIES, ("", "/s", "/s^2"), strict=True):
        values = np.abs(getattr(target, quantity))
        for i, axis in enumerate(AXES):
            sample = int(np.argmax(values[:, i]))
            value, limit = float(values[sample, i]), float(getattr(limits, quantity)[i])
            unit = ("m" if i < 3 else "rad") + per
            peaks.append(_Peak(quantity, axis, value / limit, sample, f"{value:.4g} {unit} against {limit:.4g} {unit}"))
    return peaks


def _actuator_peaks(target: Target, actuator_check: ActuatorCheck, factor: float) -> list[_Peak]:
    with np.errstate(all="ignore"):  # a pose beyond all reach exceeds every stroke: infinite
        velocity, names, stroke = actuator_check(factor * target.displacement, factor * target.velocity)
    peaks = []
    for quantity, shares, of in (
        ("actuator velocity", velocity, "of the unloaded velocity of its valves"),
        ("actuator stroke", stroke, "of its stroke"),
    ):
        values = np.nan_to_num(np.abs(shares), nan=np.inf, posinf=np.inf)
        for i, name in enumerate(names):
            sample = int(np.argmax(values[:, i]))
            value = float(values[sample, i])
            share = f"{100 * value:.4g} %" if np.isfinite(value) else "infinitely many times"
            peaks.append(_Peak(quantity, name, value, sample, f"{share} {of}"))
    return peaks


def _round_down(value: float) -> float:
    """Three significant digits, never above `value` by more than rounding."""
    return float(Context(prec=3, rounding=ROUND_DOWN).create_decimal(value * _FULL))
