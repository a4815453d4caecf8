"""Estimates of the parameters by simulation: the plant driven by recorded spools, against the measured motion.

Residuals evaluate each equation separately along the measured motion; a simulation solves all of them together, with
only the spool measured. It is less informative, since oil columns ring on the spool's noise and friction's initial
state is unknown, but it is independent of the noise in the residuals' derivatives. It serves as a second opinion: one
Gauss-Newton step of output errors from the joint estimate, sensor errors held at theirs.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed

from ...core.arrays import Array, Complex
from ...core.names import SAMPLE_RATE
from ...data.signals import resample_band_limited
from ...machine.parameters import Parameters
from ...mechanics.plant import Plant, State, make_plant
from ...mechanics.pose import platen_motion
from ...simulation.simulate import OpenLoop, Run, fastest_engine, simulate
from ..prepare import MeasuredTest
from .bin_rows import bin_rows, row_by_column
from .free_parameters import with_parameters
from .prepare import as_simulated
from .problem import Problem
from .result import Subset
from .sensor_errors import corrected
from .sparse_bins import sparse_bins
from .whitened_residuals import excess, make_whitener, spectrum_of

__all__ = ["by_simulation"]


STEPS = 4  # model steps a controller sample, as simulations take by default


class _RecordedTest(NamedTuple):
    """Spools of a test and the outputs to compare; n samples."""

    spool: Array  # (samples * STEPS, n_actuators) at the middle of every model step
    measured: Array  # (n, 6 + n_chambers) platen velocity, then chamber pressures
    time: Array  # (n,) from zero [s]


def by_simulation(
    problem: Problem, noisy: Sequence[MeasuredTest], x: Array, numbers: Parameters, progress: Callable[[float], None]
) -> Subset | None:
    """Estimates of the parameters by open-loop simulation about x (p,), under the problem's priors; NaN for sensors.

    noisy are draws of the tests in order, any number of times, each with more noise; `numbers` are those of
    `models/procedures/calibration.toml`. NaN where the deviation exceeds `report.informative` of the prior's. None
    without spools and pressures, or if a run fails.
    """
    band, count, tests = numbers.vector("simulation.bands"), len(problem.parameters), len(problem.tests)
    if any(not {"spool_position", "chamber_pressure_a"} <= t.channels.keys() for t in problem.tests):
        return None
    prior, step = problem.prior[:count], problem.comparison.step * problem.prior[:count]
    drives = [_drive(corrected(t, problem.unknowns, x[count:])) for t in problem.tests]

    def plant_at(x: Array) -> Plant:
        machine = with_parameters(problem.machine, problem.parameters, x[:count])
        return make_plant(as_simulated(problem, machine))

    plant = plant_at(x)
    jobs = [(plant, [drive]) for drive in drives]
    jobs += [(plant, [_noisier(drives[i % tests], problem.tests[i % tests], t)]) for i, t in enumerate(noisy)]
    for i, h in enumerate(step):
        turned = x.copy()
        turned[i] += h
        jobs.append((plant_at(turned), drives))

    def errors(plant: Plant, some: Sequence[_RecordedTest]) -> list[Complex] | None:
        """Bins of measured less simulated outputs of each drive; None if a run failed."""
        found = []
        for drive in some:
            if (outputs := _outputs(plant, drive)) is None:
                return None
            found.append(_bins(drive, drive.measured - outputs, problem, band)[0])
        return found

    results: list[list[Complex]] = []
    with Parallel(n_jobs=problem.jobs, prefer="threads", return_as="generator") as parallel:
        for result in parallel(delayed(errors)(*job) for job in jobs):
            progress((len(results) + 1) / len(jobs))
            if result is None:
                return None
            results.append(result)
    rest, drawn, moved = [r[0] for r in results[:tests]], [r[0] for r in results[tests:-count]], results[-count:]
    frequency = [_bins(d, d.measured, problem, band)[1] for d in drives]
    noise = [[more - rest[t] for more in drawn[t::tests]] for t in range(tests)]
    whitener = make_whitener(noise, frequency, np.array(band))
    white = [whitener.apply(t, sparse_bins(rest[t]), f).full(rest[t].shape[1]) for t, f in enumerate(frequency)]
    power = excess(whitener, white, frequency)
    matrix, side = np.diag(prior**-2.0), x[:count] / prior**2
    for t, f in enumerate(frequency):
        slope = np.stack([(m[t] - rest[t]) / h for m, h in zip(moved, step, strict=True)], axis=-1)
        root = np.sqrt(power[t])
        rows = bin_rows([whitener.apply(t, sparse_bins(slope), f)], slope.shape[1]).weighed(root)
        matrix, side = matrix + rows.squares(), side + rows.dot(row_by_column(white[t], root))
    covariance = np.linalg.inv(matrix)
    sd = np.sqrt(np.diag(covariance))
    known, none = sd < numbers.number("report.informative") * prior, np.full(len(x) - count, np.nan)
    estimate = np.where(known, x[:count] - covariance @ side, np.nan)
    sd = np.where(known, np.hypot(sd, numbers.number("simulation.floor") * prior), np.nan)
    return Subset("simulation", np.append(estimate, none), np.append(sd, none), part=False)


def _bins(drive: _RecordedTest, values: Array, problem: Problem, band: tuple[float, ...]) -> tuple[Complex, Array]:
    dt = float(drive.time[-1]) / (len(drive.time) - 1)
    return spectrum_of(values, dt, band[0], band[-1], problem.comparison.edge)


def _drive(test: MeasuredTest) -> _RecordedTest:
    time = np.asarray(test.dt * np.arange(test.samples), np.float64)
    steps = int(time[-1] * SAMPLE_RATE + 1e-6) * STEPS
    middle = (np.arange(steps) + 0.5) / (STEPS * SAMPLE_RATE)
    return _RecordedTest(resample_band_limited(test.channels["spool_position"], time, middle), _measured(test), time)


def _noisier(drive: _RecordedTest, test: MeasuredTest, other: MeasuredTest) -> _RecordedTest:
    """A recorded test with the added noise of another draw."""
    middle = (np.arange(len(drive.spool)) + 0.5) / (STEPS * SAMPLE_RATE)
    more = other.channels["spool_position"] - test.channels["spool_position"]
    noise = [np.interp(middle, drive.time, column) for column in more.T]  # small: linear interpolation will do
    measured = drive.measured + _measured(other) - _measured(test)
    return drive._replace(spool=drive.spool + np.stack(noise, axis=1), measured=measured)


def _measured(test: MeasuredTest) -> Array:
    sides = (f"chamber_pressure_{side}" for side in "ab")
    return np.hstack([test.motion.velocity, *(test.channels[name] for name in sides if name in test.channels)])


def _outputs(plant: Plant, drive: _RecordedTest) -> Array | None:
    """Simulated platen velocity and chamber pressures (n, 6 + n_chambers) at a drive's samples."""
    from scipy.interpolate import CubicSpline

    # pressures in z: chamber A of every actuator, then B of the double-acting
    first = plant.rows["state"][plant.tables.actuators]
    double = [name in plant.machine.double_acting for name in plant.machine.actuator_names]
    states = np.concatenate([first, first[double] + 1])
    zero = plant.zero_state()
    z = zero.z.copy()
    z[states] = drive.measured[0, 6:]
    loop = OpenLoop(drive.spool, State(zero.q, zero.v, z))
    run: Run = simulate(plant, loop, samples=len(drive.spool) // STEPS, engine=fastest_engine(plant))
    if run.trouble:
        return None
    found = np.hstack([platen_motion(plant, run.q, run.v, run.a).velocity, run.z[:, states]])
    return np.asarray(CubicSpline(run.time, found)(np.minimum(drive.time, run.time[-1])))
