"""A plant that runs sample by sample under commands from outside: a link, an FMU, an experiment in Python.

    table = RunningPlant(plant, rest)
    for sample in range(n):
        table.advance(command(table.sensors()))

The compiled stages and their order are those of `simulate` with the Pinocchio engine: results are equal bit by bit.
"""

import logging
import math
from copy import copy
from functools import partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..control.loop import sense_packed
from ..control.plug import Feedback
from ..core.arrays import Array
from ..core.compiled import compiled
from ..core.errors import SimulationError
from ..core.names import SAMPLE_RATE, SCHEMES
from ..effects.supply import supply_pressures
from ..mechanics.coupled import BaseMotion, checked_wrench
from ..mechanics.derivatives import evaluate, evaluate_derivatives
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.gas_pressure import gas_numbers, gas_pressures, gas_ratio
from ..mechanics.interface import base_motion
from ..mechanics.plant import Plant, State
from ..mechanics.schemes import S, V, steps_a_sample
from ..mechanics.specimen_mount import top_placement
from ..mechanics.valve_delay import delayed_spools
from ..mechanics.workspace import make_workspace
from .coupling import Continued, CouplingOptions, CouplingResult, WithOutside, make_coupling
from .readings import INTERFACE, read_packed
from .simulate import diagnosis
from .snapshot import Snapshot, take_snapshot
from .trouble import EmptyChambers

__all__ = ["PressureReading", "RunningPlant"]

log = logging.getLogger(__name__)


class PressureReading(NamedTuple):
    """Pressures and spools of a plant with n actuators and k struts after a sample."""

    a: Array  # (n,) of chambers A [Pa]
    b: Array  # (n,) of chambers B [Pa]; 0 where an actuator has none
    spool: Array  # (n,) spool positions after the valve delay, mean over the sample [1]
    strut: Array  # (k,) of the struts' gas [Pa]
    supply: float  # [Pa]


