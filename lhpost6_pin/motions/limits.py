"""Demand of a target over the capacity of the table, and the largest scale within it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple, Protocol

import numpy as np

from ..core.errors import OutOfRangeError
from ..core.rounding import rounded_down
from ..core.threads import by_threads, row_blocks
from .motion import AXES
from .process import Target

__all__ = ["SI", "Demand", "LimitsSummary", "MotionCheck", "MotionLimits", "Peak", "Units", "check_limits"]
__all__ += ["largest_scale", "less_reserve", "limit_peaks"]

_QUANTITIES = ("displacement", "velocity", "acceleration")
_FULL = 1 + 1e-6  # a motion exactly at the limit passes despite rounding
_CLOSE = 1e-4  # relative width to which the largest scale is bracketed
_STRIDE = 8  # samples of which one is looked at first: 4 ms of a target, within which its demands hardly change
_GOVERNING = 0.5  # of the largest share: samples with as much are looked at first, as demands are nearly linear


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Largest magnitudes of the target by axis; infinity where there is none."""

    displacement: np.ndarray  # (6,) [m, rad]
    velocity: np.ndarray  # (6,) [m/s, rad/s]
    acceleration: np.ndarray  # (6,) [m/s^2, rad/s^2]
    rise: float | None = None  # acceleration of z upwards [m/s^2], where it differs
    reserve: float = 0.0  # share of the displacements that is kept for overshoot

    def __post_init__(self) -> None:
        """Convert to read-only arrays; raises ValueError unless all are positive."""
        for quantity in _QUANTITIES:
            values = np.array(getattr(self, quantity), dtype=float)
            if values.shape != (len(AXES),) or not (values > 0).all():
                raise ValueError(f"limits of {quantity} are {values}; give six positive numbers")
            values.flags.writeable = False
            object.__setattr__(self, quantity, values)


class Demand(NamedTuple):
    """Demand of a motion on one kind of capacity, by axis, actuator or part."""

    quantity: str  # such as "actuator velocity"
    names: Sequence[str]  # (m,)
    share: np.ndarray  # (n, m) demand over capacity, signed or not; above 1 it exceeds the capacity
    of: str  # what the capacity is, after "37 %"
    value: np.ndarray | None = None  # (n, m) demand in SI
    unit: str = ""  # of `value`, where a peak states it in words
    decides: bool = True  # whether a motion beyond it is refused


def less_reserve(share: float) -> str:
    """What follows the name of a capacity of which a share is kept; empty without one."""
    return f" less the reserve of {100 * share:g} %" if share else ""


MotionCheck = Callable[[np.ndarray, np.ndarray, np.ndarray], Sequence[Demand]]
"""From displacement, velocity and acceleration (n, 6) of a motion to its demands on a table, sample by sample."""

PartCheck = Callable[[slice], Sequence[Demand]]
"""From consecutive samples of a motion to their demands on a table."""


Units = Mapping[str, tuple[str, float]]
"""From an SI unit of a text, such as "rad/s^2", to the unit in its place and the factor to it; others stay in SI."""

SI: Units = {}


class Motion(Protocol):
    """A motion of C and Euler angles, such as a target or what was achieved; each (n, 6)."""

    @property
    def displacement(self) -> np.ndarray: ...
    @property
    def velocity(self) -> np.ndarray: ...
    @property
    def acceleration(self) -> np.ndarray: ...


class Peak(NamedTuple):
    """The largest demand of a motion on one limit."""

    quantity: str
    name: str
    utilisation: float
    sample: int
    text: str  # value against limit
    decides: bool = True
    value: float | None = None  # demand in SI, where it is known


@dataclass(frozen=True)
class LimitsSummary:
    """Demand over capacity by quantity, then axis, actuator or part; each peak with its value and sample."""

    utilisation: dict[str, dict[str, float]]
    peaks: tuple[Peak, ...] = ()

    @property
    def highest(self) -> tuple[str, str, float]:
        """Quantity, axis or actuator, and value of the governing utilisation."""
        rows = [(p.quantity, p.name, p.utilisation) for p in self.peaks if p.decides]
        return max(rows, key=lambda item: item[2])

    @property
    def of_axes(self) -> float:
        """Largest share of an axis's displacement, velocity or acceleration."""
        return max(share for quantity in _QUANTITIES for share in self.utilisation[quantity].values())


