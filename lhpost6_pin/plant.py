"""The plant: a machine made ready to evaluate; tables for compiled code, the Pinocchio model, the zero state."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .effects import effect_table, state_names
from .ports import PLATEN_PORTS, body_table, leg_table, port_names
from .rigid_body import free_axes, make_model

if TYPE_CHECKING:
    from .machine import Machine

__all__ = ["Plant", "State", "make_plant"]

Array = NDArray[np.float64]


class State(NamedTuple):
    """State of a plant: q (nq,), v (nv,) as `rigid_body.make_model` orders them, hidden z (n_states,)."""

    q: Array
    v: Array
    z: Array


@dataclass(frozen=True)
class Plant:
    """Tables of a machine for compiled code, beside its Pinocchio model. Treat the arrays as read only."""

    machine: "Machine"
    model: Any
    axes: NDArray[np.int64]  # (n_axes,) free twist components of the platen
    legs: NDArray[np.void]  # ports.LEG, actuators then struts
    body: NDArray[np.void]  # ports.BODY, one row
    rows: NDArray[np.void]  # effects.ROW
    ports: tuple[str, ...]  # those that its arrays hold; the platen's only where an effect acts on them
    states: tuple[str, ...]
    supply: Array  # (2,) supply and return pressure [Pa]
    delays: Array  # (n_actuators,) valve delay [s]

    @property
    def spools(self) -> int:
        """Number of valve spools, one an actuator."""
        return len(self.machine.actuators)

    @property
    def articulated(self) -> bool:
        """Whether a specimen on the platen moves on joints of its own."""
        return bool(self.model.nv > self.axes.size)

    def zero_state(self) -> State:
        """State in the control zero-position at rest with all hidden states zero (no pressure)."""
        q = pin.neutral(self.model)
        if self.machine.motion == "free":
            q[:3] = self.machine.platen.centre_of_gravity
        return State(q, np.zeros(self.model.nv), np.zeros(len(self.states)))

    def state_index(self, effect: str, port: str, state: str) -> int:
        """Number of a hidden state by effect, port and name."""
        return self.states.index(f"{effect}.{port}.{state}")


def make_plant(machine: "Machine") -> Plant:
    """Build tables and model of a machine; raises ParameterError or UnknownNameError."""
    ports = port_names(machine)
    effects = (*machine.effects, *machine.alterations)
    rows = effect_table(effects, ports)
    if len(rows) and rows["port"].max() < len(ports) - len(PLATEN_PORTS):
        ports = ports[: -len(PLATEN_PORTS)]  # no effect acts on the platen as such: nothing to evaluate there
    return Plant(
        machine=machine,
        model=make_model(machine),
        axes=free_axes(machine),
        legs=leg_table(machine),
        body=body_table(machine),
        rows=rows,
        ports=ports,
        states=state_names(effects),
        supply=np.array([machine.hydraulics.supply_pressure, machine.hydraulics.return_pressure]),
        delays=np.array([a.valve_delay for a in machine.actuators]),
    )
