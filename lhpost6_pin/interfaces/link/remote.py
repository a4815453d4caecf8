"""The virtual 469D, or a user's own controller, in this process and the plant in another: a run over the link."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.ndimage import binary_opening

from ...control.plug import Feedback, start_plugged
from ...control.valves import valve_counts
from ...core.arrays import Array
from ...core.errors import LinkError
from ...core.names import SAMPLE_RATE
from ...core.progress import Progress
from ...data.records import make_record
from ...machine.machine import Machine
from ...machine.recorded_specimen import specimen_facts
from ...mechanics.coupled import BaseMotion
from ...mechanics.instant import motion_at
from ...mechanics.plant import Plant
from ...mechanics.pose import PlatenMotion
from ...simulation.outputs import reference_channels
from ...simulation.simulate import ClosedLoop, PluggedLoop, check_closed_loop
from .client import LinkClient
from .clock import SECOND, now, undisturbed
from .protocol import LinkMode, PlantState
from .served import MISSED_FRAMES

__all__ = ["LinkRun", "record_of_link_run", "refuse_other_machine", "run_over_link"]

_CHUNK = 1024  # samples between two progress reports
_LEAST = 2  # samples of a record
_MICROMETRE = 1e-6  # [m] more than rounding, less than any pose but the zero-position


@dataclass(frozen=True)
class LinkRun:
    """Result of a run over the link: rows of samples (n,), as the controller received and commanded them.

    A sample that the controller missed repeats the row before it; `answered` is False there.
    """

    command: Array  # (n, n_actuators)
    displacement: Array  # (n, n_actuators)
    acceleration: Array  # (n, 6)
    motion: Sequence[BaseMotion]  # of the platen at C
    force: Array  # (n, n_actuators)
    state: NDArray[np.int8]  # protocol.PlantState
    answered: NDArray[np.bool_]
    tripped: bool
    seconds: float  # from the first command to the last sensors [s]
    lost: str = ""  # how the server fell silent, if it did
    holds: int = 0  # safe holds that the server counted, some too short for the controller to see

    @property
    def trouble(self) -> str | None:
        """Why the motion is not the controller's: no server, the plant tripped, or a safe hold. None where it is."""
        if self.lost:
            return f"lost the server at {len(self.answered) / SAMPLE_RATE:.4f} s: {self.lost}"
        if self.tripped:
            at = f"stopped at {len(self.answered) / SAMPLE_RATE:.4f} s: the plant tripped"
            return f"{at}; an actuator reached the end of its stroke, or the run diverged: see the server"
        silent = binary_opening(~self.answered, np.ones(MISSED_FRAMES, bool))
        held = (self.state == PlantState.HOLD) | silent
        count = int(np.count_nonzero(np.diff(held, prepend=False) & held))
        if not count:
            return None
        count = max(count, self.holds)
        holds, first = f"{count} safe hold{'s'[: count != 1]}", float(held.argmax()) / SAMPLE_RATE
        return (
            f"lost its commands: {holds}, the first at {first:.4f} s; the motion is not the controller's: take "
            "lock-step, or a computer that answers 2048 times a second"
        )


def run_over_link(
    client: LinkClient, plant: Plant, loop: ClosedLoop | PluggedLoop, *, progress: Progress | None = None
) -> LinkRun:
    """Drive the served plant through a motion; `plant` is the controller's model of it.

    Each sample's command answers the newest sensors, with the drive of their sample. Ends early if the plant trips, or
    the server falls silent. Raises SimulationError for an impossible drive, LinkError if the plant is no longer at
    rest, differs from the server's, or the server does not answer from the start.
    """
    _check(client, plant)
    samples = len(loop.drive if isinstance(loop, ClosedLoop) else loop.displacement)
    check_closed_loop(plant, loop, samples)
    step = _stepper(plant, loop)
    rows: dict[str, Array] = {name: np.zeros((samples, plant.spools)) for name in ("command", "displacement", "force")}
    rows |= {"acceleration": np.zeros((samples, 6)), "state": np.zeros(samples, np.int8)}
    answered = np.zeros(samples, np.bool_)
    moved = [client.reading.motion] * samples
    reading, reported, begin, lost = client.reading, 0, 0, ""
    with undisturbed() if client.mode != LinkMode.LOCK_STEP else nullcontext():
        while reading.sample < samples and reading.state != PlantState.TRIPPED:
            at, sensors = reading.sample, reading.sensors
            rows["command"][at] = command = step(at, sensors)
            rows["acceleration"][at], rows["displacement"][at] = sensors.acceleration, sensors.displacement
            moved[at] = reading.motion
            rows["force"][at], rows["state"][at], answered[at] = sensors.force, reading.state, True
            begin = begin or now()
            try:
                reading = client.exchange(command)
            except LinkError as error:
                if answered.sum() < _LEAST:
                    raise
                lost = str(error)
                break
            if progress is not None and at >= reported:
                progress(at / samples)
                reported = at + _CHUNK
        seconds = (now() - begin) / SECOND
    done = int(np.flatnonzero(answered)[-1]) + 1 if answered.any() else 0
    last = np.maximum.accumulate(np.where(answered, np.arange(samples), 0))[:done]
    tripped = reading.state == PlantState.TRIPPED
    kept: dict[str, Any] = {name: row[last] for name, row in rows.items()}
    motion = [moved[at] for at in last]
    return LinkRun(**kept, motion=motion, answered=answered[:done], tripped=tripped, seconds=seconds, lost=lost)


