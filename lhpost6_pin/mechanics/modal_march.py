"""Modal states of a specimen along a known motion of the platen, with the rule of the simulation."""

import numpy as np

from ..core.arrays import Array
from ..core.compiled import compiled, copy_scaled
from .modes import advance_modes, rest_of_modes
from .plant import Plant
from .ports import platen_pose
from .pose import PlantMotion
from .schemes import set_twist
from .spatial import difference, integrate
from .workspace import make_workspace

__all__ = ["fine_steps", "march_modes"]

_REACH = 0.05
"""Largest step times rate of the midpoint rule: a period errs by its square over twelve."""


def march_modes(plant: Plant, motion: PlantMotion, dt: float, *, substeps: int = 1) -> Array:
    """Modal states (n, 2 n_modes) along a motion sampled every dt [s], from rest under the weight.

    Between samples the twist is constant. substeps = 1 is the rule of a run whose steps are these samples.
    """
    z = np.zeros((len(motion.q), 2 * plant.modes.size))
    if plant.modes.size:
        z[0] = rest_of_modes(plant.modes, plant.model.gravity.linear)
        ws = make_workspace(plant, plant.zero_state())
        _march(np.ascontiguousarray(motion.q), plant.tables, ws, dt, substeps, z)
    return z


def fine_steps(plant: Plant, dt: float) -> int:
    """Substeps of dt [s] at which the midpoint rule errs by less than 2e-4 of the fastest mode's period."""
    fastest = float(np.sqrt(plant.modes["stiffness"].max())) if plant.modes.size else 0.0
    return max(1, int(np.ceil(dt * fastest / _REACH)))


@compiled
def _march(q, tables, ws, dt, substeps, z):
    axes, step, at = tables.axes, np.zeros(tables.axes.size), np.zeros(q.shape[1])
    gravity = tables.inertia[0].gravity
    for k in range(1, q.shape[0]):
        difference(q[k - 1], q[k], axes, step)
        twist = step / dt
        copy_scaled(1.0, z[k - 1], z[k])
        for i in range(substeps):
            copy_scaled(1.0, q[k], at)
            if i < substeps - 1:
                integrate(q[k - 1], (i + 1) / substeps * step, axes, at)
            platen_pose(at, axes, tables.body, ws.frame)
            set_twist(twist, axes, ws.frame)
            advance_modes(tables.modes, tables.coupling, gravity, ws.frame, dt / substeps, z[k], ws.modal)
