"""Normal equations of a calibration: summed over tests and columns, corrected for noise, solved within bounds."""

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property

import numpy as np

from ...core.arrays import Array, Complex, Mask
from ...core.progress import Progress
from ...core.threads import by_threads
from ...machine.parameters import Parameters
from ...mechanics.plant import Plant
from .bin_rows import BandSquares, BinRows, bin_rows, row_by_column
from .operating_point import OperatingPoint
from .problem import Problem, Slopes
from .sparse_bins import SparseBins, sparse_bins
from .start_states import StartStates
from .whitened_residuals import excess

__all__ = ["NoiseBias", "NormalEquations", "bounded_step", "bounds_of", "positive"]


class NormalEquations:
    """Normal equations at x, H dx = -g, kept by test and column of the residuals to sum over any subset."""

    def __init__(
        self,
        problem: Problem,
        x: Array,
        report: Progress,
        known: "NormalEquations | None" = None,
        again: Mask | None = None,
        base: OperatingPoint | None = None,
    ) -> None:
        """Evaluate residuals and their derivatives at x (p,), or at the operating point `base` that is there.

        Derivatives by unknowns of `known` are reused, except those to evaluate `again` (p,).
        """
        self.problem, base = problem, base or OperatingPoint(problem, x)
        self.residual = problem.residual(base)
        shared, fresh = _shared(problem, known, again)
        before = [] if known is None else known.slope
        self.slope: list[list[SparseBins]]  # by test and unknown
        self.slope = _together(problem.slopes(base, fresh, report), before, shared)
        self.power = [np.ones(r.shape) for r in self.residual]
        self.bias: NoiseBias | None = None
        if known is not None and not fresh.any() and "rows" in vars(known) and len(known.slope[0]) == len(fresh):
            self.rows, self.squares = known.rows, known.squares

    def _copied(self) -> "NormalEquations":
        """A copy without the sums, which another problem or scale has its own of."""
        other = copy(self)
        _forget_sums(other)
        vars(other).pop("whole", None)
        return other

    def only(self, places: Sequence[int]) -> "NormalEquations":
        """The same of some of the tests, not corrected."""
        other = self._copied()
        other.problem = self.problem.only(places)
        for name in ("residual", "slope", "power"):
            setattr(other, name, [getattr(self, name)[i] for i in places])
        return other

    def scaled(self, problem: Problem, scale: Array) -> "NormalEquations":
        """The same of a problem whose whitened residuals are (t, b, c) times larger, corrected as this."""
        times = [s[problem.whitener.band(f)] for s, f in zip(scale, problem.frequency, strict=True)]
        other = self._copied()
        other.problem = problem
        other.residual = [r * s for r, s in zip(self.residual, times, strict=True)]
        other.slope = [[j.times(s) for j in slopes] for slopes, s in zip(self.slope, times, strict=True)]
        return other if self.bias is None else other.less(self.bias.scaled(times))

    def restarted(self, plant: Plant) -> "NormalEquations":
        """The same with friction's states at the start of tests as they act on a plant."""
        other = self._copied()
        other.problem = self.problem.restarted(plant)
        starts = list(zip(self.problem.starts, other.problem.starts, strict=True))
        other.residual, other.slope = _restarted(starts, self.residual, self.slope)
        if self.bias is None:
            return other
        bias = copy(self.bias)
        bias.problem = other.problem
        pairs = zip(self.bias.residual, self.bias.slope, strict=True)
        bias.residual, bias.slope = map(list, zip(*(_restarted(starts, *one) for one in pairs), strict=True))
        _forget_sums(bias)
        return other.less(bias)

    def reweighed(self, before: Array, now: Array) -> "NormalEquations":
        """The same, weighed by noise whose mean squares (t, b, c) have changed since its weights were set."""
        scale = 1.0 / np.sqrt(np.maximum(1.0 + now - before, 0.25))  # noise has other sources than the sensors
        return self.scaled(self.problem.scaled(scale), scale)

    def less(self, bias: "NoiseBias") -> "NormalEquations":
        """Subtract the noise bias and weigh by the remaining power; call before `whole`, which is cached."""
        self.bias = bias
        self.power = excess(self.problem.whitener, self.residual, self.problem.frequency)
        return self

    @cached_property
    def rows(self) -> list[BinRows]:
        """Rows of the derivatives of every test."""
        return _rows(self.problem, self.slope, self.residual)

    @cached_property
    def squares(self) -> list[BandSquares]:
        """Products of these rows with each other, of every test."""
        return _squares(self.problem, self.rows)

    def released(self) -> "NormalEquations":
        """Itself, without what is kept to sum it again at once, which fills memory."""
        for one in (self, self.bias):
            if one is not None:
                _forget_sums(one)
        return self

    def of(self, tests: Sequence[int], columns: Mask | None = None) -> tuple[Array, Array]:
        """Matrix (p, p) and right side (p,) of some tests and columns (c,), by default all."""
        rows, squares, power = self.rows, self.squares, self._power_by_band

        def of_one(t: int) -> tuple[Array, Array]:
            matrix = squares[t].over(power[t], columns)
            return matrix, _dot(rows[t], self.residual[t], self.power[t], columns)

        matrix, right = self._summed(of_one, tests)
        more, side = self.correction(tests, columns)
        return matrix - more, right - side

    @property
    def _power_by_band(self) -> list[Array]:
        """Power (b, c) of every test, which is constant in a band."""
        problem = self.problem
        return [p[problem.whitener.starts(f)] for p, f in zip(self.power, problem.frequency, strict=True)]

    def _summed(self, function: Callable[[int], tuple[Array, Array]], tests: Sequence[int]) -> tuple[Array, Array]:
        """Sums, in the order of the tests, of the matrix (p, p) and right side (p,) that a function gives for each."""
        count = len(self.slope[0])
        matrix, right = np.zeros((count, count)), np.zeros(count)
        for more, side in by_threads(function, tests, self.problem.jobs):
            matrix += more
            right += side
        return matrix, right

    def right_side(self, residual: Sequence[Complex]) -> Array:
        """Right side (p,) of all tests for whitened bins (m, c) of each in place of its residual, not corrected."""
        return np.sum([_dot(*one, None) for one in zip(self.rows, residual, self.power, strict=True)], axis=0)

    def correction(self, tests: Sequence[int], columns: Mask | None = None) -> tuple[Array, Array]:
        """Contributions of noise to matrix (p, p) and right side (p,), which `of` subtracts; zero if not corrected."""
        if self.bias is None:
            count = len(self.slope[0])
            return np.zeros((count, count)), np.zeros(count)
        each = list(zip(self.bias.rows, self.bias.squares, self.bias.residual, strict=True))  # by replica
        power = self._power_by_band

        def of_one(t: int) -> tuple[Array, Array]:
            matrix = sum(squares[t].over(power[t], columns) for _, squares, _ in each) / len(each)
            right = sum(_dot(rows[t], rest[t], self.power[t], columns) for rows, _, rest in each) / len(each)
            return np.asarray(matrix), np.asarray(right)

        return self._summed(of_one, tests)

    @cached_property
    def whole(self) -> tuple[Array, Array]:
        """Matrix (p, p) and right side (p,) of all tests."""
        return self.of(range(len(self.residual)))

    def posterior(self, prior: Array) -> Array:
        """Matrix (p, p) of all tests with the priors (p,) in it."""
        return positive(self.whole[0], prior) + np.diag(prior**-2.0)

    def alone(self, prior: Array) -> Array:
        """Predicted deviations (n_tests, p) from each test by itself."""
        matrices = [positive(self.of([t])[0], prior) + np.diag(prior**-2.0) for t in range(len(self.residual))]
        return np.array([np.sqrt(np.diag(np.linalg.inv(m))) for m in matrices])