def check_limits(
    target: Target,
    limits: MotionLimits,
    check: MotionCheck | None = None,
    units: Units = SI,
    size: Callable[[float], str] | None = None,
) -> LimitsSummary:
    """Utilisation of the table by a target.

    `check` adds demands on actuators and parts; texts are in `units`. Raises OutOfRangeError with the largest scale
    within the limits, then a clause per exceeded quantity, axes before actuators: the governing one with its value,
    limit, time and sample, and the names of the others. Of a target that has no scale for its user, `size` gives
    the words behind "The largest" for a scale, as "--amplitude that fits is 0.36m".
    """
    peaks = limit_peaks(target, limits, _parts_of(target, check) if check else None, units)
    over = [peak for peak in peaks if peak.decides and peak.utilisation > _FULL]
    if over:
        fits = largest_scale(target, limits, check)
        if check is not None and fits == 0.0:
            raise _beyond_at_rest(target.reference.motion, _over_at_rest(target, limits, check, units))
        name = target.reference.title if size is None else target.reference.motion
        largest = f"scale that fits is {fits:g}" if size is None else size(fits)
        raise OutOfRangeError(
            f"{name} exceeds the capacity of the table. The largest {largest}; exceeded: "
            f"{'; '.join(_clauses(over, target.time))}",
            fits,
            tuple(dict.fromkeys(peak.quantity for peak in over)),
        )
    utilisation: dict[str, dict[str, float]] = {}
    for peak in peaks:
        utilisation.setdefault(peak.quantity, {})[peak.name] = peak.utilisation
    return LimitsSummary(utilisation, peaks)


def largest_scale(target: Target, limits: MotionLimits, check: MotionCheck | None = None) -> float:
    """Largest scale of the target's motion within all limits, rounded down to three digits.

    Infinity for a target at rest (or below floating-point resolution), zero where what is mounted exceeds a limit at
    rest. Actuator lengths and forces are not linear in the motion: with `check` the scale is bracketed below that of
    the axes, guided by the share of each trial. They are nearly so: only samples beside those are looked at whose
    demand was a good part of the largest in a first look at some, and what is found is looked at in all.
    """
    highest = max(peak.utilisation for peak in _axis_peaks(target, limits))
    if highest < np.finfo(float).tiny:
        return float("inf")
    if check is not None and _over_at_rest(target, limits, check):
        return 0.0
    found = high = 1 / highest
    governing = np.zeros(len(target.time), bool)
    if check is not None:
        some = _governing(_deciding(target, check, high, slice(None, None, _STRIDE)))
        governing = np.repeat(some, _STRIDE)[: len(governing)]
    while check is not None:
        share = float(_deciding(target, check, high, governing).max())
        found = high if share <= _FULL else _bracketed(target, check, high, share, governing)
        others = np.flatnonzero(~governing)
        shares = _deciding(target, check, found, others) if found > 0.0 and others.size else np.zeros(len(others))
        if not (shares > _FULL).any():
            break
        governing[others[_governing(shares)]] = True
    return _round_down(found * abs(target.reference.scale))


def _over_at_rest(target: Target, limits: MotionLimits, check: MotionCheck, units: Units = SI) -> tuple[Peak, ...]:
    """Limits that are exceeded before the target moves."""
    first = slice(0, 1)
    still = replace(target, time=target.time[first], **{key: 0.0 * getattr(target, key)[first] for key in _QUANTITIES})
    peaks = limit_peaks(still, limits, _parts_of(still, check), units)
    return tuple(peak for peak in peaks if peak.decides and peak.utilisation > _FULL)


def _beyond_at_rest(motion: str, over: Sequence[Peak]) -> OutOfRangeError:
    """Error of what is mounted exceeding limits at rest."""
    found = "; ".join(f"{peak.name} {peak.quantity} {peak.text}" for peak in over)
    return OutOfRangeError(
        f"{motion} exceeds the capacity of the table at any scale, as what is mounted does at rest: {found}; lighten "
        "the specimen",
        0.0,
        tuple(dict.fromkeys(peak.quantity for peak in over)),
    )


def _governing(shares: np.ndarray) -> np.ndarray:
    """Samples whose share is a good part of the largest; all of them where that is not finite."""
    return shares >= (_GOVERNING * shares.max() if np.isfinite(shares.max()) else 0.0)


def _bracketed(target: Target, check: MotionCheck, high: float, share: float, governing: np.ndarray) -> float:
    """Scale below `high`, at which the demand is `share`, with which the governing samples (n,) are within."""
    low, trial = 0.0, high
    while high - low > _CLOSE * high:
        # demands are nearly proportional to the scale: just below where the last share would be one, else halfway
        guess = (1.0 - 0.5 * _CLOSE) * trial / share if 0.0 < share < np.inf else 0.0
        trial = guess if low < guess < high else (low + high) / 2
        share = float(_deciding(target, check, trial, governing).max())
        low, high = (low, trial) if share > _FULL else (trial, high)
        if 1.0 - _CLOSE < share <= _FULL:
            break
    return low


def limit_peaks(
    motion: Motion, limits: MotionLimits, demands: PartCheck | None = None, units: Units = SI
) -> tuple[Peak, ...]:
    """Largest demand of a motion on every limit, axes before others, with texts in `units`; nothing is refused.

    demands: those of parts of the motion on the table.
    """
    on_axes = _axis_peaks(motion, limits, units)
    if demands is None:
        return tuple(on_axes)

    def largest(block: slice) -> list[_Largest]:
        return [_Largest(demand, block.start) for demand in demands(block)]

    with np.errstate(all="ignore"):  # a pose beyond all reach exceeds every stroke: infinite
        first, *others = by_threads(largest, row_blocks(len(motion.displacement)))
    for block in others:
        for so_far, found in zip(first, block, strict=True):
            so_far.raise_to(found)
    return (*on_axes, *(peak for found in first for peak in found.peaks(units)))


