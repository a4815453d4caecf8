"""Weighted least squares of a machine's knobs and its sensors' errors on the residuals of a campaign.

    minimise  2 sum |W r(x)|^2 + sum (x / prior)^2

r are the residuals in the frequency domain (real and imaginary parts, hence the 2 for unit power), W whitens the noise
that sensors leave in them. Noise is in the derivatives J of r, too, since every term of an equation is measured; then
the sum of squares is least for an equation that is scaled down. The expectations of what noise adds to J^T r and J^T J
are known from draws of simulated noise, and taken off (corrected normal equations, Fuller: Measurement Error Models,
Wiley 1987, chapter 3). Where more than noise is left at the end (in a column of a test's residuals, in a band),
the rest counts as noise, too: it is weighed less, and predicted deviations grow. The inverse of the normal matrix is
the predicted covariance, with a floor under its deviations.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..alignment import align_record, group_delays
from ..errors import RecordError
from ..files import models_folder
from ..fusion import fuse_motion
from ..machine import Machine
from ..parameters import Parameters, load_parameters
from ..plant import Plant, make_plant
from ..pose import PlatenMotion
from ..residuals import RESIDUALS, Measured, make_measured
from ..sensors import Sensors, add_noise
from .errors import SensorUnknown
from .knobs import Knob, with_knobs
from .problem import Comparison, Problem

__all__ = ["Calibration", "Subset", "calibrate", "calibration_numbers"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]
Progress = Callable[[float], None]


class Subset(NamedTuple):
    """What one group of residuals says by itself: estimates (p,) and predicted deviations (p,), NaN where nothing."""

    name: str  # such as "gas law", "flow, horizontal", "wrench, x"
    estimate: Array
    sd: Array


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration; p unknowns: knobs, then sensor errors."""

    machine: Machine
    campaign: str
    tests: tuple[str, ...]
    knobs: tuple[Knob, ...]
    unknowns: tuple[SensorUnknown, ...]
    prior: Array  # (p,) standard deviations
    estimate: Array  # (p,) coordinates
    covariance: Array  # (p, p) predicted
    alone: Array  # (n_tests, p) predicted deviations if there were only that test
    subsets: tuple[Subset, ...]
    misfit_before: Array  # (n_tests, n_kinds) mean square of the whitened residuals, one where only noise is left
    misfit_after: Array
    rounds: int
    converged: bool
    numbers: Parameters = field(repr=False)

    @property
    def sd(self) -> Array:
        """Predicted standard deviations (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return (*(k.name for k in self.knobs), *(u.name for u in self.unknowns))

    @property
    def limit(self) -> float:
        """Predicted deviations beyond which an estimate differs from what it is compared with."""
        return self.numbers.number("report.deviations")

    @property
    def noise_alone(self) -> float:
        """Misfit up to which noise is all that is left."""
        return self.numbers.number("report.misfit")

    @property
    def informed(self) -> Mask:
        """Unknowns (p,) of which the campaign has told something: predicted deviation well below the prior."""
        return np.asarray(self.sd < self.numbers.number("report.informed") * self.prior)

    @property
    def calibrated(self) -> Machine:
        """The machine with its knobs turned to the estimates."""
        return with_knobs(self.machine, self.knobs, self.estimate[: len(self.knobs)])

    def interval(self, i: int, probability: float = 0.9) -> tuple[float, float]:
        """Confidence interval of knob i in its unit."""
        from scipy.stats import norm

        reach = float(norm.ppf(0.5 + 0.5 * probability)) * self.sd[i]
        low, high = (self.knobs[i].at(self.estimate[i] + side * reach) for side in (-1.0, 1.0))
        return min(low, high), max(low, high)

    def alike(self) -> list[tuple[str, str, float]]:
        """Pairs of unknowns that the campaign cannot tell apart, with their correlation, strongest first."""
        sd = self.sd
        correlation = self.covariance / np.outer(sd, sd)
        found = []
        for i, j in np.argwhere(np.triu(np.abs(correlation) >= self.numbers.number("report.alike"), 1)):
            found.append((self.names[i], self.names[j], float(correlation[i, j])))
        return sorted(found, key=lambda pair: -abs(pair[2]))


def calibration_numbers() -> Parameters:
    """Numbers of `models/procedures/calibration.toml`."""
    return load_parameters(models_folder() / "procedures" / "calibration.toml")


def calibrate(
    machine: Machine,
    records: Sequence[xr.Dataset],
    sensors: Sensors,
    *,
    campaign: str = "campaign",
    seed: int = 0,
    jobs: int = -1,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate a machine by the tests of a campaign, all at once.

    Servovalves are open as in the records. Deterministic for a seed (of the simulated noise), whatever the number of
    jobs. Raises RecordError for a record that
    lacks motion, forces and pressures, or was made with a specimen that the machine has not.
    """
    numbers = calibration_numbers()
    report = progress or (lambda share: None)
    _refuse(machine, records)
    machine = machine.with_valves(int(records[0].attrs.get("valves_per_horizontal_actuator", 0)))
    plant = make_plant(machine)
    records = [r.drop_vars("actuator_displacement", errors="ignore") for r in records]
    skews = group_delays(plant, records)
    records = [align_record(r, skews) for r in records]
    rng = np.random.default_rng(seed)
    tests = [_ready(plant, r, sensors, numbers) for r in records]
    count, draws, again = len(tests), *(int(numbers.number(f"fit.{n}")) for n in ("draws", "corrections"))
    noisy = [
        _ready(plant, add_noise(r, sensors, rng), sensors, numbers, shares=False) for _ in range(draws) for r in records
    ]
    more = [_ready(plant, add_noise(r, sensors, rng), sensors, numbers) for _ in range(again) for r in records]
    comparison = Comparison(
        bands=numbers.vector("comparison.bands"),
        edge=numbers.number("comparison.edge"),
        step=numbers.number("fit.step"),
    )
    problem = Problem(machine, tests, noisy, sensors, comparison, jobs=jobs)
    report(0.1)
    replicas = [problem.with_tests(more[k * count : (k + 1) * count]) for k in range(again)]
    rounds, floor = int(numbers.number("fit.rounds")), numbers.number("fit.floor") * problem.prior
    x = np.zeros(len(problem.prior))
    before = _misfit(problem, problem.whitened(x))
    bias: _Bias | None = None
    converged, done = False, 0
    shares = np.linspace(0.1, 1.0, rounds + len(replicas) + 1)
    for done in range(1, rounds + 1):
        at = done - 1 if done == 1 else done - 1 + len(replicas)
        normal = _Normal(problem, x, _between(report, shares[at], shares[at + 1]))
        if done == 2:  # near enough to the end, and the same from there on
            bias = _Bias(
                normal, replicas, x, [_between(report, shares[1 + k], shares[2 + k]) for k in range(len(replicas))]
            )
        if bias is not None:
            normal = normal.less(bias)
        step = _bounded_step(normal, x, problem, numbers)
        x = x + step
        sd = np.sqrt(np.diag(np.linalg.inv(normal.posterior(problem.prior))))
        if done > 1 and np.max(np.abs(step) / sd) < numbers.number("fit.converged"):
            converged = True
            break
    report(1.0)
    covariance = np.linalg.inv(normal.posterior(problem.prior)) + np.diag(floor**2)
    return Calibration(
        machine=machine,
        campaign=campaign,
        tests=tuple(str(r.attrs.get("test", i)) for i, r in enumerate(records)),
        knobs=problem.knobs,
        unknowns=problem.unknowns,
        prior=problem.prior,
        estimate=x,
        covariance=np.asarray(covariance, np.float64),
        alone=np.hypot(normal.alone(problem.prior), floor),
        subsets=_subsets(problem, normal, x - step),
        misfit_before=before,
        misfit_after=_misfit(problem, problem.whitened(x)),
        rounds=done,
        converged=converged,
        numbers=numbers,
    )


