"""The arrays that a run works in: made once, changed in place by compiled code."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..effects.registry import PORTS
from .plant import Plant, State
from .schemes import V

__all__ = ["Workspace", "make_workspace"]

Array = NDArray[np.float64]


@dataclass
class Workspace:
    """State and scratch of one running plant; array rows are named in `schemes`."""

    q: Array  # (nq,)
    z: Array  # (n_states,)
    zd: Array  # (n_states,)
    motion: Array  # (6, nv)
    port: Array  # (4, n_ports)
    JB: Array  # (2, n_ports, 6)
    frame: Array  # (8, 3)
    force: Array  # (n_rows, 3)
    supply: Array  # the plant's


def make_workspace(plant: Plant, start: State) -> Workspace:
    """Arrays sized for a plant, holding a copy of the start state."""
    n = len(plant.ports)
    motion = np.zeros((6, plant.model.nv))
    motion[V] = start.v
    return Workspace(
        q=np.array(start.q, float),
        z=np.array(start.z, float),
        zd=np.zeros(len(plant.states)),
        motion=motion,
        port=np.zeros((4, n)),
        JB=np.zeros((2, n, 6)),
        frame=np.zeros((8, 3)),
        force=np.zeros((plant.rows.size, len(PORTS))),
        supply=plant.supply.copy(),
    )
