"""Do the sensors agree? Every quantity that was measured twice, compared by regression over a whole campaign.

Each comparison is y = X theta + noise: y one column of a channel, X what it should be made of, by identity,
kinematics or a known law, with its derivative (whose coefficient is a delay) and a constant (an offset). Both sides
are filtered by one band. X has noise as well; its known variance is taken off X'X, so that no gain is biased low.

A theta may be off by its noise, and by what calibration leaves open: each such error is a signal E (its size one
standard deviation) that y may contain, and moves theta by (X'X)^-1 X'E. Three times the root sum of squares of these
moves is the tolerance, or the sum of all at the ends of their ranges (sqrt(3) deviations), if that is more. What E
leaves in the residual is allowed there; less than the stated noise always is.

A force that hardly varies cannot tell a gain from an offset. So what the records do not test is held at what it should
be, and the rest is solved again: the stated range of what is held, a part of E, then counts in the tolerance of the
rest, and a finding says what may be off instead.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..mechanics.plant import Plant
from .channels import channel_unit
from .records import require
from .sensor_pairs import Regressor, SensorComparison, comparisons
from .sensors import SensorSet

__all__ = ["ConsistencyFinding", "check_sensors", "scaled_inverse"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEVELS = ("offset", "drift")  # quantities that noise does not hide
CONFIDENCE = 3.0  # standard deviations
MOST_NOISE = 0.1  # of what the other columns leave of one: where more is noise, its correction is worth little


@dataclass(frozen=True)
class ConsistencyFinding:
    """One number by which two sensors (or a sensor and a law) were compared.

    `tolerance` is what calibration and geometry may make of it, at least three deviations; `standard_error` is that
    of the noise. The verdict on a gain or delay is "untested" where noise is more than what is compared allows: a
    standard error beyond the tolerance, or a tenth of what the gain is told by. `instead` are untested quantities that
    would show here: where nothing varies, an offset may be a gain.
    """

    check: str
    channel: str  # as in `actuator_force[H1]`
    quantity: str
    unit: str
    estimate: float
    standard_error: float
    expected: float
    tolerance: float
    verdict: Literal["ok", "suspicious", "untested"]
    instead: tuple[str, ...] = ()

    @property
    def named(self) -> str:
        """The quantity and what may be off instead, as in `offset or gain a`."""
        return " or ".join((self.quantity, *self.instead))

    @property
    def deviation(self) -> float:
        """Standard deviation of noise and calibration together."""
        return float(np.hypot(self.standard_error, self.tolerance / CONFIDENCE))

    @property
    def significance(self) -> float:
        """How far off it is, in such deviations [1]."""
        return (self.estimate - self.expected) / self.deviation if self.deviation > 0 else 0.0

    def __str__(self) -> str:
        """One line, as in `force against pressures, actuator_force[H1]: gain a 1.003 +- 0.001 1, ...`."""
        value = f"{self.named} {self.estimate:.5g} +- {self.standard_error:.2g} {self.unit}"
        due = f"expected {self.expected:.5g} within {self.tolerance:.2g}"
        return f"{self.check}, {self.channel}: {value}, {due}: {self.verdict}"


def check_sensors(plant: Plant, records: Sequence[xr.Dataset], sensors: SensorSet) -> tuple[ConsistencyFinding, ...]:
    """Compare all sensors of a campaign that can be compared, pooled over its records.

    Force against pressures, lengths against platen pose, parity of the lengths, velocity and acceleration against
    displacement, strut pressure against gas law, supply pressure against nominal, spools against delayed commands.
    What a record does not have is left out. What is suspicious need not be a broken sensor: an effect that the law
    lacks (a leaking strut, a sagging supply) shows here too. Raises RecordError for channels without time.
    """
    sums: dict[tuple[str, str], _Sums] = {}
    for record in records:
        require(record, "time")
        for comparison in comparisons(plant, record, sensors):
            if not len(comparison.y):
                continue  # of a record that is all edge nothing is left
            key = comparison.check, comparison.channel
            sums[key] = _added(sums.get(key), comparison)
    order = {check: k for k, check in enumerate(dict.fromkeys(check for check, _ in sums))}
    keys = sorted(sums, key=lambda key: order[key[0]])
    return tuple(finding for key in keys for finding in _findings(*key, sums[key], sensors.noise_range))


# ------------------------------------------------------------------------------------------------ regression
class _Sums(NamedTuple):
    """Sums of products over records."""

    terms: tuple[Regressor, ...]
    xx: Array | float  # (p, p)
    xy: Array | float
    xe: Array | float  # (p, k)
    ee: Array | float  # (k,)
    noise: Array | float  # (p,) of X, summed over samples
    yy: float
    variance: float  # of y, summed over samples
    samples: float
    independent: float


def _added(sums: _Sums | None, c: SensorComparison) -> _Sums:
    x = np.stack([t.column for t in c.terms], axis=1) if c.terms else np.zeros((len(c.y), 0))
    n = len(c.y)
    s = sums or _Sums(c.terms, *(0.0,) * 9)
    return _Sums(
        c.terms,
        s.xx + x.T @ x,
        s.xy + x.T @ c.y,
        s.xe + x.T @ c.errors,
        s.ee + np.sum(c.errors**2, axis=0),
        s.noise + n * np.array([t.variance for t in c.terms]),
        s.yy + float(c.y @ c.y),
        s.variance + n * c.variance,
        s.samples + n,
        s.independent + c.independent,
    )


class _Solved(NamedTuple):
    """Coefficients with what they may be off by, and what they leave."""

    theta: Array  # (p,)
    inverse: Array  # (p, p) of X'X, zero where held
    error: Array  # (p,) standard errors
    lawful: Array  # (p,) by what calibration leaves open
    doubt: Array  # (p,) by what the stated noise may be off
    square: float  # mean square of the residual
    noise: float  # of it, that of noise
    allowed: float  # of it, that of what calibration leaves open, one standard deviation


def _solved(s: _Sums, kept: Mask, noise: Array, noise_range: float) -> _Solved:
    """Least squares for the coefficients `kept` (p,), the others held at what they should be; `noise` (p,) is of X."""
    xx, xy, xe, ee = (np.asarray(x) for x in (s.xx, s.xy, s.xe, s.ee))
    inverse = np.zeros(xx.shape)
    inverse[np.ix_(kept, kept)] = scaled_inverse((xx - np.diag(noise))[np.ix_(kept, kept)], np.diag(xx)[kept])
    due = np.where(kept, 0.0, [term.due for term in s.terms])
    theta = due + inverse @ (xy - xx @ due)
    moved = inverse @ xe
    square = (s.yy - 2 * theta @ xy + theta @ xx @ theta) / s.samples
    noise_left = (s.variance + float(theta**2 @ np.asarray(s.noise))) / s.samples
    left = ee - 2 * np.sum(moved * xe, axis=0) + np.einsum("pk,pq,qk->k", moved, xx, moved)
    spread = np.sqrt(max(square, noise_left) * s.samples / s.independent)
    return _Solved(
        theta,
        inverse,
        spread * np.sqrt(np.maximum(np.diag(inverse), 0.0)),
        np.maximum(CONFIDENCE * np.sqrt(np.sum(moved**2, axis=1)), np.sqrt(3.0) * np.sum(np.abs(moved), axis=1)),
        ((1 + noise_range) ** 2 - 1) * np.abs(inverse @ (noise * theta)),
        float(square),
        float(noise_left),
        float(np.sum(np.maximum(left, 0.0))) / s.samples,
    )


def _findings(check: str, channel: str, s: _Sums, noise_range: float) -> Iterator[ConsistencyFinding]:
    xx, noise = np.asarray(s.xx), np.asarray(s.noise)
    unit_y = channel_unit(channel)
    hidden = noise * np.diag(scaled_inverse(xx, np.diag(xx))) > MOST_NOISE
    whole = any(h and not term.beside for h, term in zip(hidden, s.terms, strict=True))
    free = _solved(s, np.ones(len(noise), bool), np.where(hidden, 0.0, noise), noise_range)
    unclear = hidden | (free.error > free.lawful + free.doubt) | whole
    held = unclear & np.array([term.quantity not in LEVELS for term in s.terms], bool)
    told = _solved(s, ~held, noise, noise_range) if held.any() else free
    moved = np.abs(told.inverse @ xx) * free.lawful  # (p, p): by the range of each that is held
    for i, term in enumerate(s.terms):
        by = free if held[i] else told
        value, sigma, range_ = by.theta[i], by.error[i], by.lawful[i] + by.doubt[i]
        if term.delay is not None:
            gain = by.theta[0] or 1.0
            value, sigma = term.delay - value / gain, sigma / abs(gain)
        numbers = value, sigma, term.expected, range_
        others = () if held[i] else tuple(s.terms[k].quantity for k in np.flatnonzero(held & (moved[i] > sigma)))
        yield _finding(check, channel, term.quantity, term.unit or unit_y, *numbers, untested=held[i], instead=others)
    # what cannot be told may be what explains most; a channel of nothing but zeros has no noise
    best = min(free, told, key=lambda by: by.square / max(by.noise, 1e-300))
    rms, floor = np.sqrt(max(best.square, 0.0)), np.sqrt(best.noise)
    range_ = np.sqrt((1 + noise_range) ** 2 * best.noise + CONFIDENCE**2 * best.allowed) - floor
    yield _finding(check, channel, "residual", unit_y, rms, floor / np.sqrt(2 * s.independent), floor, range_)


def scaled_inverse(matrix: Array, squares: Array) -> Array:
    """Pseudoinverse of a normal matrix (p, p), its columns scaled by the roots of `squares` (p,) for its condition."""
    scale = 1 / np.sqrt(np.maximum(squares, 1e-300))
    return np.asarray(scale[:, None] * np.linalg.pinv(scale[:, None] * matrix * scale) * scale)


def _finding(
    check: str,
    channel: str,
    quantity: str,
    unit: str,
    estimate: float,
    error: float,
    expected: float,
    tolerance: float,
    *,
    untested: bool = False,
    instead: tuple[str, ...] = (),
) -> ConsistencyFinding:
    """Suspicious is what is farther off than noise and its tolerance explain; a residual may be less than expected."""
    off = estimate - expected if quantity == "residual" else abs(estimate - expected)
    far = off > np.hypot(CONFIDENCE * error, tolerance)
    verdict: Literal["ok", "suspicious", "untested"] = "untested" if untested else "suspicious" if far else "ok"
    numbers = float(estimate), float(error), float(expected), float(tolerance)
    return ConsistencyFinding(check, channel, quantity, unit, *numbers, verdict, instead)