class _Largest:
    """Largest share of each axis, actuator or part in a part of a motion that begins at sample `start`."""

    def __init__(self, demand: Demand, start: int) -> None:
        shares, each = _magnitudes(demand.share), np.arange(len(demand.names))
        at = np.argmax(shares, axis=0)
        self._demand, self._share, self._sample = demand, shares[at, each], start + at
        self._value = np.zeros(len(each)) if demand.value is None else demand.value[at, each]

    def raise_to(self, other: "_Largest") -> None:
        """Take what is larger in another part."""
        higher = other._share > self._share
        for mine, theirs in zip(
            (self._share, self._sample, self._value), (other._share, other._sample, other._value), strict=True
        ):
            mine[higher] = theirs[higher]

    def peaks(self, units: Units) -> list[Peak]:
        """One per axis, actuator or part, with texts in `units`."""
        quantity, names, _, of, values, unit, decides = self._demand
        found = []
        for name, share, sample, value in zip(names, self._share, self._sample, self._value, strict=True):
            text = f"{100 * share:.4g} % {of}" if np.isfinite(share) else f"infinitely many times {of}"
            if values is not None and unit:
                text = f"{_with_unit(abs(value), unit, units)}, {text}"
            known = None if values is None else float(value)
            found.append(Peak(quantity, name, float(share), int(sample), text, decides, known))
        return found


def _with_unit(value: float, unit: str, units: Units) -> str:
    """A value in SI as text in the unit that replaces it."""
    name, factor = units.get(unit, (unit, 1.0))
    return f"{factor * value:.4g} {name}"


def _clauses(over: Sequence[Peak], time: np.ndarray) -> list[str]:
    """One clause per quantity: its governing axis or actuator in full, the others by name; axes first."""
    groups: dict[str, list[Peak]] = {}
    for peak in sorted(over, key=lambda peak: (peak.quantity not in _QUANTITIES, -peak.utilisation)):
        groups.setdefault(peak.quantity, []).append(peak)
    clauses = []
    for quantity, (worst, *others) in groups.items():
        where = f"at t = {time[worst.sample]:.3f} s (sample {worst.sample})"
        also = f", also {', '.join(peak.name for peak in others)}" if others else ""
        clauses.append(f"{worst.name} {quantity} {worst.text} {where}{also}")
    return clauses


def _axis_peaks(target: Motion, limits: MotionLimits, units: Units = SI) -> list[Peak]:
    peaks = []
    for quantity, per in zip(_QUANTITIES, ("", "/s", "/s^2"), strict=True):
        values, kept = getattr(target, quantity), limits.reserve if quantity == "displacement" else 0.0
        for i, axis in enumerate(AXES):
            bounds = np.full(len(values), getattr(limits, quantity)[i])
            if limits.rise is not None and (quantity, axis) == ("acceleration", "z"):
                bounds[values[:, i] > 0.0] = limits.rise
            shares = np.abs(values[:, i]) / ((1.0 - kept) * bounds)
            sample = int(np.argmax(shares))
            value, limit, share = abs(float(values[sample, i])), float(bounds[sample]), float(shares[sample])
            unit = ("m" if i < 3 else "rad") + per
            text = f"{_with_unit(value, unit, units)} against {_with_unit(limit, unit, units)}{less_reserve(kept)}"
            peaks.append(Peak(quantity, axis, share, sample, text, value=value))
    return peaks


def _parts_of(
    motion: Motion, check: MotionCheck, factor: float = 1.0, some: np.ndarray | slice = slice(None)
) -> PartCheck:
    """Demands of parts of some samples of a motion, scaled."""
    moved = [x[some] for x in (motion.displacement, motion.velocity, motion.acceleration)]
    return lambda block: check(*(factor * x[block] for x in moved))


def _deciding(motion: Motion, check: MotionCheck, factor: float, some: np.ndarray | slice = slice(None)) -> np.ndarray:
    """Largest share (n,) of the deciding demands at each of some samples of a motion, scaled."""
    demands, count = _parts_of(motion, check, factor, some), len(motion.displacement[some])

    def largest(block: slice) -> np.ndarray:
        shares = [column for demand in demands(block) if demand.decides for column in np.abs(demand.share).T]
        return _magnitudes(reduce(np.maximum, shares)) if shares else np.zeros(block.stop - block.start)

    with np.errstate(all="ignore"):  # as in `limit_peaks`
        return np.concatenate([np.zeros(0), *by_threads(largest, row_blocks(count))])


def _magnitudes(shares: np.ndarray) -> np.ndarray:
    """Magnitudes of shares; infinite where they are not numbers."""
    found = np.abs(shares)
    found[np.isnan(found)] = np.inf
    return found


def _round_down(value: float) -> float:
    """Three significant digits, never above `value` by more than rounding."""
    return rounded_down(value * _FULL, 3)