def _refuse(machine: Machine, records: Sequence[xr.Dataset]) -> None:
    if not records:
        raise RecordError("no record to calibrate by")
    for record in records:
        test, carried = record.attrs.get("test", "a record"), str(record.attrs.get("specimen", "none"))
        if carried != "none" and machine.specimen is None:
            raise RecordError(f"{test} was made with specimen {carried!r} on the table; mount it with --specimen")


def _ready(plant: Plant, record: xr.Dataset, sensors: Sensors, numbers: Parameters, *, shares: bool = True) -> Measured:
    """A record with its motion fused, and each platen channel's share in it.

    Fusion is linear in its channels: a share is what doubling a channel adds. Lengths stay out: the geometry that turns
    them into a pose is to be calibrated.
    """
    channels = [n for n in ("platen_displacement", "platen_velocity", "platen_acceleration") if n in record]
    fused = fuse_motion(plant, record, sensors)
    ready = make_measured(record, fused.motion, numbers.number("comparison.pressure_cutoff"), path=fused.path)
    share = {}
    for name in channels if shares else ():
        more = fuse_motion(plant, record.assign({name: 2.0 * record[name]}), sensors).motion
        share[name] = PlatenMotion(*(a - b for a, b in zip(more, fused.motion, strict=True)))
    return replace(ready, share=share)


