"""What the tests of inverse dynamics share: runs recorded at every model step, and the motion and forces in them."""

import numpy as np

from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.mechanics.derivatives import evaluate_derivatives
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import PlatenMotion, platen_motion
from lhpost6_pin.mechanics.schemes import A, V
from lhpost6_pin.mechanics.workspace import make_workspace
from lhpost6_pin.simulation.engine_pinocchio import make_stepper
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import Run

RATE = 8192


def shaken(machine: Machine, duration: float = 0.5, rate: int = RATE, size: float = 0.25) -> Run:
    """A semi-implicit run with every model step recorded, all spools moving smoothly by `size` of their stroke."""
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    t = (np.arange(int(duration * rate)) + 0.5) / rate
    k = np.arange(plant.spools)
    rise = np.minimum(1.0, t / 0.2)[:, None] ** 2
    spool = rest.spool + size * rise * np.sin(2 * np.pi * (2.0 + 0.5 * k) * t[:, None] + 2.0 * k)
    ws = make_workspace(plant, rest.state)
    evaluate_derivatives(plant, ws, spool[0])
    advance = make_stepper(plant, "semi_implicit", 1.0 / rate)
    states: list[list[np.ndarray]] = [[], [], [], []]
    for held in spool:
        for log, value in zip(states, (ws.q, ws.motion[V], ws.motion[A], ws.z), strict=True):
            log.append(value.copy())
        assert advance(ws, held[None]) == 0
    time = np.arange(len(spool)) / rate
    return Run(
        plant, time, *map(np.array, states), spool, None, float(rate), "semi_implicit", rate, "pinocchio", 0, None
    )


def motion_of(run: Run) -> PlatenMotion:
    """Motion of C and Euler angles."""
    return platen_motion(run.plant, run.q, run.v, run.a)


def forces_of(run: Run) -> tuple[np.ndarray, np.ndarray | None]:
    """Actuator forces and strut pressures, as the run's record has them."""
    record = record_of_run(run, {"test": "shaken"})
    return record["actuator_force"].values, record["strut_pressure"].values if "strut_pressure" in record else None


def friction_columns(run: Run) -> list[int]:
    """Columns of z that are no chamber pressures."""
    return [i for i, name in enumerate(run.plant.states) if "pressure" not in name]
