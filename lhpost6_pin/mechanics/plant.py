"""The plant: a machine made ready to evaluate; tables for compiled code, the Pinocchio model, the zero state."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..core.arrays import Array
from ..effects.modifiers import command_path, supply_of
from ..effects.registry import PORTS, actuator_rows, columns_of, law_of, shapes_of, states_of
from ..effects.table import effect_table, state_names
from ..laws.supply import Supply
from ..machine.machine import Machine
from ..machine.port_names import PLATEN_PORTS, SWIVEL_TURNS, place_of, port_names
from .accelerometers import accelerometer_table
from .coupled import CoupledSpecimen, base_at_rest, rigid_wrench, start_coupled
from .coupled_maker import coupled_specimen
from .forward_dynamics import inertia_table
from .joint_springs import spring_table
from .modes import modal_states, modal_tables
from .ports import body_table, leg_table, place_table
from .rigid_body import free_axes, make_model
from .specimen_mount import base_placement, modal_participation
from .tables import Tables, pack_tables

__all__ = ["MovingRow", "Plant", "RowKey", "State", "make_plant"]

RowKey = tuple[object, ...]
"""Law, ports and numbers of a row: all that its force depends on beside motion and states."""


class State(NamedTuple):
    """State of a plant: q (nq,), v (nv,) as `rigid_body.make_model` orders them, hidden z (n_states,)."""

    q: Array
    v: Array
    z: Array


class MovingRow(NamedTuple):
    """A row of the effect table whose hidden states the motion drives."""

    key: tuple[object, ...]  # all that its states depend on beside the motion
    states: slice
    row: np.void


@dataclass(frozen=True)
class Plant:
    """Tables of a machine for compiled code, beside its Pinocchio model. Treat the arrays as read only."""

    machine: Machine
    model: Any
    axes: NDArray[np.int64]  # (n_axes,) free twist components of the platen
    legs: NDArray[np.void]  # ports.LEG, actuators then struts
    body: NDArray[np.void]  # ports.BODY, one row
    rows: NDArray[np.void]  # registry.ROW
    ports: tuple[str, ...]  # those that its arrays hold; platen's and swivels' only where an effect acts on them
    states: tuple[str, ...]
    supply: Supply  # supply and return pressure [Pa], and how flow changes them
    springs: NDArray[np.void]  # joint_springs.SPRING of a specimen's joints
    modes: NDArray[np.void]  # modes.MODE of a specimen; their states are the last of `states`
    coupling: Array  # (n_modes * n_modes,) damping between modes [1/s], or empty
    delays: Array  # (n_actuators,) valve delay [s]
    lags: Array  # (n_actuators,) time constant [s] with which a spool follows its delayed command
    coupled: CoupledSpecimen | None = None  # specimen that exchanges motion and wrench with the platen

    @cached_property
    def tables(self) -> Tables:
        """All tables as compiled code reads them."""
        inertia = inertia_table(self.model, self.machine, self.axes, self.modes)
        damping, actuators = np.array(self.model.damping), actuator_rows(self.rows)
        sensing = accelerometer_table(self.machine)
        places = place_table(self.machine, self.ports)
        rest = damping, actuators, self.command_path, inertia, self.springs, self.modes, self.coupling, sensing, places
        return pack_tables(self.axes, self.legs, self.body, self.rows, *rest, self.supply)

    @cached_property
    def actuators(self) -> Any:
        """Parameters of the actuators by name (`laws.hydraulic.Hydraulic`), each (n_actuators,)."""
        return columns_of(self.rows[actuator_rows(self.rows)])

    @cached_property
    def pressure_states(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Number of each actuator's hidden state that is pressure A (n_actuators,), and whether B stands behind it."""
        return self.rows["state"][actuator_rows(self.rows)], self.actuators.area_b > 0.0

    @cached_property
    def gas_rows(self) -> NDArray[np.void]:
        """Rows that act on the gas of struts beyond its polytropic law."""
        return self.rows[[law_of(row).acts_on_gas for row in self.rows]]

    @cached_property
    def moving(self) -> tuple["MovingRow", ...]:
        """Rows with hidden states that the motion alone drives."""
        rows = self.rows[(self.rows["state"] >= 0) & (self.rows["spool"] < 0)]
        pairs = zip(rows, shapes_of(rows), strict=True)
        keys = [(int(row["law"]), *(int(row[port]) for port in PORTS), shape.tobytes()) for row, shape in pairs]
        return tuple(MovingRow(key, states_of(row), row) for key, row in zip(keys, rows, strict=True))

    @cached_property
    def keys(self) -> tuple[RowKey, ...]:
        """Key of every row."""
        ports = np.column_stack([self.rows[name] for name in ("law", *PORTS)]).tolist()
        return tuple((*own, numbers.tobytes()) for own, numbers in zip(ports, self.rows["numbers"], strict=True))

    @cached_property
    def feels_load(self) -> bool:
        """Whether a row's force depends on that of the actuator on its leg, so that forces do not add up."""
        return any(law_of(row).feels_load for row in self.rows)

    @cached_property
    def geometry(self) -> bytes:
        """Key of its ports: all that their motion and force columns depend on."""
        body = np.append(self.body["rho_c"], self.body["plane"]).tobytes()
        return body + self.legs.tobytes() + " ".join(self.ports).encode()

    @property
    def spools(self) -> int:
        """Number of valve spools, one an actuator."""
        return len(self.machine.actuators)

    @property
    def command_path(self) -> Array:
        """Delays of valves (n_actuators,) [s], with lags behind if any, as `valve_delay.delayed_spools` takes them."""
        return np.concatenate([self.delays, self.lags]) if self.lags.any() else self.delays

    @cached_property
    def rest_external(self) -> Array:
        """Wrench (6,) at B in platen axes of a coupled specimen at rest, less that of what is rigidly attached."""
        if self.coupled is None:
            return np.zeros(6)
        base, gravity = base_at_rest(self.machine), self.machine.platen.gravity
        _, wrench = start_coupled(self.coupled, base, gravity)
        rest = wrench - rigid_wrench(self.coupled.inertia, base, gravity)
        return np.array(base_placement(self.machine).act(rest).vector)

    @property
    def articulated(self) -> bool:
        """Whether a specimen on the platen moves on joints of its own."""
        return bool(self.model.nv > self.axes.size)

    @property
    def flexible(self) -> bool:
        """Whether a specimen on the platen moves at all, on joints, in modes, or by itself."""
        return self.articulated or self.modes.size > 0 or self.coupled is not None

    def zero_state(self) -> State:
        """State in the control zero-position at rest with all hidden states zero (no pressure)."""
        q = pin.neutral(self.model)
        if self.machine.motion == "free":
            q[:3] = self.machine.platen.centre_of_gravity
        return State(q, np.zeros(self.model.nv), np.zeros(len(self.states)))

    def state_index(self, effect: str, port: str, state: str) -> int:
        """Number of a hidden state by effect, port and name."""
        return self.states.index(f"{effect}.{port}.{state}")


