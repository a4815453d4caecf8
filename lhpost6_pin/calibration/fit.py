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
from dataclasses import replace
from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..alignment import align_record, group_delays
from ..errors import RecordError, SimulationError
from ..fusion import fuse_motion
from ..machine import Machine
from ..names import AXES
from ..parameters import Parameters
from ..plant import Plant, make_plant
from ..pose import PlatenMotion
from ..records import channel_name, layout_faults
from ..residuals import RESIDUALS, Measured, make_measured
from ..sensors import Sensors, add_noise
from .errors import CHANNELS
from .normal import Bias, Normal, bounded_step, positive
from .problem import Comparison, Problem
from .result import Calibration, Subset, calibration_numbers
from .simulation import by_simulation
from .spectra import spectrum_of

__all__ = ["calibrate"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Progress = Callable[[float], None]


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

    Records are of one machine in one state, with the same channels; each may have its own sample rate. Servovalves are
    open as in the first. Deterministic for a seed (of the simulated noise), whatever the number of `jobs` (threads; -1:
    one a core). `progress` is called with the share done.

    Raises RecordError for a record that breaks the layout, is of another machine, or was made with a specimen that the
    machine has not; that lacks platen_displacement, or both forces and pressures; that differs from the others in its
    channels; that is too short or too slowly sampled. SimulationError for a specimen with joints.
    """
    numbers = calibration_numbers()
    comparison = Comparison(
        bands=numbers.vector("comparison.bands"),
        edge=numbers.number("comparison.edge"),
        step=numbers.number("fit.step"),
    )
    report = progress or (lambda share: None)
    _refuse(machine, records, comparison)
    machine = machine.as_tested(records[0].attrs, "the first test")
    plant = make_plant(machine)
    records = [r.drop_vars("actuator_displacement", errors="ignore") for r in records]
    skews = group_delays(plant, records)
    records = [align_record(r, skews) for r in records]
    rng = np.random.default_rng(seed)
    tests = [_ready(plant, r, sensors, numbers) for r in records]
    count, draws, again = len(tests), int(numbers.number("fit.draws")), int(numbers.number("fit.corrections"))
    noisy = [
        _ready(plant, add_noise(r, sensors, rng), sensors, numbers, shares=False) for _ in range(draws) for r in records
    ]
    more = [_ready(plant, add_noise(r, sensors, rng), sensors, numbers) for _ in range(again) for r in records]
    problem = Problem(machine, tests, noisy, sensors, comparison, jobs=jobs)
    report(0.1)
    replicas = [problem.with_tests(more[k * count : (k + 1) * count]) for k in range(again)]
    rounds, floor = int(numbers.number("fit.rounds")), numbers.number("fit.floor") * problem.prior
    x = np.zeros(len(problem.prior))
    bias: Bias | None = None
    converged, done = False, 0
    shares = np.linspace(0.1, 0.8, rounds + len(replicas) + 1)
    for done in range(1, rounds + 1):
        at = done - 1 if done == 1 else done - 1 + len(replicas)
        normal = Normal(problem, x, _between(report, shares[at], shares[at + 1]))
        if done == 1:
            before = _misfit(problem, normal.rest)
        if done == 2:  # near enough to the end, and the same from there on
            bias = Bias(
                normal, replicas, x, [_between(report, shares[1 + k], shares[2 + k]) for k in range(len(replicas))]
            )
        if bias is not None:
            normal = normal.less(bias)
        step = bounded_step(normal, x, problem, numbers)
        x = x + step
        sd = np.sqrt(np.diag(np.linalg.inv(normal.posterior(problem.prior))) + floor**2)
        if done > 1 and np.max(np.abs(step) / sd) < numbers.number("fit.converged"):
            converged = True
            break
    covariance = np.asarray(np.linalg.inv(normal.posterior(problem.prior)) + np.diag(floor**2), np.float64)
    told_below = numbers.number("report.told")
    simulated = by_simulation(
        problem,
        noisy[: int(numbers.number("simulation.draws")) * count],
        x,
        band=numbers.vector("simulation.bands"),
        floor=numbers.number("simulation.floor"),
        told_below=told_below,
        progress=_between(report, 0.8, 1.0),
    )
    report(1.0)
    return Calibration(
        machine=machine,
        campaign=campaign,
        tests=tuple(str(r.attrs.get("test", i)) for i, r in enumerate(records)),
        knobs=problem.knobs,
        unknowns=problem.unknowns,
        prior=problem.prior,
        estimate=x,
        covariance=covariance,
        alone=np.hypot(normal.alone(problem.prior), floor),
        subsets=(*_subsets(problem, normal, x - step, floor, told_below), *([] if simulated is None else [simulated])),
        misfit_before=before,
        misfit_after=_misfit(problem, problem.whitened(x)),
        rounds=done,
        converged=converged,
        numbers=numbers,
    )


def _refuse(machine: Machine, records: Sequence[xr.Dataset], comparison: Comparison) -> None:
    """Raise what `calibrate` says, naming the test."""
    if not records:
        raise RecordError("no record to calibrate by")
    if make_plant(machine).articulated:
        raise SimulationError("calibration takes a platen with a rigid specimen at most; lock its joints (--locked)")
    labels = {"actuator": machine.actuator_names, "horizontal": machine.double_acting, "strut": machine.strut_names}
    names = [str(record.attrs.get("test", f"record {i}")) for i, record in enumerate(records, start=1)]
    for test, record in zip(names, records, strict=True):
        if faults := layout_faults(record, labels):
            raise RecordError(f"{test}: {faults[0]}")
        machine.refuse_unmounted(record.attrs, test)
        _refuse_channels(test, record, double_acting=bool(machine.double_acting))
        _refuse_short(test, record, comparison)
        if lacking := [c for c in CHANNELS if c not in record and any(c in other for other in records)]:
            what = f"{test} has no {', '.join(lacking)}, which other tests have"
            raise RecordError(f"{what}; take that test out of the campaign, or the channel out of all")


def _refuse_channels(test: str, record: xr.Dataset, *, double_acting: bool) -> None:
    if "platen_displacement" not in record:
        why = "lengths do not replace it, as the geometry behind them is to be calibrated"
        raise RecordError(f"{test}: has no platen_displacement; {why}")
    if "actuator_force" not in record and "chamber_pressure_a" not in record:
        raise RecordError(f"{test}: has neither actuator_force nor chamber_pressure_a; give one of them or both")
    if double_acting and ("chamber_pressure_a" in record) != ("chamber_pressure_b" in record):
        raise RecordError(f"{test}: has pressures of one side only; give chamber_pressure_a and chamber_pressure_b")
    if "strut_pressure" in record:
        below = np.argwhere(record["strut_pressure"].values <= 0.0)
        for sample, column in below[:1]:
            what = f"{channel_name(record['strut_pressure'], int(column))} is not above zero at sample {sample}"
            raise RecordError(f"{test}: {what}; give absolute pressures, or take the channel out of all tests")


def _refuse_short(test: str, record: xr.Dataset, comparison: Comparison) -> None:
    n, bands = record.sizes["time"], comparison.bands
    length = float(record["time"][-1] - record["time"][0])
    dt = length / (n - 1)
    f = np.zeros(0)
    if n > 2 * round(comparison.edge / dt):
        f = spectrum_of(np.zeros((n, 1)), dt, bands[0], bands[-1], comparison.edge)[1]
    for low, high in pairwise(bands):
        if not np.any((f >= low) & ((f < high) | (f == bands[-1]))):
            what = f"{length:.3g} s at {1 / dt:.4g} Hz leave nothing to compare between {low:g} and {high:g} Hz"
            raise RecordError(f"{test}: {what}; take it out of the campaign")


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


def _misfit(problem: Problem, whitened: Sequence[Complex]) -> Array:
    """Mean square (n_tests, n_kinds) of whitened residuals; NaN for kinds that have no columns."""
    out = np.full((len(whitened), len(RESIDUALS)), np.nan)
    for t, bins in enumerate(whitened):
        for k, kind in enumerate(RESIDUALS):
            if problem.widths[k]:
                out[t, k] = np.mean(np.abs(bins[:, problem.rows(kind)]) ** 2)
    return out


def _subsets(problem: Problem, normal: Normal, x: Array, floor: Array, told_below: float) -> tuple[Subset, ...]:
    """What wrench along each axis, flows of each kind of actuator and gas law say by themselves, about normal's x (p,).

    Whitening mixes columns with those before them; the order of `RESIDUALS` keeps wrench and flow apart from the rest.
    """
    machine, groups = problem.machine, []
    names, double = machine.actuator_names, machine.double_acting
    for k, axis in enumerate(AXES):
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
        h = positive(h, problem.prior)
        covariance = np.linalg.inv(h + np.diag(problem.prior**-2.0))
        sd = np.sqrt(np.diag(covariance))
        estimate = x - covariance @ (g + x / problem.prior**2)
        told = sd < told_below * problem.prior
        found.append(Subset(name, np.where(told, estimate, np.nan), np.where(told, np.hypot(sd, floor), np.nan)))
    return tuple(found)
