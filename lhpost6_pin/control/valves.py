"""Commands per actuator and per servovalve: on the table every servovalve has a drive channel of its own.

The LHPOST6 has ten actuators; with two servovalves open on each horizontal one it takes fourteen commands, H1A, H1B,
H2A ... V6. The model has one spool an actuator: open valves on one actuator act as one whose opening is their mean.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..laws.orifice import opening, spool_for_opening
from ..machine.machine import Machine

__all__ = ["flow_curves", "names_of_valves", "per_actuator", "per_valve", "valve_counts", "valve_names"]

Array = NDArray[np.float64]
Counts = NDArray[np.int64]


def valve_counts(machine: Machine) -> Counts:
    """Number of open servovalves of each actuator (n_actuators,)."""
    return np.array([a.valves for a in machine.actuators])


def valve_names(machine: Machine) -> tuple[str, ...]:
    """Name of each open servovalve, in the order of the actuators (n_valves,)."""
    return names_of_valves(machine.actuator_names, valve_counts(machine))


def names_of_valves(actuators: Sequence[str], counts: Counts) -> tuple[str, ...]:
    """Names of the valves of actuators: an only valve has its actuator's name, others add A, B, ... to it."""
    names: list[str] = []
    for actuator, count in zip(actuators, counts, strict=True):
        names += [actuator] if count == 1 else [f"{actuator}{chr(ord('A') + k)}" for k in range(count)]
    return tuple(names)


def flow_curves(machine: Machine) -> Array:
    """Curvature lambda of each actuator's valve flow (n_actuators,) [1] (Eq. 4-2)."""
    return np.array([a.flow_curve for a in machine.actuators])


def per_valve(command: Array, counts: Counts) -> Array:
    """Commands (n_valves,) of the servovalves from those of their actuators (n_actuators,): twins move alike."""
    return np.repeat(command, counts)


def per_actuator(commands: Array, counts: Counts, curves: Array) -> Array:
    """Commands (n_actuators,) that act like those of the servovalves (n_valves,), -1..1.

    Valves on one actuator share its chambers and its supply: while they open to the same side their flows add up to
    that of their mean opening. Opened to opposite sides (oil runs from supply to return past the actuator) that is an
    approximation. Equal commands come back as they are, to the last bit.
    """
    if len(commands) == len(counts):
        return commands
    first = np.cumsum(counts) - counts
    found = commands[first]
    if np.array_equal(per_valve(found, counts), commands):
        return found
    for i, (at, count) in enumerate(zip(first, counts, strict=True)):
        own = np.clip(commands[at : at + count], -1.0, 1.0)
        if np.any(own != own[0]):
            found[i] = spool_for_opening(float(np.mean([opening(x, curves[i]) for x in own])), curves[i])
    return found