def make_plant(machine: Machine) -> Plant:
    """Build tables and model of a machine; raises ParameterError or UnknownNameError."""
    effects = (*machine.effects, *machine.modifiers)
    places = [port for effect in effects for port in effect.ports if place_of(port) is not None]
    ports = (*port_names(machine.actuators, machine.struts), *dict.fromkeys(places))
    rows = effect_table(effects, ports)
    used = max(rows[port].max() for port in PORTS) if len(rows) else len(ports)
    swivels = sum(port.endswith(SWIVEL_TURNS) for port in ports)
    for end in (len(ports) - swivels, len(ports) - swivels - len(PLATEN_PORTS)):
        if used < end:
            ports = ports[:end]  # no effect acts on the others: nothing to evaluate there
    states = state_names(effects)
    oil = machine.hydraulics
    coupled, specimen = coupled_specimen(machine), machine.specimen
    model = make_model(machine, coupled)
    modes, coupling = modal_tables(specimen.modes if specimen else None, modal_participation(machine))
    delays, lags = command_path(effects, {a.name: a.valve_delay for a in machine.actuators})
    return Plant(
        machine=machine,
        model=model,
        axes=free_axes(machine),
        legs=leg_table(machine),
        body=body_table(machine),
        rows=rows,
        ports=ports,
        states=(*states, *modal_states(modes.size)),
        supply=supply_of(effects, states, oil.supply_pressure, oil.return_pressure),
        springs=spring_table(model, specimen),
        modes=modes,
        coupling=coupling,
        delays=np.array(delays),
        lags=np.array(lags),
        coupled=coupled,
    )
