"""Numbers rounded: down to significant digits, as largest scales that fit; and how far time stamps were."""

from decimal import ROUND_DOWN, Context

import numpy as np

from .arrays import Array

__all__ = ["rounded_down", "rounding_of"]

_FEWEST_DIGITS, _MOST_DIGITS = 4, 9
_WHOLE = 1e-4  # of the last digit: a number so near to a whole one is that


def rounded_down(value: float, digits: int) -> float:
    """A positive value with a number of significant digits, never above it."""
    return float(Context(prec=digits, rounding=ROUND_DOWN).create_decimal(value))


def rounding_of(time: Array) -> Array:
    """Largest rounding errors (n,) [s] of stamps as they are written: in single precision, to decimals, to digits."""
    if np.array_equal(time, time.astype(np.float32)):
        return np.full(len(time), np.spacing(np.float32(np.abs(time).max())), float)
    bound = np.zeros(len(time))
    for decimals in range(_MOST_DIGITS):
        if np.allclose(time, np.round(time, decimals), rtol=0, atol=1e-6 * 10.0**-decimals):
            bound += 0.51 * 10.0**-decimals
            break
    size = np.floor(np.log10(np.maximum(np.abs(time), 10.0**-_MOST_DIGITS)))
    for digits in range(_FEWEST_DIGITS, _MOST_DIGITS):  # as %g writes: fewer decimals from 1, 10, 100 s on
        last = 10.0 ** (size - digits + 1)
        if (np.abs(time / last - np.rint(time / last)) <= _WHOLE).all():
            return np.maximum(bound, 0.51 * last)
    return bound
