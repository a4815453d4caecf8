"""A response spectrum that a motion is to have."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

__all__ = ["TargetSpectrum"]


@dataclass(frozen=True, eq=False)
class TargetSpectrum:
    """Pseudo-acceleration of damped oscillators that a motion is to have."""

    frequency: np.ndarray  # (m,) [Hz], increasing
    acceleration: dict[str, np.ndarray]  # (m,) [m/s^2] by axis x, y, z
    damping: float  # share of critical
    source: str

    def at(self, axis: str, frequency: np.ndarray) -> np.ndarray:
        """Spectral acceleration (k,) [m/s^2] of an axis at `frequency` (k,) [Hz], linear between logarithms."""
        logs = np.log(self.frequency), np.log(self.acceleration[axis])
        return np.exp(np.interp(np.log(frequency), *logs))

    def on_axes(self, pairs: Iterable[tuple[str, str]]) -> "TargetSpectrum":
        """Spectrum of the table's axes, each moved by a component of the motion: (axis, component)."""
        found = {axis: self.acceleration[part] for axis, part in pairs if part in self.acceleration}
        return replace(self, acceleration=found)

    def with_scale(self, factor: float) -> "TargetSpectrum":
        """Spectrum of the motion times a factor."""
        return replace(self, acceleration={axis: abs(factor) * a for axis, a in self.acceleration.items()})

    def with_time_scale(self, factor: float) -> "TargetSpectrum":
        """Spectrum of the motion whose durations are times `factor` and whose accelerations stay."""
        return replace(self, frequency=self.frequency / factor)
