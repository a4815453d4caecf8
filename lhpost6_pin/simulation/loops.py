"""Loops of a run: open with recorded spools, closed by the 469D or by a user's own controller; and their checks."""

from typing import Any, NamedTuple

import numpy as np

from ..control import Controller
from ..control.plug import UserController
from ..core.arrays import Array
from ..core.errors import SimulationError, UnknownNameError
from ..core.names import ENGINES
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.modes import fastest_mode
from ..mechanics.plant import Plant, State
from ..mechanics.required_wrench import refuse_joints
from ..mechanics.schemes import steps_a_sample

__all__ = ["ClosedLoop", "Loop", "OpenLoop", "PluggedLoop", "check_closed_loop", "check_options", "check_run"]


class OpenLoop(NamedTuple):
    """Given spool positions, after the valve delay: spool (n * k, n_actuators), -1..1.

    k = 1 holds each row over one controller sample; k = steps per sample is one row per model step.
    """

    spool: Array
    start: State


class ClosedLoop(NamedTuple):
    """The 469D with the drive (n, 6) of its reference generators (`Controller.drive_for`).

    With sine cancellers drive is (n, 13): columns 6 to 11 hold the wanted acceleration of C and Euler angles, column 12
    their level, 0 to 1.
    """

    controller: Controller
    drive: Array
    rest: Equilibrium


class PluggedLoop(NamedTuple):
    """A user's own controller (`control.plug`) with its target, motion of C and Euler angles, (n, 6) each."""

    controller: UserController
    displacement: Array
    velocity: Array
    acceleration: Array
    rest: Equilibrium


Loop = OpenLoop | ClosedLoop | PluggedLoop


def check_options(plant: Plant, *, scheme: str, steps_per_second: int, engine: str, plugged: bool = False) -> int:
    """Model steps per controller sample; raises UnknownNameError or SimulationError for invalid options of a plant.

    `plugged`: the loop is closed by a user's own controller.
    """
    if engine not in ENGINES:
        raise UnknownNameError("engine", engine, ENGINES)
    if engine == "fused":
        refuse_joints(plant)
        if plugged:
            raise SimulationError(
                "the fused engine runs compiled controllers; take the engine pinocchio for your own "
                "(--engine pinocchio)"
            )
    steps = steps_a_sample(scheme, steps_per_second)
    fastest = fastest_mode(plant.modes, plant.tables.inertia["inverse"][0])
    if fastest > steps_per_second:
        file = plant.machine.specimen.file.name if plant.machine.specimen else ""
        raise SimulationError(
            f"modes of {file} reach {fastest / (2.0 * np.pi):.0f} Hz on the platen, too fast for {steps_per_second} "
            f"steps a second: take {fastest:.0f} or more (--rate), or leave its stiff modes rigid by highest_frequency"
        )
    return steps


def check_run(plant: Plant, loop: Loop, *, samples: int, record_every: int, **options: Any) -> int:
    """Model steps per controller sample; raises UnknownNameError or SimulationError for an invalid run."""
    steps = check_options(plant, plugged=isinstance(loop, PluggedLoop), **options)
    if samples < 1:
        raise SimulationError("nothing to simulate: the drive has no sample")
    if record_every < 1:
        raise SimulationError(f"record_every must be at least 1 (got {record_every})")
    if not isinstance(loop, OpenLoop):
        check_closed_loop(plant, loop, samples)
        return steps
    if loop.spool.ndim != 2 or loop.spool.shape[1] != plant.spools:
        raise SimulationError(f"spool has shape {loop.spool.shape}; this machine takes (n, {plant.spools})")
    if len(loop.spool) not in (samples, samples * steps):
        raise SimulationError(f"spool has {len(loop.spool)} rows; {samples} or {samples * steps} are needed")
    if not np.all(np.isfinite(loop.spool)):
        at, which = np.argwhere(~np.isfinite(loop.spool))[0]
        raise SimulationError(f"spool of {plant.machine.actuator_names[which]} is not finite at row {at}")
    _check_state(plant, loop.start)
    return steps


def check_closed_loop(plant: Plant, loop: ClosedLoop | PluggedLoop, samples: int) -> None:
    """Raise SimulationError if a closed loop was made for another plant, or has not this number of samples."""
    _check_state(plant, loop.rest.state)
    if isinstance(loop, PluggedLoop):
        for quantity in ("displacement", "velocity", "acceleration"):
            _check_array(f"wanted {quantity}", getattr(loop, quantity), (samples, 6))
        return
    own = loop.controller.plant
    if own.spools != plant.spools or not np.array_equal(own.axes, plant.axes):
        name = plant.machine.name
        raise SimulationError(f"the controller was made for {own.machine.name}; make one for {name}")
    _check_array("drive", loop.drive, (samples, loop.controller.columns))


def _check_state(plant: Plant, state: State) -> None:
    sizes = plant.model.nq, plant.model.nv, len(plant.states)
    if any(np.shape(x) != (n,) for x, n in zip(state, sizes, strict=True)):
        raise SimulationError(f"the run would start from a state of another plant than {plant.machine.name}")


def _check_array(name: str, values: Array, shape: tuple[int, int]) -> None:
    if np.shape(values) != shape:
        raise SimulationError(f"{name} has shape {np.shape(values)}; {shape} is needed")
    if not np.isfinite(values).all():
        at, axis = np.argwhere(~np.isfinite(values))[0]
        raise SimulationError(f"{name} is not finite at sample {at}, column {axis}")