class NoiseBias:
    """Bias of the normal equations by noise: the mean product of its changes in slopes and residuals."""

    def __init__(
        self, normal: NormalEquations, x: Array, reports: Sequence[Progress], known: NormalEquations | None = None
    ) -> None:
        """Evaluate the same at x for every replica of the problem, each with more noise in the tests.

        Changes of derivatives by unknowns of `known`, which is corrected, are reused.
        """
        self.problem, (shared, fresh) = normal.problem, _shared(normal.problem, known)
        self.residual: list[list[Complex]] = []  # by replica and test
        self.slope: list[list[list[SparseBins]]] = []
        for i, (replica, report) in enumerate(zip(normal.problem.replicas, reports, strict=True)):
            base = OperatingPoint(replica, x)
            self.residual.append([r - r0 for r, r0 in zip(replica.residual(base), normal.residual, strict=True)])
            noisy = zip(replica.slopes(base, fresh, report), normal.slope, strict=True)
            count = normal.residual[0].shape[1]
            changes = [{k: j.less(clean[k], count) for k, j in slopes.items()} for slopes, clean in noisy]
            before = [] if known is None or known.bias is None else known.bias.slope[i]
            self.slope.append(_together(changes, before, shared))

    def scaled(self, times: Sequence[Array]) -> "NoiseBias":
        """The same with whitened bins (m, c) of each test scaled."""
        other = copy(self)
        other.residual = [[r * s for r, s in zip(rest, times, strict=True)] for rest in self.residual]
        other.slope = [
            [[j.times(s) for j in slopes] for slopes, s in zip(slope, times, strict=True)] for slope in self.slope
        ]
        _forget_sums(other)
        return other

    @cached_property
    def rows(self) -> list[list[BinRows]]:
        """Rows of the changes of derivatives, by replica and test."""
        pairs = zip(self.slope, self.residual, strict=True)
        return [_rows(self.problem, slope, rest) for slope, rest in pairs]

    @cached_property
    def squares(self) -> list[list[BandSquares]]:
        """Products of these rows with each other, by replica and test."""
        return [_squares(self.problem, rows) for rows in self.rows]


