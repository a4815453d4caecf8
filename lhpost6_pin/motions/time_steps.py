"""Time steps of ground-motion files: a uniform step from time stamps, or values brought to one."""

import numpy as np

from ..core.errors import MotionError
from ..core.rounding import rounding_of

__all__ = ["even_out", "uniform_step"]

_UNIFORM = 0.01  # a step may differ from the median by this part of it: room for times printed with few digits


def uniform_step(time: np.ndarray, where: str, stated: float | None = None) -> float:
    """Step [s] of uniform times (n,); raises MotionError for other times, or where the `stated` step [s] differs.

    Steps are compared with their median, which a gap does not move.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # absurd times are caught below
        mean = (time[-1] - time[0]) / (len(time) - 1)
        usual = float(np.median(np.diff(time)))
        uneven = ~(np.abs(np.diff(time) - usual) <= _UNIFORM * usual)
    if not (np.isfinite(mean) and mean > 0):
        raise MotionError(f"{where}: time runs from {time[0]:g} s to {time[-1]:g} s; it must increase")
    if uneven.any():
        rounding = np.minimum(rounding_of(time), 0.25 * usual)
        if step := _rounded_step(time, np.maximum(rounding, _UNIFORM * usual)):
            mean, uneven = step, np.zeros(1, bool)
        else:
            beyond = np.abs(np.diff(time) - usual) > np.maximum(rounding[1:] + rounding[:-1], _UNIFORM * usual)
            uneven = beyond if beyond.any() else uneven
    if uneven.any():
        sample = int(np.argmax(uneven)) + 1
        here, before = float(time[sample]), float(time[sample - 1])
        raise MotionError(
            f"{where}: time step before sample {sample} (t = {here:g} s) is {here - before:g} s, "
            f"the median is {usual:g} s; resample the record to a uniform step"
        )
    if stated is not None and not abs(stated - mean) <= _UNIFORM * mean:
        raise MotionError(f"{where}: its time column has steps of {mean:g} s, not {stated:g} s; leave --dt out")
    return float(mean)


def _rounded_step(time: np.ndarray, rounding: np.ndarray) -> float:
    """Step [s] of times (n,) that are uniform but for a `rounding` (n,) of their digits; zero of others."""
    count = np.arange(len(time))
    step, start = np.polyfit(count, time - time[0], 1)
    return float(step) if (np.abs(time - time[0] - start - step * count) <= rounding).all() else 0.0


def even_out(time: np.ndarray, values: np.ndarray, where: str) -> tuple[float, np.ndarray]:
    """Mean step [s] of increasing times (n,), and values (n,) at uniform times, by linear interpolation.

    For digitised film records, whose steps differ by design. Raises MotionError naming the sample at which
    time does not increase.
    """
    falls = ~(np.diff(time) > 0)
    if falls.any():
        k = int(np.argmax(falls)) + 1
        raise MotionError(
            f"{where}, sample {k}: time does not increase, {time[k]:g} s after {time[k - 1]:g} s; the file is damaged: "
            "download it again"
        )
    even = np.linspace(time[0], time[-1], len(time))
    return float(even[-1] - even[0]) / (len(even) - 1), np.interp(even, time, values)
