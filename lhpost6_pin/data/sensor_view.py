"""A record filtered, trimmed and thinned, for the comparison of redundant channels; and what is compared."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..mechanics.plant import Plant
from .channels import LAYOUT, columns_of
from .conditioning import resolutions
from .records import sample_interval
from .sensors import SensorSet, spectrum
from .signals import Band, differentiate

__all__ = ["BAND", "RecordView", "Regressor", "SensorComparison"]

BAND = Band(high=20.0)  # Hz: where motion exceeds noise
TRIM = 0.1  # s: cut off at both ends, where filters settle


class Regressor(NamedTuple):
    """One column of X: name and expected value of its coefficient, which `delay` turns into a delay."""

    quantity: str
    unit: str
    expected: float
    column: Array  # (n,)
    variance: float = 0.0  # of its noise
    delay: float | None = None  # already removed [s]; the coefficient is the remaining one, times minus the gain
    beside: bool = False  # the others remain identifiable where noise hides it

    @property
    def due(self) -> float:
        """Nominal value of its coefficient."""
        return self.expected if self.delay is None else 0.0


class SensorComparison(NamedTuple):
    """One y and its X in one record."""

    check: str
    channel: str
    y: Array  # (n,)
    variance: float  # of its noise
    terms: tuple[Regressor, ...]
    errors: Array  # (n, k), one standard deviation each
    independent: float  # number of independent samples


class RecordView:
    """A record filtered, trimmed and thinned for comparison, with its remaining noise."""

    def __init__(self, plant: Plant, record: xr.Dataset, sensors: SensorSet) -> None:
        """Choose the step by which it is thinned, and the band in which its noise is known."""
        self.plant, self.record, self.sensors = plant, record, sensors
        time = record["time"].values
        self.dt = sample_interval(record)
        self.step = max(1, int(1 / (8 * BAND.high * self.dt)))
        self.trim = round(TRIM / (self.step * self.dt))
        left = len(range(0, len(time), self.step)) - 2 * self.trim  # samples; no more than these are independent
        self.independent = max(1.0, min(2 * BAND.high * (len(time) * self.dt - 2 * TRIM), left))
        self.f = np.linspace(0.0, min(0.5 / self.dt, 4 * BAND.high), 1025)

    def has(self, *names: str) -> bool:
        """Whether the record has these channels."""
        return all(name in self.record for name in names)

    def values(self, name: str) -> Array:
        """Columns (n, k) of a channel at the record's rate."""
        return columns_of(self.record[name])

    def signals(self, x: Array, *orders: int) -> list[Array]:
        """Derivatives of these orders of x (n, k) in the band, thinned and trimmed."""
        x = BAND.apply(x, self.dt)[:: self.step]  # no aliasing at 8 times the band
        derivatives = [x]
        for _ in range(max(orders)):
            derivatives.append(differentiate(derivatives[-1], self.step * self.dt))
        return [derivatives[k][self.trim : len(x) - self.trim] for k in orders]

    def signal(self, x: Array) -> Array:
        """Columns x (n, k) in the band, thinned and trimmed."""
        return self.signals(x, 0)[0]

    def variance(self, name: str, order: int = 0) -> Array:
        """Noise variance (k,) of that derivative of a channel."""
        shape = (BAND.gain(self.f) * (2 * np.pi * self.f) ** order) ** 2
        power = spectrum(self.sensors, self.record, name, self.f) * shape[:, None]
        return np.asarray(np.trapezoid(power, self.f, axis=0))

    def sd(self, name: str) -> tuple[float, float, float]:
        """Calibration of a channel, one standard deviation: gain [1], offset [unit] with resolution, delay [s]."""
        s, step = self.sensors, resolutions(self.record[name]).max() if self.has(name) else 0.0
        offset = float(np.hypot(s.offset_sd(name), step / np.sqrt(12.0)))
        return s.gain_sd(name), offset, s.delay_sd(LAYOUT[name].group or name)

    def compared(
        self, check: str, channel: str, y: Array, variance: float, terms: Sequence[Regressor], errors: Sequence[Array]
    ) -> SensorComparison:
        """A comparison of one column y (n,) of a channel."""
        columns = np.stack(errors, axis=1)
        return SensorComparison(check, channel, y, float(variance), tuple(terms), columns, self.independent)
