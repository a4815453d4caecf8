"""Snapshots of a running plant: pose of the platen, and forces along actuators and struts."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..mechanics.plant import Plant
from ..mechanics.pose import platen_motion
from ..mechanics.schemes import A, V
from ..mechanics.workspace import Workspace

__all__ = ["EVERY", "Snapshot", "Watch", "take_snapshot"]

EVERY = 64
"""Controller samples between snapshots: 32 per second."""


class Snapshot(NamedTuple):
    """State of a running plant at one instant."""

    time: float  # [s]
    displacement: Array  # (6,) of C in {s} and Euler angles [m, rad]
    force: Array  # (n_legs,) oil force of actuators, all forces along struts; positive for push [N]


Watch = Callable[[Snapshot], None]
"""Called with a snapshot every `EVERY` samples of a run."""


def take_snapshot(plant: Plant, ws: Workspace, time: float) -> Snapshot:
    """Snapshot of a plant from its workspace at a time [s]."""
    displacement = platen_motion(plant, ws.q[None], ws.motion[V][None], ws.motion[A][None]).displacement[0]
    struts = [ws.force[plant.rows["port"] == i, 0].sum() for i in range(plant.spools, plant.legs.size)]
    return Snapshot(time, displacement, np.array([*ws.force[plant.tables.actuators, 0], *struts]))
