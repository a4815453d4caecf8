"""Weighted least squares of a machine's parameters and its sensors' errors on the residuals of a campaign.

    minimise  2 sum |W r(x)|^2 + sum (x / prior)^2

r are the residuals in the frequency domain (real and imaginary parts, hence the 2 for unit power), W whitens their
sensor noise. The derivatives J of r are noisy, too, since every term of an equation is measured: plain least squares
would be biased towards zero (errors in variables). The contributions of noise to J^T r and J^T J, known from simulated
draws, are subtracted (corrected normal equations, Fuller: Measurement Error Models, Wiley 1987, chapter 3). Where the
final residual exceeds noise (in a column of a test, in a band), the excess counts as noise: it is weighed less, and
predicted deviations grow. The predicted covariance (`expected_scatter`) has a floor on its deviations.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array, Complex, Mask
from ...core.errors import ParameterError
from ...core.progress import Progress, between, split
from ...data.campaign import SkippedTest
from ...data.sensors import SensorSet
from ...machine.machine import Machine
from ...machine.parameters import Parameters
from ..residuals import RESIDUALS
from .curves import measured_curves
from .expected_scatter import covariance_of_estimate, scatter_factor
from .friction_forms import compare_friction
from .normal_equations import NoiseBias, NormalEquations, bounded_step
from .operating_point import OperatingPoint
from .prepare import prepare_problem
from .problem import Problem
from .result import Calibration, calibration_numbers
from .sensor_errors import removed_of
from .simulated_residuals import by_simulation
from .subset_estimates import subset_estimates
from .whitened_residuals import mean_squares, negative_log_likelihood

__all__ = ["Solution", "calibrate", "misfit", "objective", "objective_at", "solve"]


OVERSHOT = 1000.0
"""Height of the objective over its lowest from which a step is rejected: corrections for noise alone cost hundreds."""

DAMPED = 0.1
"""Share of a step below which a brief search ends: it has not lowered the objective several times."""


def calibrate(
    machine: Machine,
    records: Sequence[xr.Dataset],
    sensors: SensorSet,
    *,
    campaign: str = "campaign",
    skipped: Sequence[SkippedTest] = (),
    seed: int = 0,
    jobs: int = -1,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate a machine jointly by all tests of a campaign.

    Records are of one machine in one state, with the same channels; each may have its own sample rate. Servovalves are
    open as in the first. `skipped` are tests that are not among them (`usable_tests`), for the result. Deterministic
    for a seed (of the simulated noise), independent of the number of `jobs` (cores; -1: all). `progress` is
    called with the share done.

    Raises RecordError for a record that breaks the layout, is of another machine, or was made with a specimen that the
    machine has not; that lacks platen_displacement, or both forces and pressures; that differs from the others in its
    channels; that is too short or too slowly sampled. SimulationError for a specimen with joints.
    """
    numbers, report = calibration_numbers(), progress or (lambda share: None)
    problem = prepare_problem(machine, records, sensors, numbers, seed=seed, jobs=jobs)
    report(0.1)
    found = solve(problem, numbers, np.zeros(len(problem.prior)), between(report, 0.1, 0.8))
    normal, floor = found.normal, numbers.number("fit.floor") * problem.prior
    draws = problem.noisy[: int(numbers.number("simulation.draws")) * len(records)]
    factor, zero = scatter_factor(normal, found.at), np.zeros(len(problem.parameters))
    removed, variance = (np.append(zero, of) for of in removed_of(problem.unknowns, problem.delays))
    subsets = list(subset_estimates(normal, found.at, factor, floor, numbers))
    simulated = by_simulation(problem, draws, found.x, numbers, between(report, 0.8, 1.0))
    subsets += [simulated] if simulated else []
    report(1.0)
    return Calibration(
        machine=problem.machine,
        campaign=campaign,
        skipped=tuple(skipped),
        delays=problem.delays,
        scale=problem.scale,
        tests=tuple(str(r.attrs.get("test", i)) for i, r in enumerate(records)),
        parameters=problem.parameters,
        unknowns=problem.unknowns,
        prior=problem.prior,
        estimate=found.x + removed,
        covariance=covariance_of_estimate(normal, factor) + np.diag(floor**2 + variance),
        alone=np.hypot(normal.alone(problem.prior), floor),
        subsets=tuple(one._replace(estimate=one.estimate + removed) for one in subsets),
        misfit_before=found.misfit_before,
        misfit_after=misfit(problem, found.residual),
        rounds=found.rounds,
        converged=found.converged,
        numbers=numbers,
        curves=measured_curves(
            {
                "as delivered": OperatingPoint(problem, np.zeros(len(found.x))),
                "calibrated": OperatingPoint(problem, found.x),
            }
        ),
        friction=compare_friction(problem, numbers),
    )


class Solution(NamedTuple):
    """Result of a Gauss-Newton search."""

    x: Array  # (p,) the unknowns
    at: Array  # (p,) where the normal equations are from
    normal: NormalEquations
    residual: list[Complex]  # at x: whitened bins (m, c) of every test
    misfit_before: Array  # (n_tests, n_kinds), at the start
    rounds: int
    converged: bool


