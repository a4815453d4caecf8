"""What can be seen of a plant while it runs: where the platen is, and the forces along the legs."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..mechanics.plant import Plant
from ..mechanics.pose import platen_motion
from ..mechanics.schemes import A, V
from ..mechanics.workspace import Workspace

__all__ = ["EVERY", "Snapshot", "Watch", "take_snapshot"]

Array = NDArray[np.float64]

EVERY = 64
"""Controller samples from one snapshot to the next: 32 a second."""


class Snapshot(NamedTuple):
    """One moment of a running plant."""

    time: float  # [s]
    displacement: Array  # (6,) of C in {s} and Euler angles [m, rad]
    force: Array  # (n_legs,) of actuators' oil and of all that acts along a strut; pushes the platen away [N]


Watch = Callable[[Snapshot], None]
"""Called with a snapshot now and then while a plant runs."""


def take_snapshot(plant: Plant, ws: Workspace, time: float) -> Snapshot:
    """The snapshot of a plant whose workspace is at a time [s]."""
    displacement = platen_motion(plant, ws.q[None], ws.motion[V][None], ws.motion[A][None]).displacement[0]
    struts = [ws.force[plant.rows["port"] == i, 0].sum() for i in range(plant.spools, plant.legs.size)]
    return Snapshot(time, displacement, np.array([*ws.force[plant.tables.actuators, 0], *struts]))