def _restarted(
    starts: Sequence[tuple[StartStates, StartStates]],
    residual: Sequence[Complex],
    slope: Sequence[Sequence[SparseBins]],
) -> tuple[list[Complex], list[list[SparseBins]]]:
    """Residuals and derivatives of every test less what its second states at the start explain, not its first."""
    each = list(zip(starts, residual, slope, strict=True))
    rest = [now.less(was.restored(sparse_bins(r))).full(r.shape[1]) for (was, now), r, _ in each]
    return rest, [[now.less(was.restored(j)) for j in slopes] for (was, now), _, slopes in each]


def _forget_sums(one: NormalEquations | NoiseBias) -> None:
    """Drop what is kept of derivatives to sum them again."""
    for name in ("rows", "squares"):
        vars(one).pop(name, None)


def _rows(problem: Problem, slope: Sequence[Sequence[SparseBins]], residual: Sequence[Complex]) -> list[BinRows]:
    """Rows of the derivatives of every test's residual."""
    pairs = list(zip(slope, residual, strict=True))
    return list(by_threads(lambda one: bin_rows(one[0], one[1].shape[1]), pairs, problem.jobs))


def _squares(problem: Problem, rows: Sequence[BinRows]) -> list[BandSquares]:
    """Products of every test's rows with each other."""
    pairs = list(zip(rows, problem.frequency, strict=True))
    return list(by_threads(lambda one: one[0].squares_by_band(problem.whitener.starts(one[1])), pairs, problem.jobs))


def _shared(problem: Problem, known: NormalEquations | None, again: Mask | None = None) -> tuple[dict[int, int], Mask]:
    """Places in `known` by places in the problem, of unknowns to reuse; and which (p,) to evaluate.

    The latter are those `again`, if given; else those that `known` lacks.
    """
    names = problem.names
    place = {} if known is None else {name: i for i, name in enumerate(known.problem.names)}
    fresh = np.array([name not in place for name in names]) if again is None else again
    return {i: place[name] for i, name in enumerate(names) if name in place and not fresh[i]}, fresh


def _together(
    fresh: Sequence[Slopes], known: Sequence[Sequence[SparseBins]], shared: dict[int, int]
) -> list[list[SparseBins]]:
    """Derivatives of every test by all unknowns, in order: fresh, or from those known."""
    found = []
    for t, slopes in enumerate(fresh):
        both = slopes | {i: known[t][k] for i, k in shared.items()}
        found.append([both[i] for i in sorted(both)])
    return found


def _dot(rows: BinRows, rest: Complex, power: Array, columns: Mask | None) -> Array:
    """Right side (p,) of a test's rows over a power (m, c), of some columns (c,) or all."""
    row = row_by_column(rest, power)
    return rows.dot(row if columns is None else row * columns[:, None])


def positive(matrix: Array, prior: Array) -> Array:
    """A normal matrix without its negative eigenvalues, which arise where a derivative is only noise."""
    value, vector = np.linalg.eigh(matrix * np.outer(prior, prior))
    return (vector * np.maximum(value, 0.0)) @ vector.T / np.outer(prior, prior)


def bounds_of(problem: Problem, numbers: Parameters) -> tuple[Array, Array]:
    """Lower and upper bounds (p,) of the unknowns: their own, and the reach of their priors."""
    known = np.arange(len(problem.prior)) < len(problem.parameters)
    reach = np.where(known, numbers.number("fit.reach"), numbers.number("fit.sensor_reach")) * problem.prior
    return np.maximum(-reach, problem.lowest), np.minimum(reach, problem.highest)


def bounded_step(normal: NormalEquations, posterior: Array, x: Array, problem: Problem, numbers: Parameters) -> Array:
    """Gauss-Newton step (p,) from x (p,) within the trust region and the reach of every unknown.

    `posterior` (p, p) is `normal`'s matrix with the prior's share.
    """
    from scipy.optimize import lsq_linear

    prior = problem.prior
    known = np.arange(len(prior)) < len(problem.parameters)
    trust = np.where(known, numbers.number("fit.trust"), numbers.number("fit.sensor_trust"))
    right = normal.whole[1]
    factor = np.linalg.cholesky(posterior * np.outer(prior, prior))
    wanted = np.linalg.solve(factor, -(right + x / prior**2) * prior)
    place = x / prior
    least, most = (bound / prior for bound in bounds_of(problem, numbers))
    low, high = np.maximum(-trust, np.minimum(least - place, 0.0)), np.minimum(trust, np.maximum(most - place, 0.0))
    low, high = low - 1e-9, high + 1e-9  # no empty interval
    freely = np.linalg.solve(factor.T, wanted)
    if np.all((freely >= low) & (freely <= high)):
        return np.asarray(freely * prior)
    step = lsq_linear(factor.T, wanted, bounds=(low, high)).x
    inside = (place >= least) & (place <= most)  # the intervals are a little wider than the bounds: steps would add up
    return np.asarray(np.where(inside, np.clip(step, least - place, most - place), step) * prior)