def solve(
    problem: Problem,
    numbers: Parameters,
    start: Array,
    progress: Progress,
    known: NormalEquations | None = None,
    *,
    first: NormalEquations | None = None,
    frugal: bool = False,
    settled: bool = False,
    near: Mask | bool = False,
) -> Solution:
    """Search from `start` (p,) by Gauss-Newton steps, a rejected step shortened to a quarter.

    A step is rejected where the objective is `OVERSHOT` above its lowest so far, or where its numbers make no machine;
    raises ParameterError if those at `start` make none.
    Steps are half as long after each that does not lower the objective. The search ends where steps are short, or where
    two of them do not change the objective.

    The correction for noise in the derivatives is evaluated in the second step, in a `frugal` search in the first.
    A search that ends higher than it began, from numbers that are `known` to be near, keeps these: noise in derivatives
    may leave equations, once corrected, no root there.

    Derivatives by unknowns of `known`, which is corrected, are reused; `first` are the normal equations at `start`, if
    already evaluated. A frugal search evaluates derivatives by nearly linear unknowns only at `start`, all others while
    steps gain much and nothing is `known`; a `settled` one only those that `known` lacks, and those `near` (p,) them.
    It ends where a step gains little, or steps have become short by not lowering the objective. With few unknowns no
    search is frugal, though a settled one ends so.
    """
    brief = frugal and (settled or len(start) > numbers.number("fit.few"))
    frugal = frugal and len(start) > numbers.number("fit.few")
    x, at, step = start.copy(), start, np.zeros(len(start))
    rounds, floor = int(numbers.number("fit.rounds")), numbers.number("fit.floor") * problem.prior
    fresh = np.array([known is None or name not in known.problem.names for name in problem.names])
    again = problem.bent if frugal and not settled else fresh | near | (not frugal)
    gain = np.inf  # of the last step, of log-likelihood and log-prior
    bias: NoiseBias | None = None
    held: NormalEquations | None = None  # at `at`, where the last step began
    least, last = np.inf, np.inf  # objective: the lowest, and that at the last step
    damped, quiet, converged, replicas = 1.0, 0, False, len(problem.again)
    flat = numbers.number("fit.flat")
    parts = split(progress, rounds + replicas)
    for done in range(1, rounds + 1):
        part = parts[0 if done == 1 else done - 1 + replicas]
        if held is None:
            normal = first or NormalEquations(problem, x, part, known, None if settled else fresh | again)
            before = misfit(problem, normal.residual)
        else:
            base = _possible(problem, x)
            if base is None or objective(problem, problem.residual(base), x) > least + OVERSHOT:
                step = 0.25 * step
                x = at + step
                continue
            renewed = not frugal or (
                (settled or known is None)
                and gain > numbers.number("fit.renew")
                and done <= int(numbers.number("fit.renewals"))
            )
            normal = NormalEquations(problem, x, part, held, again if renewed else np.zeros_like(again), base)
        if bias is None and done >= (1 if frugal else 2):  # close to the solution, and kept afterwards
            bias = NoiseBias(normal, x, parts[1 : 1 + replicas], known)
        if bias is not None and (done > 1 or known is not None):
            normal = normal.less(bias)
        value = objective(problem, normal.residual, x)
        if held is None:
            begin, begun = value, normal
        quiet = quiet + 1 if abs(value - last) < flat else 0
        damped *= 0.5 if value > last else 1.0  # else steps may go to and fro where the objective is flat
        least, last, held, at = min(least, value), value, normal, x
        posterior = normal.posterior(problem.prior)
        step = bounded_step(normal, posterior, x, problem, numbers)
        slope = normal.whole[1] + x / problem.prior**2
        gain = -float(slope @ step + 0.5 * step @ posterior @ step)
        sd = np.sqrt(np.diag(np.linalg.inv(posterior)) + floor**2)
        still = np.max(np.abs(step) / sd) < numbers.number("fit.converged")
        step = damped * step
        x = x + step
        spent = brief and (gain < numbers.number("fit.still") or damped < DAMPED)
        if quiet == 2 or (done > 1 and (still or spent)):
            converged = True
            break
    assert held is not None
    base = _possible(problem, x)
    rest = held.residual if base is None else problem.residual(base)
    end = np.inf if base is None else objective(problem, rest, x)
    if end > least + OVERSHOT:
        x, rest, end = at, held.residual, last
    if known is not None and end > begin:
        x, at, held, rest = start, start, begun if bias is None else begun.less(bias), begun.residual
    return Solution(x, at, held.released(), rest, before, done, converged)


def _possible(problem: Problem, x: Array) -> OperatingPoint | None:
    """The operating point at x (p,); None where its numbers make no machine, such as one without inertia."""
    try:
        return OperatingPoint(problem, x)
    except ParameterError:
        return None


def objective_at(problem: Problem, x: Array) -> float:
    """The objective at x (p,); infinite where its numbers make no machine."""
    base = _possible(problem, x)
    return np.inf if base is None else objective(problem, problem.residual(base), x)


def objective(problem: Problem, rest: Sequence[Complex], x: Array) -> float:
    """Negative log-likelihood and log-prior."""
    means = (mean_squares(problem.whitener, np.abs(r) ** 2, f) for r, f in zip(rest, problem.frequency, strict=True))
    return sum(float(negative_log_likelihood(*m).sum()) for m in means) + 0.5 * float(np.sum((x / problem.prior) ** 2))


def misfit(problem: Problem, whitened: Sequence[Complex]) -> Array:
    """Mean square (n_tests, n_kinds) of whitened residuals; NaN for kinds that have no columns."""
    out = np.full((len(whitened), len(RESIDUALS)), np.nan)
    for t, bins in enumerate(whitened):
        for k, kind in enumerate(RESIDUALS):
            rows = problem.rows(kind)
            if rows.any():
                out[t, k] = np.mean(np.abs(bins[:, rows]) ** 2)
    return out