class RunningPlant:
    """A plant, initially at rest in the pose of `rest`, that takes one command per sample.

    Attributes: plant; sample, number of commands taken; clipped, number of spool values beyond full stroke. What makes
    the motion unphysical is logged as a warning once, and kept in `trouble`.
    """

    def __init__(
        self,
        plant: Plant,
        rest: Equilibrium,
        *,
        scheme: str = SCHEMES[0],
        steps_per_second: int = 4 * SAMPLE_RATE,
        coupling: CouplingOptions | None = None,
        wrench_order: int = 1,
    ) -> None:
        """Start at rest; raises as `schemes.steps_a_sample` and, with a coupled specimen, `coupling.Coupling` do.

        wrench_order: a wrench from outside is held over a sample (0), or continued linearly from its last two (1).
        """
        steps = steps_a_sample(scheme, steps_per_second)
        self.plant, self.scheme, self.steps_per_second = plant, scheme, steps_per_second
        self.sample = self.clipped = 0
        self._empty = EmptyChambers(plant)
        coupled = make_coupling(plant, scheme, steps_per_second, coupling)
        self._coupled = coupled.without_history() if coupled else None
        self._evaluate = self._coupled.evaluate if self._coupled else partial(evaluate_derivatives, plant)
        self._advance = WithOutside(plant, scheme, 1.0 / steps_per_second, self._coupled)
        self._outside: Continued | None = None
        self._order, self._base, self._since = wrench_order, top_placement(plant.machine), 0
        self._ws = make_workspace(plant, rest.state)
        self._place = _places(plant)
        self._window = np.tile(rest.spool, (steps, 1))
        self._history = np.tile(rest.spool, (_remembered(plant), 1))
        self._path, self._gas = plant.command_path, gas_numbers(plant.machine)
        self._packed = plant.tables.packed
        self._evaluate(self._ws, np.ascontiguousarray(rest.spool))

    @property
    def time(self) -> float:
        """Time of the next sample [s]."""
        return self.sample / SAMPLE_RATE

    @property
    def state(self) -> State:
        """Copy of the state at the next sample."""
        return State(self._ws.q.copy(), self._ws.motion[V].copy(), self._ws.z.copy())

    @property
    def spool(self) -> Array:
        """Spool positions (n_actuators,) after the valve delay, mean over the last sample."""
        return np.asarray(self._window.mean(axis=0))

    def sensors(self) -> Feedback:
        """Feedback at the next sample, in new arrays."""
        ws, plant = self._ws, self.plant
        if self.scheme != SCHEMES[0]:  # the other schemes leave the ports of their last stage
            self._evaluate(ws, self._window[0])
        found = Feedback(np.empty(plant.spools), np.empty(6), np.empty(plant.spools))
        sense_packed(plant.tables.packed, ws.buffer, *found)
        return found

    def interface_motion(self) -> BaseMotion:
        """Motion of the platen at C, axes of the platen, at the next sample: what a specimen in another program needs.

        Its acceleration is that of the last model step, as the accelerations of `sensors` are.
        """
        if self.scheme != SCHEMES[0]:
            self._evaluate(self._ws, self._window[0])
        return base_motion(self.plant, self._ws, self._base)

    def pressures(self) -> PressureReading:
        """Chamber pressures, spools, strut pressures and supply pressure at the next sample, in new arrays."""
        plant, z = self.plant, self._ws.z
        first, double = plant.pressure_states
        b = np.where(double, z[first + double], 0.0)
        strut = gas_pressures(self._gas, self._ws.port[S, plant.spools : plant.legs.size])
        if plant.gas_rows.size:
            strut = strut * gas_ratio(plant, z[None])[0]
        return PressureReading(z[first], b, self.spool, strut, float(supply_pressures(plant.supply, z)[0]))

    def readings(self, pressures: bool = False) -> Array:
        """Sensors, the motion of the interface and, if asked for, `pressures`, as `simulation.readings` orders them.

        In a new array; those of the motion are equal to `interface_motion`, and pressures to `pressures`, to rounding.
        Raises SimulationError if one of them is not finite.
        """
        if self.scheme != SCHEMES[0]:
            self._evaluate(self._ws, self._window[0])
        n, struts = self.plant.spools, self._gas.shape[1]
        out = np.empty(6 + 2 * n + INTERFACE + (3 * n + struts + 1 if pressures else 0))
        if not read_packed(self._packed, self._ws.buffer, self._window, self._gas, out):
            raise SimulationError(f"stopped at {self.time:.4f} s: a sensor is not finite")
        return out

    def with_plant(self, plant: Plant) -> "RunningPlant":
        """A running plant that goes on from this state with a plant of the same machine with other effects.

        Motion, sample, commands so far and a wrench from outside are taken over, hidden states by their name; states
        that this plant lacks begin at rest (`Plant.zero_state`). This running plant may go on by itself.
        Raises SimulationError for a plant of another size, and where a specimen is a program, whose state is its own.
        """
        sizes = [(p.model.nq, p.model.nv, p.axes.tolist(), p.spools, p.legs.size) for p in (self.plant, plant)]
        if sizes[0] != sizes[1]:
            raise SimulationError(
                f"a plant of {plant.model.nq} coordinates and {plant.spools} actuators cannot go on from one of "
                f"{self.plant.model.nq} and {self.plant.spools}; give a plant of the same machine and specimen"
            )
        if self._coupled or plant.coupled:
            raise SimulationError("effects cannot be switched while a specimen is a program; mount another form of it")
        found, old = copy(self), self._ws
        found.plant = plant
        found._evaluate = partial(evaluate_derivatives, plant)
        found._advance = WithOutside(plant, self.scheme, 1.0 / self.steps_per_second, None)
        found._empty = EmptyChambers(plant)
        found._empty.trouble = self._empty.trouble
        found._outside = copy(self._outside)
        start = plant.zero_state()
        taken = [(i, at) for i, name in enumerate(plant.states) if (at := self._place.get(name)) is not None]
        start.z[[i for i, _ in taken]] = old.z[[at for _, at in taken]]
        found._place = _places(plant)
        found._ws = make_workspace(plant, State(old.q, old.motion[V], start.z))
        found._ws.external[:] = old.external
        evaluate(plant, found._ws, self._window[-1])  # ports and forces
        found._ws.motion[:] = old.motion  # and the acceleration that the last step ended with
        rows = _remembered(plant)
        earlier = np.repeat(self._history[:1], max(0, rows - len(self._history)), axis=0)
        found._history = np.concatenate([earlier, self._history[-rows:]])
        found._path, found._window = plant.command_path, self._window.copy()
        found._packed = plant.tables.packed
        return found

    @property
    def trouble(self) -> str:
        """From when and why the motion is not physical; empty where it is."""
        return self._empty.trouble

    @property
    def coupling(self) -> CouplingResult | None:
        """What a coupled specimen exchanged so far; its rows are those of the last sample."""
        return self._coupled.result() if self._coupled else None

    def snapshot(self) -> Snapshot:
        """Snapshot of the plant at the next sample."""
        return take_snapshot(self.plant, self._ws, self.time)

    def advance(self, command: Array, wrench: pin.Force | None = None) -> None:
        """Apply the command (n_actuators,) of this sample, -1..1, and advance to the next.

        wrench: on the platen at C in its axes, at the start of the sample, of what is not part of the plant; without it
        the last one is continued over one interval and then kept; at first there is none. Mount the rigid part of a
        heavy specimen and give the rest here (`simulation.coupling`).

        Raises SimulationError for a command or wrench that is not finite, if an actuator or strut leaves its stroke,
        and if the run diverges.
        """
        command = np.ascontiguousarray(command, float)
        clipped = -1
        if command.shape == self._history.shape[1:]:
            clipped = _take_command(command, self.sample, self._path, self._history, self._window)
        if clipped < 0:
            raise SimulationError(f"a command is {self.plant.spools} finite spool values; got {command}")
        self.clipped += clipped
        self._take(wrench)
        status = self._advance(self._ws, self._window, self._outside)
        self.sample += 1
        if self._coupled and self._coupled.trouble:
            raise SimulationError(self._coupled.trouble)
        if status:
            raise SimulationError(diagnosis(self.plant, status, self.time, self.scheme, self.steps_per_second))
        if self._empty.look(self._ws.z, self.time):
            log.warning("the motion %s", self.trouble)

    def _take(self, wrench: pin.Force | None) -> None:
        """Take a wrench from outside at the start of a sample."""
        self._since += 1
        if wrench is not None:
            given = checked_wrench(self, wrench, f"at sample {self.sample}")
            at_b = np.array(self._base.act(given).vector)
            if self._outside is None:
                self._outside, self._since = Continued(at_b, self._order), 0
                self._ws.external[:] += at_b
                self._evaluate(self._ws, self._window[0])  # the acceleration at the start of the sample
            self._outside.take(at_b, self._since / SAMPLE_RATE)
            self._since = 0
        elif self._outside is not None:
            self._outside.later(1.0 / SAMPLE_RATE)


@compiled
def _take_command(command, sample, path, history, window):  # type: ignore[no-untyped-def]
    """Append a command (n_actuators,), clipped, to the history, and fill the window of spools after the valve delay.

    Returns the number of values beyond full stroke; -1, with nothing changed, if one is not finite.
    """
    clipped, last = 0, len(history) - 1
    for x in command:
        if not math.isfinite(x):
            return -1
        clipped += abs(x) > 1.0
    for i in range(command.size):
        x = min(1.0, max(-1.0, command[i]))
        for k in range(last):
            history[k, i] = history[k + 1, i]
        history[last, i] = x
        if sample == 0:  # commands before the first one were equal to it
            history[:, i] = x
            window[:, i] = x
    delayed_spools(history, sample - last, sample, path, float(SAMPLE_RATE), window)
    return clipped


def _remembered(plant: Plant) -> int:
    """Commands that the longest valve delay reaches back to."""
    return int(plant.delays.max() * SAMPLE_RATE) + 4


def _places(plant: Plant) -> dict[str, int]:
    """Places of hidden states by name."""
    return {name: i for i, name in enumerate(plant.states)}