def _between(report: Progress, first: float, last: float) -> Progress:
    return lambda share: report(first + (last - first) * share)


class _Normal:
    """Normal equations at x, H dx = -g: by test and column of the residuals, so that they can be summed as wanted."""

    def __init__(self, problem: Problem, x: Array, report: Progress) -> None:
        self.problem = problem
        self.rest = problem.whitened(x)
        self.slope = problem.slopes(x, np.ones(len(x), bool), report)
        self.power = [np.ones(r.shape) for r in self.rest]
        self.bias: _Bias | None = None

    def less(self, bias: "_Bias") -> "_Normal":
        """The same with what noise adds taken off, and weighed by what is left."""
        self.bias = bias
        self.power = self.problem.excess(self.rest)
        return self

    def of(self, tests: Sequence[int], columns: slice | Mask = slice(None)) -> tuple[Array, Array]:
        """Matrix (p, p) and right side (p,) of some tests and columns."""
        matrix, right = np.zeros(2 * (self.slope[0].shape[-1],)), np.zeros(self.slope[0].shape[-1])
        for t in tests:
            power = self.power[t][:, columns]
            more, side = _squares(self.slope[t][:, columns], self.rest[t][:, columns], power)
            matrix, right = matrix + more, right + side
            if self.bias is not None:
                more, side = self.bias.of(t, columns, power)
                matrix, right = matrix - more, right - side
        return matrix, right

    @cached_property
    def whole(self) -> tuple[Array, Array]:
        """Of all tests."""
        return self.of(range(len(self.rest)))

    def posterior(self, prior: Array) -> Array:
        """Matrix with the priors in it."""
        return _positive(self.whole[0], prior) + np.diag(prior**-2.0)

    def alone(self, prior: Array) -> Array:
        """Predicted deviations (n_tests, p) from each test by itself."""
        found = []
        for t in range(len(self.rest)):
            matrix = _positive(self.of([t])[0], prior) + np.diag(prior**-2.0)
            found.append(np.sqrt(np.diag(np.linalg.inv(matrix))))
        return np.array(found)


class _Bias:
    """What noise adds to the normal equations: the mean product of its changes in slopes and residuals."""

    def __init__(self, normal: _Normal, replicas: Sequence[Problem], x: Array, reports: Sequence[Progress]) -> None:
        free = np.ones(len(x), bool)
        self.changes = []
        for replica, report in zip(replicas, reports, strict=True):
            noisy = zip(replica.whitened(x), replica.slopes(x, free, report), strict=True)
            clean = zip(normal.rest, normal.slope, strict=True)
            self.changes.append([(r - r0, j - j0) for (r, j), (r0, j0) in zip(noisy, clean, strict=True)])

    def of(self, test: int, columns: slice | Mask, power: Array) -> tuple[Array, Array]:
        """Matrix (p, p) and right side (p,) of one test and some columns, over the power of what is left in them."""
        added = [_squares(c[test][1][:, columns], c[test][0][:, columns], power) for c in self.changes]
        matrix, right = (np.mean(x, axis=0) for x in zip(*added, strict=True))
        return matrix, right


