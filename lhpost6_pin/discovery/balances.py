"""Balances on held-out tests: what models leave of the measured forces and flows of tests that were not searched.

Three models as in `held_out`, each with its sensor errors. Per kind of residual: the normalised RMS error in units of
the expected scatter (sensor noise, and what the form of friction and the oil's temperature leave open); of the wrench
also the error of its forces over the measured actuator forces, and the share R2 of their variance explained, over the
band that is compared, without the mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array, Complex, Mask
from ..identification.calibration.fit import Solution
from ..identification.calibration.measured_wrench import measured_bins
from ..identification.calibration.operating_point import OperatingPoint
from ..identification.calibration.problem import Problem
from ..identification.calibration.whitened_residuals import mean_squares, negative_log_likelihood

__all__ = ["Balance", "HeldOut", "evaluate_balances", "gain_on", "residual_at"]


@dataclass(frozen=True)
class Balance:
    """One kind of residual of one held-out test: (delivered, refitted, with the effects)."""

    kind: str
    test: str
    error: tuple[float, float, float]  # normalised RMS, 1 is the expected scatter
    share: tuple[float, float, float] | None = None  # RMS error over RMS measured, of the wrench
    explained: tuple[float, float, float] | None = None  # R2 of the wrench
    slip_known: float = 1.0  # share of the test that the wrench is compared in: where friction's slip is known


class HeldOut(NamedTuple):
    """The held-out tests by one model: evaluated, and their whitened residual."""

    base: OperatingPoint
    whitened: list[Complex]  # (m, c) of every test


def residual_at(held: Problem, solution: Solution | None = None) -> HeldOut:
    """Held-out residuals of a solution of the search; without one, as delivered, with sensors as stated.

    What friction holds at the start of tests is taken out as it acts on that machine.
    """
    if solution is None:
        problem, x = held.with_machine(held.machine, ()), np.zeros(len(held.unknowns))
    else:
        own = solution.normal.problem
        problem, x = held.with_machine(own.machine, own.parameters), solution.x
    base = OperatingPoint(problem, x)
    return HeldOut(base, problem.restarted(base.plant).residual(base))


def evaluate_balances(held: Problem, three: Sequence[HeldOut]) -> tuple[Balance, ...]:
    """Balances of the held-out tests by three models."""
    found, forces = [], held.rows("wrench", 0, 1, 2)
    for t, test in enumerate(held.tests):
        for kind in held.kinds:
            rows = held.rows(kind)
            if not rows.any():
                continue
            error = [float(np.sqrt(np.mean(np.abs(one.whitened[t][:, rows]) ** 2))) for one in three]
            share, explained, known = None, None, 1.0
            if kind == "wrench" and (left := _left(held, three, t, forces)) is not None:
                share, explained = _three(np.sqrt(left)), _three(1.0 - left)
            if kind == "wrench" and test.weight is not None:
                known = float(test.weight.mean())
            found.append(Balance(kind, test.name, _three(np.array(error)), share, explained, known))
    return tuple(found)


def _left(held: Problem, three: Sequence[HeldOut], t: int, forces: Mask) -> Array | None:
    """Squares of a test's residual force over those of the measured one, by three models; None where that is zero.

    forces are the columns (c,) of the residual along free axes.
    """
    f, base = held.frequency[t], three[0].base
    size = _squares(measured_bins(held, base.plant, base.tests[t], t), f, forces[:6])
    if size == 0.0:
        return None
    plain = [held.bins(one.base.residuals[t], one.base.tests[t])[0] for one in three]
    return np.array([_squares(bins, f, forces) / size for bins in plain])


def _squares(bins: Complex, f: Array, columns: Mask) -> float:
    """Sum of squares of some columns of bins (m, c) above zero frequency."""
    return float(np.sum(np.abs(bins[f > 0.0][:, columns]) ** 2))


def _three(values: Array) -> tuple[float, float, float]:
    first, second, third = values.tolist()
    return first, second, third


def gain_on(held: Problem, before: HeldOut, after: HeldOut, rows: Mask) -> tuple[float, float]:
    """Gain of log-likelihood on the held-out tests in some columns (c,), and the gain expected of the true effect.

    Expected is what the change of the residual would gain if it were the missing part of it: half its square over the
    power of the residual before.
    """
    gain = expected = 0.0
    for old, new, f in zip(before.whitened, after.whitened, held.frequency, strict=True):
        means, counts = mean_squares(held.whitener, np.abs(old[:, rows]) ** 2, f)
        then, _ = mean_squares(held.whitener, np.abs(new[:, rows]) ** 2, f)
        change, _ = mean_squares(held.whitener, np.abs(new[:, rows] - old[:, rows]) ** 2, f)
        gain += float(np.sum(negative_log_likelihood(means, counts) - negative_log_likelihood(then, counts)))
        expected += float(np.sum(counts @ (change / np.maximum(means, 1.0))))
    return gain, expected
