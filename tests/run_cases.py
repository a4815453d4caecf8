"""Open-loop runs from rest that move all axes, and their records as perfect sensors show them."""

from collections.abc import Iterator, Sequence
from types import ModuleType

import numpy as np
import pytest

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.identification.prepare import AS_RECORDED, MeasuredTest, prepare_test
from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.machine.parameters import override_parameters
from lhpost6_pin.mechanics.derivatives import evaluate_derivatives
from lhpost6_pin.mechanics.equilibrium import Equilibrium, find_equilibrium
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.pose import PlatenMotion, platen_motion
from lhpost6_pin.mechanics.schemes import A, V
from lhpost6_pin.mechanics.workspace import make_workspace
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.engine_pinocchio import make_stepper
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import ClosedLoop, OpenLoop, Run, simulate
from lhpost6_pin.tuning.identify import tuning_numbers

RATE = 8192


def at_rest(machine: Machine) -> tuple[Plant, Equilibrium]:
    plant = make_plant(machine)
    return plant, find_equilibrium(plant)


def closed_loop(plant: Plant, rest: Equilibrium, motion: Sequence[np.ndarray]) -> ClosedLoop:
    """The shipped 469D with a motion as its drive: displacement, velocity, acceleration (n, 6) each."""
    controller = make_controller(plant, rest, load_controller("lhpost6"))
    return ClosedLoop(controller, controller.drive_for(*motion), rest)


def amid_ridgecrest(plant: Plant, rest: Equilibrium, samples: int) -> ClosedLoop:
    """From rest into the strong motion of Ridgecrest."""
    target = make_target(find_motion("ridgecrest"))
    loop = closed_loop(plant, rest, (target.displacement, target.velocity, target.acceleration))
    return loop._replace(drive=np.ascontiguousarray(loop.drive[20 * 2048 : 20 * 2048 + samples]))


def sine_motion(amplitude: Sequence[float], frequency: Sequence[float], duration: float) -> np.ndarray:
    """Sines of C and Euler angles that rise in a second, with velocity and acceleration (3, n, 6)."""
    t = np.arange(int(duration * 2048)) / 2048
    rise = np.clip(t, 0, 1) ** 2 * (3 - 2 * np.clip(t, 0, 1))
    x = np.array(amplitude) * np.sin(2 * np.pi * np.outer(t, frequency)) * rise[:, None]
    v = np.gradient(x, 1 / 2048, axis=0)
    return np.array([x, v, np.gradient(v, 1 / 2048, axis=0)])


def driven(machine: Machine, spool: np.ndarray, engine: str = "fused", steps: int = 4, **more: str) -> Run:
    """Run with spools (samples, n_actuators) moved from their rest by `spool`, `steps` model steps a sample."""
    plant, rest = at_rest(machine)
    drive = OpenLoop(rest.spool + spool, rest.state)
    return simulate(plant, drive, samples=len(spool), engine=engine, steps_per_second=2048 * steps, **more)


def shaken(machine: Machine, samples: int = 1024, engine: str = "fused") -> Run:
    """One model step a sample: some decimetres and degrees in a second."""
    t, k = np.arange(samples)[:, None] / 2048, np.arange(len(machine.actuators))
    wave = 0.2 * np.minimum(1.0, t / 0.1) * np.sin(2 * np.pi * (0.7 + 0.37 * k) * t + k)
    return driven(machine, wave * [1.0 if a.area_b is not None else 0.15 for a in machine.actuators], engine, 1)


def stirred(machine: Machine, engine: str = "fused", samples: int = 600, steps: int = 16, **more: str) -> Run:
    """Faster, in steps that oil columns with modifiers need."""
    t, k = np.arange(samples)[:, None] / 2048, np.arange(len(machine.actuators))
    wave = 0.2 * np.sin(2 * np.pi * (3 + k / 2) * t + k) * np.minimum(1.0, 20.0 * t)
    return driven(machine, wave, engine, steps, **more)


def smooth_spools(t: np.ndarray, count: int, size: float = 0.25) -> np.ndarray:
    """Smooth spool motions (n, count) about zero, 2 to 7 Hz."""
    k = np.arange(count)
    return size * np.minimum(1.0, t / 0.2)[:, None] ** 2 * np.sin(2 * np.pi * (2.0 + 0.5 * k) * t[:, None] + 2.0 * k)


def every_step(machine: Machine, duration: float = 0.5, rate: int = RATE, size: float = 0.25) -> Run:
    """A semi-implicit run with every model step recorded."""
    plant, rest = at_rest(machine)
    spool = rest.spool + smooth_spools((np.arange(int(duration * rate)) + 0.5) / rate, plant.spools, size)
    ws = make_workspace(plant, rest.state)
    evaluate_derivatives(plant, ws, spool[0])
    advance = make_stepper(plant, "semi_implicit", 1.0 / rate)
    states: list[list[np.ndarray]] = [[], [], [], []]
    for held in spool:
        for log, value in zip(states, (ws.q, ws.motion[V], ws.motion[A], ws.z), strict=True):
            log.append(value.copy())
        assert advance(ws, held[None]) == 0
    time, series = np.arange(len(spool)) / rate, map(np.array, states)
    return Run(plant, time, *series, spool, None, float(rate), "semi_implicit", rate, "pinocchio", 0, None)


def motion_of(run: Run) -> PlatenMotion:
    """Motion of C and Euler angles."""
    return platen_motion(run.plant, run.q, run.v, run.a)


def forces_of(run: Run) -> tuple[np.ndarray, np.ndarray | None]:
    """Actuator forces and strut pressures of the run's record."""
    record = record_of_run(run, {"test": "shaken"})
    return record["actuator_force"].values, record["strut_pressure"].values if "strut_pressure" in record else None


def measured_of(run: Run) -> MeasuredTest:
    """The run's record, free of noise, ready for residuals."""
    policy = AS_RECORDED._replace(pressure_cutoff=200.0)
    return prepare_test(run.plant, record_of_run(run, {"test": "shaken"}), None, policy)


def as_measured(run: Run) -> MeasuredTest:
    """The same with pressure rates by central differences and spools in the middle of jumps."""
    position = run.spool.copy()
    position[1:] = 0.5 * (run.spool[1:] + run.spool[:-1])
    record = record_of_run(run, {"test": "t"})
    pressure = {name: record[name].values for name in ("chamber_pressure_a", "chamber_pressure_b") if name in record}
    channels = {**pressure, "spool_position": position, "supply_pressure": record["supply_pressure"].values[:, None]}
    rates = {name: np.gradient(x, run.time, axis=0) for name, x in pressure.items()}
    return MeasuredTest("t", 1.0 / 2048, motion_of(run), channels, rates)


def rms(columns: np.ndarray, edge: int = 20) -> np.ndarray:
    """Root mean square of each column, edges left out."""
    return np.sqrt((columns[edge:-edge] ** 2).mean(axis=0))


def with_tuning_numbers(changes: dict[str, float], *modules: ModuleType) -> Iterator[None]:
    """Give modules numbers of `tuning.toml` with changes, for as long as the generator is not exhausted."""
    numbers = override_parameters(tuning_numbers(), changes)
    with pytest.MonkeyPatch.context() as patch:
        for module in modules:
            patch.setattr(module, "tuning_numbers", lambda: numbers)
        yield
