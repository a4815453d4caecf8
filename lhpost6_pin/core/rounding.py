"""Numbers rounded down to significant digits: largest scales and amplitudes that fit."""

from decimal import ROUND_DOWN, Context

__all__ = ["rounded_down"]


def rounded_down(value: float, digits: int) -> float:
    """A positive value with a number of significant digits, never above it."""
    return float(Context(prec=digits, rounding=ROUND_DOWN).create_decimal(value))
