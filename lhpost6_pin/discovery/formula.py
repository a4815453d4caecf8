"""Sparse formula of a tabulated function: a sum of a few simple forms.

Forms are of x over its largest value, so that every coefficient has the function's own unit; waves are a pair of sine
and cosine of one length. Forms are added one by one while Schwarz's criterion falls.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.arrays import Array

__all__ = ["Formula", "sparse_formula"]

Form = tuple[Array, tuple[str, ...]]

_MOST = 3  # forms
_SHORTEST = 4.0  # values in a wave, at least


@dataclass(frozen=True)
class Formula:
    """Sum of coefficient times form, and the share of the values' variance that it explains."""

    terms: tuple[tuple[float, str], ...]
    share: float

    def text(self, unit: str) -> str:
        """As one line, such as ``1.2e+04 N sin(2 pi x / 0.08 m)``."""
        return " + ".join(f"{size:.3g} {unit} {form}".rstrip() for size, form in self.terms)


def sparse_formula(x: Array, value: Array, sd: Array, unit: str) -> Formula:
    """Formula of values (n,) with deviations sd (n,) at x (n,), which has a unit."""
    weight = 1.0 / np.maximum(sd, 1e-12 * np.abs(value).max() + 1e-300)
    forms = _forms(x, unit)
    chosen: list[int] = []
    best = _criterion(_fit(forms, chosen, value, weight)[1], 0, len(x))
    while len(chosen) < _MOST:
        trials = []
        for i in range(len(forms)):
            if i not in chosen:
                left = _fit(forms, [*chosen, i], value, weight)[1]
                columns = sum(forms[k][0].shape[1] for k in [*chosen, i])
                trials.append((_criterion(left, columns, len(x)), i))
        least, i = min(trials)
        if least >= best:
            break
        best = least
        chosen.append(i)
    size, left = _fit(forms, chosen, value, weight)
    labels = [label for k in chosen for label in forms[k][1]]
    middle = np.average(value, weights=weight**2)
    whole = float(np.sum((weight * (value - middle)) ** 2))
    share = 1.0 - left / whole if whole > 0.0 else 0.0
    return Formula(tuple(zip(map(float, size), labels, strict=True)), max(0.0, share))


def _forms(x: Array, unit: str) -> list[Form]:
    """Columns (n, 1 or 2) and their names."""
    most = float(np.abs(x).max())
    z, at = x / most, f"(x / {most:.3g} {unit})"
    found: list[Form] = [
        (np.ones((len(x), 1)), ("",)),
        (z[:, None], (at,)),
        ((z * np.abs(z))[:, None], (f"{at} |{at[1:-1]}|",)),
        ((z**3)[:, None], (f"{at}^3",)),
        (np.abs(z)[:, None], (f"|{at[1:-1]}|",)),
        (np.sign(z)[:, None], ("sgn x",)),
        (np.tanh(10.0 * z)[:, None], (f"tanh(10 x / {most:.3g} {unit})",)),
    ]
    span = float(np.ptp(x))
    for length in span / np.arange(1.0, (len(x) - 1) / _SHORTEST + 0.01, 0.25):
        turn = 2.0 * np.pi * x / length
        names = tuple(f"{wave}(2 pi x / {length:.3g} {unit})" for wave in ("sin", "cos"))
        found.append((np.column_stack([np.sin(turn), np.cos(turn)]), names))
    return found


def _fit(forms: Sequence[Form], chosen: list[int], value: Array, weight: Array) -> tuple[Array, float]:
    """Coefficients and the weighted sum of squared residuals."""
    if not chosen:
        return np.zeros(0), float(np.sum((weight * value) ** 2))
    a = np.hstack([forms[k][0] for k in chosen])
    size, *_ = np.linalg.lstsq(a * weight[:, None], value * weight, rcond=None)
    return np.asarray(size, float), float(np.sum((weight * (value - a @ size)) ** 2))


def _criterion(left: float, columns: int, count: int) -> float:
    """Schwarz's criterion, the deviations being known up to a common factor."""
    return count * np.log(max(left, 1e-300) / count) + columns * np.log(count)
