"""What the tests of the library's families share: a short run that moves all axes, and its record as if measured."""

import numpy as np

from lhpost6_pin.identification.prepare import AS_RECORDED, MeasuredTest, prepare_test
from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import OpenLoop, Run, simulate


def record_at_model_steps(machine: Machine, samples: int) -> np.ndarray:
    """Spools (samples, n_actuators) about rest, a sine each, some decimetres and degrees in a second."""
    rest = find_equilibrium(make_plant(machine)).spool
    t = np.arange(samples)[:, None] / 2048
    count = np.arange(len(rest))
    wave = 0.2 * np.minimum(1.0, t / 0.1) * np.sin(2 * np.pi * (0.7 + 0.37 * count) * t + count)
    return rest + wave * [1.0 if a.area_b is not None else 0.15 for a in machine.actuators]


def shaken(machine: Machine, samples: int = 1024, engine: str = "fused") -> Run:
    """Open-loop run from rest that moves all axes, a model step a sample."""
    plant = make_plant(machine)
    drive = OpenLoop(record_at_model_steps(machine, samples), find_equilibrium(plant).state)
    return simulate(plant, drive, samples=samples, engine=engine, steps_per_second=2048)


def measured_of(run: Run) -> MeasuredTest:
    """The run's record, free of noise, ready for residuals."""
    policy = AS_RECORDED._replace(pressure_cutoff=200.0)
    return prepare_test(run.plant, record_of_run(run, {"test": "shaken"}), None, policy)


def rms(columns: np.ndarray) -> np.ndarray:
    """Root mean square of each column, edges left out."""
    return np.sqrt((columns[20:-20] ** 2).mean(axis=0))


def stirred(machine: Machine, engine: str = "fused", samples: int = 600, steps: int = 16, **more: str) -> Run:
    """An open-loop run that moves all axes, from rest."""
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    t, n = np.arange(samples)[:, None] / 2048, plant.spools
    wave = 0.2 * np.sin(2 * np.pi * (3 + np.arange(n) / 2) * t + np.arange(n)) * np.minimum(1.0, 20.0 * t)
    drive = OpenLoop(rest.spool + wave, rest.state)
    return simulate(plant, drive, samples=samples, engine=engine, steps_per_second=2048 * steps, **more)


def as_measured(run: Run) -> MeasuredTest:
    """A run as perfect sensors see it; pressure rates by central differences, spools in the middle of jumps."""
    plant = run.plant
    position = run.spool.copy()
    position[1:] = 0.5 * (run.spool[1:] + run.spool[:-1])
    record = record_of_run(run, {"test": "t"})
    pressure = {name: record[name].values for name in ("chamber_pressure_a", "chamber_pressure_b") if name in record}
    channels = {**pressure, "spool_position": position, "supply_pressure": record["supply_pressure"].values[:, None]}
    rates = {name: np.gradient(x, run.time, axis=0) for name, x in pressure.items()}
    return MeasuredTest("t", 1.0 / 2048, platen_motion(plant, run.q, run.v, run.a), channels, rates)
