"""How well a model's signals agree with measured ones, column by column.

Both sides have the same filter and samples. Forces and pressures are compared with their means removed: the static
preload would dominate the norm of a vertical force, an offset of a sensor its error. The difference of the means is
reported separately.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array, Mask
from ...data.at_rest import at_rest
from ...data.channels import LAYOUT, channel_unit
from ...data.signals import align, correlation, delay_within, drift_rate, peak_ratio, rrmse
from .prepare_tests import Numbers

__all__ = ["MOTIONS", "ColumnAgreement", "ComparedQuantity", "agree", "unit_of"]


MOTIONS = ("displacement", "velocity", "acceleration")
"""Quantities of the platen that share the delay found on their velocity."""

_UNITS = {
    **{quantity: LAYOUT[f"platen_{quantity}"].units for quantity in MOTIONS},
    **dict.fromkeys(("wrench", "struts", "dissipative"), "N, N m"),
}
_FIRST = {"displacement": 0, "velocity": 1}
"""Of what other quantities take: which axes are at rest, and the delay."""

_PRELOADED = ("wrench", "struts", "dissipative", "actuator_force", "chamber_pressure_a", "chamber_pressure_b")


@dataclass(frozen=True)
class ComparedQuantity:
    """One quantity, measured and of the model; n samples, k columns, with the same low-pass."""

    quantity: str  # a name of the units below: "displacement", ..., "wrench" at C in {c}, "actuator_force", ...
    columns: tuple[str, ...]
    measured: Array  # (n, k)
    model: Array  # (n, k)
    sensor_noise: Array  # (k,) standard deviation of the sensors' noise in the measurement
    noise: Array  # (k,) of noise in the difference; larger where the model is driven by measured channels
    calibration: Array | None = None  # (k,) of its mean by gains and offsets of sensors, where known


class ColumnAgreement(NamedTuple):
    """Agreement of one column; nan where it hardly moves, or for a ratio to zero."""

    quantity: str
    column: str
    unit: str
    moves: bool
    variation: float  # rms of the measurement about its mean
    error: float  # rms of model less measurement; of forces and pressures less its mean
    noise: float  # standard deviation of the error due to sensor noise alone
    error_aligned: float  # rms, delay removed; the same as `error` where there is none
    rrmse: float  # [1]
    rrmse_aligned: float  # [1] delay removed
    delay: float  # of the model behind the measurement [s]
    peak_ratio: float  # model over measurement; a delay does not change it
    correlation: float
    correlation_aligned: float  # delay removed
    offset: float  # mean of model less measurement
    offset_expected: float  # its standard deviation by calibration of sensors; nan where not known
    drift: float  # least-squares slope of the error [unit / s]

    @property
    def error_to_noise(self) -> float:
        """Error, delay removed, in standard deviations of the sensor noise [1]."""
        return self.error_aligned / self.noise if self.noise > 0.0 else float("nan")


def unit_of(quantity: str, column: str) -> str:
    """SI unit of a quantity's column."""
    return channel_unit(f"{quantity}[{column}]", _UNITS.get(quantity))


def agree(pairs: Sequence[ComparedQuantity], dt: float, numbers: Numbers) -> tuple[ColumnAgreement, ...]:
    """Agreement of every column of every quantity, without the ends of the test.

    Displacement, velocity and acceleration of an axis share the delay of the velocity, since the displacement of an
    open loop drifts. Raises ValueError if a test is too short for the longest delay sought.
    """
    shared: dict[str, float] = {}
    found: list[ColumnAgreement] = []
    still: set[str] = set()  # axes of the platen
    for pair in sorted(pairs, key=lambda p: _FIRST.get(p.quantity, len(_FIRST))):
        part = numbers.inside(len(pair.measured), dt)
        moves = _moving(pair, pair.measured[part], numbers)
        if pair.quantity == "displacement":
            still = {pair.columns[k] for k in np.flatnonzero(at_rest(pair.measured[part], place=True))}
        if pair.quantity in MOTIONS:
            moves &= [column not in still for column in pair.columns]
        for k, column in enumerate(pair.columns):
            late = float("nan")
            if moves[k]:
                late = shared.get(column, late) if pair.quantity in MOTIONS else late
                if np.isnan(late):
                    sides = pair.measured[part, k], pair.model[part, k]
                    late = float(delay_within(*sides, dt, numbers.longest_delay))
            if pair.quantity == "velocity":
                shared[column] = late
            found.append(_agree_one(pair, k, bool(moves[k]), late, part, dt))
    order = {pair.quantity: i for i, pair in enumerate(pairs)}
    return tuple(sorted(found, key=lambda a: order[a.quantity]))


def _moving(pair: ComparedQuantity, measured: Array, numbers: Numbers) -> Mask:
    """Columns (k,) that move enough for a ratio to be meaningful."""
    size = measured.std(axis=0)
    per = {"m": 1.0, "rad": numbers.number("hardly_moving.radius"), "N m": 1.0 / numbers.number("hardly_moving.radius")}
    weight = [per.get(unit_of(pair.quantity, column).split("/")[0], 1.0) for column in pair.columns]
    comparable = size * weight
    enough = (comparable >= numbers.number("hardly_moving.share") * comparable.max(initial=0.0)) & (comparable > 0.0)
    enough &= ~at_rest(measured - measured.mean(axis=0), float(np.abs(measured).max(initial=0.0)))
    return np.asarray(enough & (size >= numbers.number("hardly_moving.noise") * pair.sensor_noise))


def _agree_one(pair: ComparedQuantity, k: int, moves: bool, late: float, part: slice, dt: float) -> ColumnAgreement:
    measured, whole = pair.measured[part, k], pair.model[:, k]
    offset = float((whole[part] - measured).mean())
    if pair.quantity in _PRELOADED:
        whole, measured = whole - whole[part].mean(), measured - measured.mean()
    model = whole[part]
    shifted = align(whole, late, dt)[part] if np.isfinite(late) else model
    error = model - measured
    ratio = ratio_aligned = peak = correlated = correlated_aligned = float("nan")
    if moves:
        ratio, peak, correlated = (float(f(measured, model)) for f in (rrmse, peak_ratio, correlation))
        ratio_aligned, correlated_aligned = (float(f(measured, shifted)) for f in (rrmse, correlation))
    column = pair.columns[k]
    calibration = float("nan") if pair.calibration is None else float(pair.calibration[k])
    rms = [float(np.sqrt(np.mean(x**2))) for x in (error, shifted - measured)]
    return ColumnAgreement(
        *(pair.quantity, column, unit_of(pair.quantity, column), moves),
        *(float(measured.std()), rms[0], float(pair.noise[k]), rms[1]),
        *(ratio, ratio_aligned, late, peak, correlated, correlated_aligned),
        *(offset, calibration, float(drift_rate(error, dt))),
    )
