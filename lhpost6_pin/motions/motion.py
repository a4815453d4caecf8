"""A ground motion: six channels at a uniform time step, accelerations or displacements, in SI."""

import logging
from dataclasses import dataclass

import numpy as np

from ..core.errors import MotionError
from ..core.names import AXES
from .target_spectrum import TargetSpectrum

__all__ = ["AXES", "QUANTITIES", "GroundMotion", "make_motion"]

_log = logging.getLogger(__name__)

QUANTITIES = ("acceleration", "displacement")


@dataclass(frozen=True, eq=False)
class GroundMotion:
    """A ground motion as recorded or generated, perhaps adjusted (`adjust`), before any processing for the table.

    `samples` has shape (n, 6) in the order of `AXES`: accelerations [m/s^2, rad/s^2] or displacements
    [m, rad] according to `quantity`; rotations are Euler angles and their second derivatives. Sample j is at
    time j `time_step` [s]. The array is made read-only.

    Raises MotionError for a wrong shape, a value that is not finite, or an impossible time step.
    """

    name: str
    time_step: float  # [s]
    samples: np.ndarray  # (n, 6)
    quantity: str  # one of QUANTITIES
    source: str
    time_scale: float = 1.0  # its duration over that of the recorded motion
    spectrum: TargetSpectrum | None = None  # to which it was made or matched

    def __post_init__(self) -> None:
        """Check quantity, time step and samples."""
        if self.quantity not in QUANTITIES:
            raise MotionError(f"{self.name}: quantity is {self.quantity!r}; use one of {', '.join(QUANTITIES)}")
        if not (np.isfinite(self.time_step) and self.time_step > 0):
            raise MotionError(f"{self.name}: time step is {self.time_step} s; it must be positive")
        samples = np.array(self.samples, dtype=float)
        if samples.ndim != 2 or samples.shape[1] != len(AXES):
            raise MotionError(
                f"{self.name}: samples have shape {samples.shape}; give (n, 6), one column for each of {AXES}"
            )
        if len(samples) < 2:
            raise MotionError(f"{self.name}: {len(samples)} sample(s); a motion needs at least 2")
        bad = np.argwhere(~np.isfinite(samples))
        if len(bad):
            row, column = bad[0]
            raise MotionError(
                f"{self.name}: channel {AXES[column]}, sample {row} (t = {row * self.time_step:g} s) is "
                f"{samples[row, column]}; repair or cut the record there ({len(bad)} such values in all)"
            )
        samples.flags.writeable = False
        object.__setattr__(self, "samples", samples)

    @property
    def time(self) -> np.ndarray:
        """Sample times (n,) [s], from zero."""
        return np.arange(len(self.samples)) * self.time_step

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return (len(self.samples) - 1) * self.time_step

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that move at all."""
        return tuple(axis for axis, column in zip(AXES, self.samples.T, strict=True) if column.any())


def make_motion(
    name: str, time_step: float, channels: dict[str, np.ndarray], quantity: str, source: str
) -> GroundMotion:
    """Motion from channels (n,) by axis name, cut to the shortest with a warning; the other axes do not move."""
    unknown = sorted(set(channels) - set(AXES))
    if unknown:
        raise MotionError(f"{name}: no axis {', '.join(unknown)}; axes are {', '.join(AXES)}")
    count = min(map(len, channels.values()))
    if any(len(channel) > count for channel in channels.values()):
        _log.warning("%s: channels differ in length; cut to %d samples", name, count)
    samples = np.zeros((count, len(AXES)))
    for axis, channel in channels.items():
        samples[:, AXES.index(axis)] = channel[:count]
    return GroundMotion(name, time_step, samples, quantity, source)