def record_of_link_run(
    run: LinkRun, plant: Plant, attrs: Mapping[str, Any], reference: PlatenMotion | None = None
) -> xr.Dataset:
    """Record of a run over the link: sensors, commands, the platen's motion, and states of the plant.

    reference: target at every sample, if any.
    """
    states = " ".join(f"{s.value} {s.name.lower()}" for s in PlantState)
    one = "1 if a command answered these sensors"
    n = len(run.answered)
    moved = np.array([motion_at(one.pose, one.twist) for one in run.motion]).reshape(n, 2, 6)
    channels: dict[str, Any] = {
        "platen_displacement": moved[:, 0],
        "platen_velocity": moved[:, 1],
        "platen_acceleration": run.acceleration,
        "actuator_displacement": run.displacement,
        "actuator_force": run.force,
        "spool_command": run.command,
        "plant_state": (("time",), run.state, {"units": "1", "long_name": f"state of the served plant: {states}"}),
        "answered": (("time",), run.answered.astype(np.int8), {"units": "1", "long_name": one}),
    }
    facts = {
        "kind": "simulated",
        "machine": plant.machine.name,
        **specimen_facts(plant.machine.specimen),
        "trouble": run.trouble or "none",
    }
    if reference is not None:
        channels |= reference_channels(PlatenMotion(*(x[:n] for x in reference)))
    labels = {"actuator": plant.machine.actuator_names}
    return make_record(np.arange(n) / SAMPLE_RATE, channels, labels, {**facts, **attrs})


def _check(client: LinkClient, plant: Plant) -> None:
    machine = plant.machine
    if client.reading.sample:
        raise LinkError("the plant has moved since this client connected; a run begins at rest: connect again")
    if np.linalg.norm(client.reading.motion.pose.translation) > _MICROMETRE:
        raise LinkError("the served platen is parked; a run begins in the zero-position: serve without --parked")
    refuse_other_machine(client, machine)
    if not np.array_equal(client.counts, valve_counts(machine)):
        raise LinkError(
            f"the server's {client.machine} has {len(client.valves)} servovalves open, the controller's "
            f"{valve_counts(machine).sum()}; choose --valves alike"
        )
    if client.rate != SAMPLE_RATE:
        raise LinkError(f"the server takes {client.rate:g} commands a second; the controller gives {SAMPLE_RATE}")


def refuse_other_machine(client: LinkClient, machine: Machine) -> None:
    """Raise LinkError if the server's machine is not the controller's."""
    if (client.machine, client.actuators) != (machine.name, machine.actuator_names):
        raise LinkError(f"the server's machine is {client.machine}, the controller's {machine.name}; choose --machine")


def _stepper(plant: Plant, loop: ClosedLoop | PluggedLoop) -> Callable[[int, Feedback], Array]:
    """Function that gives the command (n_actuators,) of a sample."""
    if isinstance(loop, ClosedLoop):
        memory = loop.controller.init()
        return lambda sample, sensors: loop.controller.step(memory, sample, loop.drive, sensors)
    command = start_plugged(loop.controller, plant, loop.rest, (loop.displacement, loop.velocity, loop.acceleration))
    return lambda sample, sensors: np.clip(command(sample, sensors), -1.0, 1.0)
