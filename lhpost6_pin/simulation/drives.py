"""What can drive a run: recorded spools, the 469D, or a user's own controller; and what no run can be made of."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..control import Controller
from ..control.plug import UserController
from ..core.errors import SimulationError, UnknownNameError
from ..core.names import ENGINES
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.plant import Plant, State
from ..mechanics.required_wrench import refuse_joints
from ..mechanics.schemes import steps_a_sample

__all__ = ["ClosedLoop", "Drive", "OpenLoop", "PluggedLoop", "check_drive", "check_options", "check_run"]

Array = NDArray[np.float64]


class OpenLoop(NamedTuple):
    """Drive by spool positions as the ports see them (already delayed): spool (n * k, n_actuators), -1..1.

    k = 1 holds each row over one controller sample; k = steps per sample gives one row a model step.
    """

    spool: Array
    start: State


class ClosedLoop(NamedTuple):
    """Drive by the 469D: drive (n, 6) goes into its reference generators (`Controller.drive_for`).

    With sine cancellers drive is (n, 13): columns 6 to 11 hold the wanted acceleration of C and Euler angles, column 12
    the level, 0 to 1, at which they act.
    """

    controller: Controller
    drive: Array
    rest: Equilibrium


class PluggedLoop(NamedTuple):
    """Drive by a user's own controller (`control.plug`) that wants a motion of C and Euler angles, (n, 6) each."""

    controller: UserController
    displacement: Array
    velocity: Array
    acceleration: Array
    rest: Equilibrium


Drive = OpenLoop | ClosedLoop | PluggedLoop


def check_options(plant: Plant, *, scheme: str, steps_per_second: int, engine: str, plugged: bool = False) -> None:
    """Raise UnknownNameError or SimulationError if no run of a plant can have these options.

    `plugged`: it is driven by a user's own controller.
    """
    steps_a_sample(scheme, steps_per_second)
    if engine not in ENGINES:
        raise UnknownNameError("engine", engine, ENGINES)
    if engine == "fused":
        refuse_joints(plant)
        if plugged:
            raise SimulationError(
                "the fused engine runs compiled controllers; take the engine pinocchio for your own "
                "(--engine pinocchio)"
            )


def check_run(
    plant: Plant, drive: Drive, *, samples: int, scheme: str, rate: int, engine: str, record_every: int
) -> int:
    """Model steps a controller sample; raises UnknownNameError or SimulationError for a run that cannot be."""
    plugged = isinstance(drive, PluggedLoop)
    check_options(plant, scheme=scheme, steps_per_second=rate, engine=engine, plugged=plugged)
    if samples < 1:
        raise SimulationError("nothing to simulate: the drive has no sample")
    if record_every < 1:
        raise SimulationError(f"record_every must be at least 1 (got {record_every})")
    steps = steps_a_sample(scheme, rate)
    if isinstance(drive, OpenLoop):
        if drive.spool.ndim != 2 or drive.spool.shape[1] != plant.spools:
            raise SimulationError(f"spool has shape {drive.spool.shape}; this machine takes (n, {plant.spools})")
        if len(drive.spool) not in (samples, samples * steps):
            raise SimulationError(f"spool has {len(drive.spool)} rows; {samples} or {samples * steps} are needed")
        if not np.all(np.isfinite(drive.spool)):
            at, which = np.argwhere(~np.isfinite(drive.spool))[0]
            raise SimulationError(f"spool of {plant.machine.actuator_names[which]} is not finite at row {at}")
        _check_state(plant, drive.start)
    else:
        check_drive(plant, drive, samples)
    return steps


def check_drive(plant: Plant, drive: ClosedLoop | PluggedLoop, samples: int) -> None:
    """Raise SimulationError if a closed loop was made for another plant, or its motion has not these samples."""
    name = plant.machine.name
    _check_state(plant, drive.rest.state)
    if isinstance(drive, PluggedLoop):
        for quantity in ("displacement", "velocity", "acceleration"):
            _check_shape(f"wanted {quantity}", getattr(drive, quantity), (samples, 6))
        return
    if drive.controller.plant.spools != plant.spools or not np.array_equal(drive.controller.plant.axes, plant.axes):
        raise SimulationError(f"the controller was made for {drive.controller.plant.machine.name}; make one for {name}")
    _check_shape("drive", drive.drive, (samples, drive.controller.columns))


def _check_state(plant: Plant, state: State) -> None:
    sizes = plant.model.nq, plant.model.nv, len(plant.states)
    if any(np.shape(x) != (n,) for x, n in zip(state, sizes, strict=True)):
        raise SimulationError(f"the run would start from a state of another plant than {plant.machine.name}")


def _check_shape(name: str, values: Array, shape: tuple[int, int]) -> None:
    if np.shape(values) != shape:
        raise SimulationError(f"{name} has shape {np.shape(values)}; {shape} is needed")
    if not np.isfinite(values).all():
        at, axis = np.argwhere(~np.isfinite(values))[0]
        raise SimulationError(f"{name} is not finite at sample {at}, column {axis}")
