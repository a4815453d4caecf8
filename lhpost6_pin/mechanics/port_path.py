"""Ports along a motion: where each was, how fast, by how much it moved from sample to sample, and its force's wrench.

All that laws need to know of a motion; what is evaluated many times along one motion turns its poses into ports once.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled
from ..core.errors import RecordError
from .plant import Plant
from .platen_steps import platen_difference
from .pose import PlantMotion
from .schemes import DS, SD, S, port_rates, pose_stage, set_twist
from .workspace import make_workspace

__all__ = ["PortPath", "ports_along"]

Array = NDArray[np.float64]


class PortPath(NamedTuple):
    """Ports of a plant along a motion of n samples; n_ports of them, as `Plant.ports` names them."""

    s: Array  # (n, n_ports) coordinates [m or rad]
    rate: Array  # (n, n_ports) [m/s or rad/s]
    slip: Array  # (n, n_ports) increments since the sample before, zero at the first
    column: Array  # (n, n_ports, 6) wrench of a unit force on the platen at B in platen axes
    turn: Array  # (n, 3, 3) rotation s_R_b of the platen


def ports_along(plant: Plant, motion: PlantMotion) -> PortPath:
    """Ports along a motion; raises RecordError naming the sample where a leg is out of its stroke."""
    n, count = len(motion.q), len(plant.ports)
    s, rate, slip = np.zeros((n, count)), np.zeros((n, count)), np.zeros((n, count))
    column, turn = np.zeros((n, count, 6)), np.zeros((n, 3, 3))
    ws = make_workspace(plant, plant.zero_state())
    arrays = plant.axes, plant.legs, plant.body, ws.frame, ws.port, ws.JB
    q, v = (np.ascontiguousarray(x) for x in (motion.q, motion.v))
    sample, status = _ports_along(q, v, *arrays, s, rate, slip, column, turn)
    if status:
        names = (*plant.machine.actuator_names, *plant.machine.strut_names)
        what = f"{names[status - 1]} is out of its stroke" if status > 0 else "the motion is not finite"
        raise RecordError(f"platen_displacement at sample {sample}: {what}; check its channels, units and offsets")
    return PortPath(s, rate, slip, column, turn)


@compiled
def _ports_along(q, v, axes, legs, body, frame, port, JB, s, rate, slip, column, turn):
    """Fill the arrays; returns (sample, status) of the first pose that cannot be, or (n, 0)."""
    step = np.zeros(axes.size)
    for k in range(q.shape[0]):
        if k > 0:
            platen_difference(q[k - 1], q[k], axes, step)
            set_twist(step, axes, frame)
            port_rates(JB[0], frame, port[DS])
        status = pose_stage(q[k], axes, legs, body, frame, port, JB)
        if status != 0:
            return k, status
        if k > 0:  # the mean of the rates at both ends
            port_rates(JB[0], frame, port[SD])
            for i in range(s.shape[1]):
                slip[k, i] = 0.5 * (port[DS, i] + port[SD, i])
        set_twist(v[k], axes, frame)
        port_rates(JB[0], frame, rate[k])
        s[k] = port[S]
        column[k] = JB[1]
        turn[k] = frame[:3]
    return q.shape[0], 0
