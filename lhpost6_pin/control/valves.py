"""Commands per actuator and per servovalve: on the table every servovalve has its own drive channel.

The LHPOST6 has ten actuators; with two servovalves open on each horizontal one it takes fourteen commands, H1A, H1B,
H2A ... V6. The model has one spool per actuator: open valves on one actuator act as one with their mean opening.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..laws.orifice import opening, spool_for_opening
from ..machine.machine import Machine

__all__ = ["per_actuator", "valve_counts", "valve_names"]

Counts = NDArray[np.int64]


def valve_counts(machine: Machine) -> Counts:
    """Number of open servovalves of each actuator (n_actuators,)."""
    return np.array([a.valves for a in machine.actuators])


def valve_names(actuators: Sequence[str], counts: Counts) -> tuple[str, ...]:
    """Names of the valves of actuators: a single valve has its actuator's name, several add A, B, ... to it."""
    names: list[str] = []
    for actuator, count in zip(actuators, counts, strict=True):
        names += [actuator] if count == 1 else [f"{actuator}{chr(ord('A') + k)}" for k in range(count)]
    return tuple(names)


def per_actuator(commands: Array, counts: Counts, curves: Array) -> Array:
    """Commands (n_actuators,) equivalent to those of the servovalves (n_valves,), -1..1.

    Valves on one actuator share its chambers and its supply: while they open to the same side, their flows add up to
    that of their mean opening. For openings to opposite sides (oil bypasses the actuator from supply to return) this is
    an approximation. Equal commands are returned unchanged. `curves`: lambda of each actuator's valves (Eq. 4-2) [1].
    """
    if len(commands) == len(counts):
        return commands
    first = np.cumsum(counts) - counts
    found = commands[first]
    if np.array_equal(np.repeat(found, counts), commands):
        return found
    for i, (at, count) in enumerate(zip(first, counts, strict=True)):
        own = np.clip(commands[at : at + count], -1.0, 1.0)
        if np.any(own != own[0]):
            found[i] = spool_for_opening(float(np.mean([opening(x, curves[i]) for x in own])), curves[i])
    return found
