"""Cross-checks of redundant sensors: every quantity measured twice, compared by regression over a whole campaign.

Each comparison is y = X theta + noise: y one column of a channel, X its prediction, by identity, kinematics or a known
law, with its derivative (whose coefficient is a delay) and a constant (an offset). Both sides have the same filter. The
known noise variance of X is subtracted from X'X, so that no gain is biased low.

The tolerance of theta covers what calibration leaves uncertain: each such error is a signal E (one standard deviation)
that y may contain, and moves theta by (X'X)^-1 X'E. It is three times the root sum of squares of these moves, or the
sum of all at the ends of their ranges (sqrt(3) deviations), if that is more; a delay by that sum alone, as two delays
within their ranges never add up to more. The residual may contain E, and no less than the stated noise.

Where a force hardly varies, a gain and an offset are not separable. Coefficients that the records do not test are held
at their nominal values, and the rest is solved again: the stated range of a held coefficient then widens the tolerance
of the rest, and a finding lists it as an alternative.

A drift looks like no error of calibration, and even a small one is of no sensor whose errors are constant. It is
estimated with the errors E beside it, each with a standard deviation of one before the test: what they leave of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array, Mask
from ..mechanics.plant import Plant
from .alignment import align_record, group_delays
from .channels import channel_unit
from .records import require
from .sensor_pairs import comparisons
from .sensor_view import BAND, Regressor, SensorComparison
from .sensors import SensorSet

__all__ = ["LEVELS", "ConsistencyFinding", "check_sensors", "scaled_inverse"]


Verdict = Literal["ok", "suspicious", "untested"]

FOLLOWING = ("platen_velocity", "platen_acceleration", "actuator_displacement")  # compared with platen_displacement
LATE = 0.125  # rad at the end of the band, 1 ms: a delay below it is a coefficient of the derivative
LEVELS = ("offset", "drift")  # quantities identifiable in spite of noise, and that play of a pin changes
CONFIDENCE = 3.0  # standard deviations
SURE = 5.0  # those of a drift, which has no tolerance beside what it is estimated with
PASSES = 4  # of a fit and the squares that it leaves
LEAST_GAIN = 0.5  # of a regressor with such noise, from which on its delay, which noise shrinks as well, is a bound
MOST_NOISE = 0.1  # share of noise in a column, less the others, above which its correction is not accurate


@dataclass(frozen=True)
class ConsistencyFinding:
    """One number by which two sensors (or a sensor and a law) were compared.

    `tolerance` covers errors of calibration and geometry, at least three deviations except for delays; `standard_error`
    is that of the noise. A gain or delay is "untested" where noise is too large: a standard error beyond the tolerance,
    or more than a tenth of the regressor's power; but for a delay that is beyond its tolerance in spite of the latter,
    which shrinks it. `instead` are untested quantities that would have the same effect:
    where nothing varies, an offset may be a gain.
    """

    check: str
    channel: str  # as in `actuator_force[H1]`
    quantity: str
    unit: str
    estimate: float
    standard_error: float
    expected: float
    tolerance: float
    verdict: Verdict
    instead: tuple[str, ...] = ()

    @property
    def named(self) -> str:
        """The quantity and its alternatives, as in `offset or gain a`."""
        return " or ".join((self.quantity, *self.instead))

    @property
    def deviation(self) -> float:
        """Standard deviation of noise and calibration together."""
        return float(np.hypot(self.standard_error, self.tolerance / CONFIDENCE))

    @property
    def significance(self) -> float:
        """Difference from the expected value in such deviations [1]."""
        return (self.estimate - self.expected) / self.deviation if self.deviation > 0 else 0.0

    def __str__(self) -> str:
        """One line, as in `force against pressures, actuator_force[H1]: gain a 1.003 +- 0.001 1, ...`."""
        value = f"{self.named} {self.estimate:.5g} +- {self.standard_error:.2g} {self.unit}"
        due = f"expected {self.expected:.5g} within {self.tolerance:.2g}"
        return f"{self.check}, {self.channel}: {value}, {due}: {self.verdict}"


def check_sensors(plant: Plant, records: Sequence[xr.Dataset], sensors: SensorSet) -> tuple[ConsistencyFinding, ...]:
    """Cross-check all redundant sensors of a campaign, pooled over its records.

    Force against pressures, lengths against platen pose, parity of the lengths, velocity and acceleration against
    displacement, strut pressure against gas law, supply pressure against nominal, spools against delayed commands.
    A missing channel disables only its comparisons. A suspicious finding need not be a sensor fault: an effect missing
    in the law (a leaking strut, a drooping supply) shows as well. Raises RecordError for channels without time.
    """
    for record in records:
        require(record, "time")
    late = _late(plant, records)
    parts: dict[tuple[str, str], list[_Sums]] = {}
    for record in records:
        for one in comparisons(plant, align_record(record, late), sensors):
            if len(one.y):  # none where a record is no longer than its edges
                parts.setdefault((one.check, one.channel), []).append(_sums(one))
    order = {check: k for k, check in enumerate(dict.fromkeys(check for check, _ in parts))}
    keys = sorted(parts, key=lambda key: order[key[0]])
    each = ((key, _pooled(parts[key]), late.get(key[1].partition("[")[0], 0.0)) for key in keys)
    return tuple(one for key, sums, delay in each for one in _findings(*key, sums, sensors.noise_range, delay))


def _late(plant: Plant, records: Sequence[xr.Dataset]) -> dict[str, float]:
    """Delays [s] of channels of motion too large for a regression on the derivative, which is of first order."""
    least = LATE / (2 * np.pi * BAND.high)
    found = {group: delay for group, delay in group_delays(plant, records).items() if group in FOLLOWING}
    clear = {group: d.delay for group, d in found.items() if abs(d.delay) > CONFIDENCE * d.standard_error}
    return {group: delay for group, delay in clear.items() if abs(delay) > least}


# ------------------------------------------------------------------------------------------------ regression
class _Sums(NamedTuple):
    """Sums of products over records."""

    terms: tuple[Regressor, ...]
    xx: Array  # (p, p)
    xy: Array  # (p,)
    xe: Array  # (p, k)
    ee: Array  # (k, k)
    ey: Array  # (k,)
    noise: Array  # (p,) of X, summed over samples
    yy: float
    variance: float  # of y, summed over samples
    samples: float
    independent: float


def _sums(c: SensorComparison) -> _Sums:
    x = np.stack([t.column for t in c.terms], axis=1) if c.terms else np.zeros((len(c.y), 0))
    n, noise = len(c.y), len(c.y) * np.array([t.variance for t in c.terms])
    products = x.T @ x, x.T @ c.y, x.T @ c.errors, c.errors.T @ c.errors
    return _Sums(c.terms, *products, c.errors.T @ c.y, noise, float(c.y @ c.y), n * c.variance, n, c.independent)


def _pooled(parts: Sequence[_Sums]) -> _Sums:
    totals: list[Any] = [sum(values) for values in zip(*(part[1:] for part in parts), strict=True)]
    return _Sums(parts[-1].terms, *totals)


class _Solved(NamedTuple):
    """Coefficients with their uncertainties, and the mean square of the residual."""

    theta: Array  # (p,)
    inverse: Array  # (p, p) of X'X, zero where held
    error: Array  # (p,) standard errors
    lawful: Array  # (p,) tolerance for calibration errors
    bound: Array  # (p,) that of errors which are all at the ends of their ranges
    doubt: Array  # (p,) tolerance for the uncertainty of the stated noise
    square: float  # mean square of the residual
    noise: float  # its part due to noise
    allowed: float  # its part due to calibration errors, one standard deviation


def _solved(s: _Sums, kept: Mask, noise: Array, noise_range: float) -> _Solved:
    """Least squares for the coefficients `kept` (p,), the others held at their nominal values; `noise` (p,) is of X."""
    inverse = np.zeros(s.xx.shape)
    inverse[np.ix_(kept, kept)] = scaled_inverse((s.xx - np.diag(noise))[np.ix_(kept, kept)], np.diag(s.xx)[kept])
    due = np.where(kept, 0.0, [term.due for term in s.terms])
    theta = due + inverse @ (s.xy - s.xx @ due)
    moved = inverse @ s.xe
    square = float((s.yy - 2 * theta @ s.xy + theta @ s.xx @ theta) / s.samples)
    noise_left = (s.variance + float(theta**2 @ s.noise)) / s.samples
    left = np.diag(s.ee) - 2 * np.sum(moved * s.xe, axis=0) + np.einsum("pk,pq,qk->k", moved, s.xx, moved)
    spread = np.sqrt(max(square, noise_left) * s.samples / s.independent)
    bound = np.sqrt(3.0) * np.sum(np.abs(moved), axis=1)
    return _Solved(
        theta,
        inverse,
        spread * np.sqrt(np.maximum(np.diag(inverse), 0.0)),
        np.maximum(CONFIDENCE * np.sqrt(np.sum(moved**2, axis=1)), bound),
        bound,
        ((1 + noise_range) ** 2 - 1) * np.abs(inverse @ (noise * theta)),
        square,
        noise_left,
        float(np.sum(np.maximum(left, 0.0))) / s.samples,
    )


def _beside_errors(s: _Sums) -> tuple[Array, Array, Array]:
    """Coefficients (p,) with the errors E estimated beside them; standard errors and tolerances, of what E leaves.

    The squares of the residual are those of noise, or what both leave; errors that are not in E raise them.
    """
    count, total = len(s.xy), len(s.xy) + len(s.ey)
    products = np.block([[s.xx, s.xe], [s.xe.T, s.ee]])
    right, prior = np.concatenate([s.xy, s.ey]), np.diag(np.arange(total) >= count).astype(np.float64)
    square = s.variance / s.samples
    for _ in range(PASSES):
        spread = square * s.samples / s.independent
        normal = products + spread * prior
        inverse = scaled_inverse(normal, np.diag(normal))
        theta = inverse @ right
        left = float(s.yy - 2 * theta @ right + theta @ products @ theta) / s.samples
        square = max(left, s.variance / s.samples)
    sampled = np.diag(spread * inverse @ products @ inverse)
    assumed = np.diag(spread**2 * inverse @ prior @ inverse)
    errors, tolerances = np.sqrt(np.maximum(sampled, 0.0)), CONFIDENCE * np.sqrt(np.maximum(assumed, 0.0))
    return theta[:count], errors[:count], tolerances[:count]


def _findings(check: str, channel: str, s: _Sums, noise_range: float, late: float) -> Iterator[ConsistencyFinding]:
    """Findings on one channel, whose delay `late` [s] has been removed."""
    unit_y = channel_unit(channel)
    hidden = s.noise * np.diag(scaled_inverse(s.xx, np.diag(s.xx))) > MOST_NOISE
    whole = any(h and not term.beside for h, term in zip(hidden, s.terms, strict=True))
    free = _solved(s, np.ones(len(s.noise), bool), np.where(hidden, 0.0, s.noise), noise_range)
    unclear = hidden | (free.error > free.lawful + free.doubt) | whole
    held = unclear & np.array([term.quantity not in LEVELS for term in s.terms], bool)
    tested = _solved(s, ~held, s.noise, noise_range) if held.any() else free
    moved = np.abs(tested.inverse @ s.xx) * free.lawful  # (p, p): by the range of each that is held
    for i, term in enumerate(s.terms):
        by = free if held[i] else tested
        value, sigma, range_ = by.theta[i], by.error[i], by.lawful[i] + by.doubt[i]
        if term.delay is not None:
            gain = by.theta[0] or 1.0
            value, sigma = late + term.delay - value / gain, sigma / abs(gain)
            range_ = by.bound[i] + by.doubt[i]  # delays have limits, not deviations
        if term.quantity == "drift":
            value, sigma, range_ = (of[i] for of in _beside_errors(s))
        value, sigma, due, range_ = float(value), float(sigma), float(term.expected), float(range_)
        others = () if held[i] else tuple(s.terms[k].quantity for k in np.flatnonzero(held & (moved[i] > sigma)))
        # noise of a regressor only shrinks its coefficient: a delay that is clear is no less, if its gain is large
        bounded = term.delay is not None and free.theta[0] > LEAST_GAIN and free.error[i] < free.lawful[i]
        verdict = _verdict(abs(value - due), sigma, range_, SURE if term.quantity == "drift" else CONFIDENCE)
        verdict = "untested" if held[i] and not (bounded and verdict == "suspicious") else verdict
        unit = term.unit or unit_y
        yield ConsistencyFinding(check, channel, term.quantity, unit, value, sigma, due, range_, verdict, others)
    # an untested coefficient may explain most; a channel of zeros has no noise
    best = min(free, tested, key=lambda by: by.square / max(by.noise, 1e-300))
    rms, floor = float(np.sqrt(max(best.square, 0.0))), float(np.sqrt(best.noise))
    sigma = float(floor / np.sqrt(2 * s.independent))
    range_ = float(np.sqrt((1 + noise_range) ** 2 * best.noise + CONFIDENCE**2 * best.allowed) - floor)
    verdict = _verdict(rms - floor, sigma, range_)  # it may be smaller than the noise
    yield ConsistencyFinding(check, channel, "residual", unit_y, rms, sigma, floor, range_, verdict)


def _verdict(off: float, error: float, tolerance: float, confidence: float = CONFIDENCE) -> Verdict:
    """Suspicious if so many deviations beyond noise and calibration; the tolerance is `CONFIDENCE` of the latter."""
    return "suspicious" if off > confidence * np.hypot(error, tolerance / CONFIDENCE) else "ok"


def scaled_inverse(matrix: Array, squares: Array) -> Array:
    """Pseudoinverse of a normal matrix (p, p), its columns scaled by the roots of `squares` (p,) for its condition."""
    scale = 1 / np.sqrt(np.maximum(squares, 1e-300))
    return np.asarray(scale[:, None] * np.linalg.pinv(scale[:, None] * matrix * scale) * scale)
