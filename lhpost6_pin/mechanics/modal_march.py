"""Modal states of a specimen along a known motion of the platen, with the one-step rule of the simulation."""

import numpy as np

from ..core.arrays import Array
from ..core.compiled import compiled
from .modes import advance_modes, rest_of_modes
from .plant import Plant
from .ports import platen_pose
from .pose import PlantMotion
from .schemes import set_twist
from .spatial import difference
from .workspace import make_workspace

__all__ = ["march_modes"]


def march_modes(plant: Plant, motion: PlantMotion, dt: float) -> Array:
    """Modal states (n, 2 n_modes) along a motion, one step of dt [s] a sample, from rest under the weight."""
    z = np.zeros((len(motion.q), 2 * plant.modes.size))
    if plant.modes.size:
        z[0] = rest_of_modes(plant.modes, plant.model.gravity.linear)
        _march(np.ascontiguousarray(motion.q), plant.tables, make_workspace(plant, plant.zero_state()), dt, z)
    return z


@compiled
def _march(q, tables, ws, dt, z):
    step = np.zeros(tables.axes.size)
    for k in range(1, q.shape[0]):
        difference(q[k - 1], q[k], tables.axes, step)
        step /= dt
        platen_pose(q[k], tables.axes, tables.body, ws.frame)
        set_twist(step, tables.axes, ws.frame)
        z[k] = z[k - 1]
        advance_modes(tables.modes, tables.coupling, tables.inertia[0].gravity, ws.frame, dt, z[k], ws.modal)
