"""Extremes of the columns of long arrays."""

import numpy as np

from .arrays import Array

__all__ = ["extremes", "finite_peaks"]

SIDE_BY_SIDE = 64
"""Rows that are reduced at once: numpy is ten times as slow on rows of few numbers."""


def extremes(values: Array) -> Array:
    """Rows (m, ...) among which are the extremes of the columns of values (n, ...)."""
    whole = len(values) // SIDE_BY_SIDE
    if not whole:
        return values
    wide = values[: whole * SIDE_BY_SIDE].reshape(whole, -1)
    found = [x.reshape(SIDE_BY_SIDE, *values.shape[1:]) for x in (wide.min(axis=0), wide.max(axis=0))]
    return np.concatenate([*found, values[whole * SIDE_BY_SIDE :]])


def finite_peaks(values: Array) -> Array:
    """Greatest finite |value| of each column (n, ...) -> (...); minus infinity for a column without any."""
    few = extremes(values)
    size = np.maximum(few.max(axis=0, initial=-np.inf), -few.min(axis=0, initial=np.inf))
    if np.isfinite(size).all():
        return np.asarray(size)
    return np.asarray(np.where(np.isfinite(values), np.abs(values), -np.inf).max(axis=0, initial=-np.inf))