def _squares(slope: Complex, rest: Complex, power: Array) -> tuple[Array, Array]:
    j = (slope / np.sqrt(power)[..., None]).reshape(-1, slope.shape[-1])
    return 2.0 * (j.conj().T @ j).real, 2.0 * (j.conj().T @ (rest / np.sqrt(power)).ravel()).real


def _positive(matrix: Array, prior: Array) -> Array:
    """A normal matrix without negative directions, which are left where noise is all that a derivative has."""
    value, vector = np.linalg.eigh(matrix * np.outer(prior, prior))
    return (vector * np.maximum(value, 0.0)) @ vector.T / np.outer(prior, prior)


def _bounded_step(normal: _Normal, x: Array, problem: Problem, numbers: Parameters) -> Array:
    """Gauss-Newton step within the trust region and the reach of every unknown."""
    from scipy.optimize import lsq_linear

    prior = problem.prior
    trust, reach = numbers.number("fit.trust"), numbers.number("fit.reach")
    right = normal.whole[1]
    factor = np.linalg.cholesky(normal.posterior(prior) * np.outer(prior, prior))
    wanted = np.linalg.solve(factor, -(right + x / prior**2) * prior)
    place = x / prior
    least = np.maximum(-reach, problem.lowest / prior)
    low, high = np.maximum(-trust, np.minimum(least - place, 0.0)), np.minimum(trust, np.maximum(reach - place, 0.0))
    low, high = low - 1e-9, high + 1e-9  # no empty interval
    return np.asarray(lsq_linear(factor.T, wanted, bounds=(low, high)).x * prior)


def _misfit(problem: Problem, whitened: Sequence[Complex]) -> Array:
    """Mean square (n_tests, n_kinds) of whitened residuals; NaN for kinds that have no columns."""
    out = np.full((len(whitened), len(RESIDUALS)), np.nan)
    for t, bins in enumerate(whitened):
        for k, kind in enumerate(RESIDUALS):
            if problem.widths[k]:
                out[t, k] = np.mean(np.abs(bins[:, problem.rows(kind)]) ** 2)
    return out


def _subsets(problem: Problem, normal: _Normal, x: Array) -> tuple[Subset, ...]:
    """What gas law, flows of each kind of actuator and wrench along each axis say by themselves, about x.

    Whitening mixes columns with those before them; the order of `RESIDUALS` keeps wrench and flow apart from the rest.
    """
    machine, groups = problem.machine, []
    names, double = machine.actuator_names, machine.double_acting
    for k, axis in enumerate(("x", "y", "z", "roll", "pitch", "yaw")):
        groups.append((f"wrench, {axis}", problem.rows("wrench", k)))
    for kind in dict.fromkeys(a.kind for a in machine.actuators):
        places = [i for i, a in enumerate(machine.actuators) if a.kind == kind]
        places += [len(names) + double.index(names[i]) for i in list(places) if names[i] in double]
        groups.append((f"flow, {kind}", problem.rows("flow", *places)))
    groups.append(("gas law", problem.rows("gas")))
    found = []
    for name, columns in groups:
        if not columns.any():
            continue
        h, g = normal.of(range(len(normal.rest)), columns)
        h = _positive(h, problem.prior)
        covariance = np.linalg.inv(h + np.diag(problem.prior**-2.0))
        sd = np.sqrt(np.diag(covariance))
        estimate = x - covariance @ (g + x / problem.prior**2)
        told = sd < 0.9 * problem.prior
        found.append(Subset(name, np.where(told, estimate, np.nan), np.where(told, sd, np.nan)))
    return tuple(found)
