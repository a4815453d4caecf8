"""Ports along a motion: where each was, how fast, by how much it moved from sample to sample, and its force's wrench.

All that laws need of a motion; poses are converted to ports once and evaluated many times.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.compiled import compiled
from ..core.errors import RecordError
from .plant import Plant
from .pose import PlantMotion
from .schemes import DS, SD, S, port_rates, pose_stage, set_twist
from .spatial import difference
from .workspace import make_workspace

__all__ = ["PortPath", "ports_along"]


class PortPath(NamedTuple):
    """Ports of a plant along a motion of n samples; n_ports of them, as `Plant.ports` names them."""

    s: Array  # (n, n_ports) coordinates [m or rad]
    rate: Array  # (n, n_ports) [m/s or rad/s]
    slip: Array  # (n, n_ports) increments since the sample before, zero at the first
    column: Array  # (n, n_ports, 6) wrench of a unit force on the platen at B in platen axes
    turn: Array  # (n, 3, 3) rotation s_R_b of the platen


def ports_along(plant: Plant, motion: PlantMotion) -> PortPath:
    """Ports along a motion; raises RecordError naming the sample where a leg has no oil left in a chamber."""
    n, count = len(motion.q), len(plant.ports)
    s, rate, slip = np.zeros((n, count)), np.zeros((n, count)), np.zeros((n, count))
    column, turn = np.zeros((n, count, 6)), np.zeros((n, 3, 3))
    ws = make_workspace(plant, plant.zero_state())
    q, v = (np.ascontiguousarray(x) for x in (motion.q, motion.v))
    path = PortPath(s, rate, slip, column, turn)
    _ports_along(q, v, plant.tables, ws, path)
    moved = np.abs(path.s[:, : plant.spools])
    bad = np.argwhere(~(moved < [a.room for a in plant.machine.actuators]))
    lost = np.flatnonzero(~np.isfinite(path.s).all(axis=1))
    if len(bad) or len(lost):
        sample = min([*bad[:1, 0], *lost[:1]])
        what = "the motion is not finite"
        if sample not in lost:
            what = f"{plant.machine.actuator_names[bad[0, 1]]} is out of its stroke, beyond the end of a chamber"
        raise RecordError(f"platen_displacement at sample {sample}: {what}; check its channels, units and offsets")
    return path


@compiled
def _ports_along(q, v, tables, ws, path):
    """Fill the path; where a pose is not finite, so is the path."""
    axes, frame, port, J = tables.axes, ws.frame, ws.port, ws.JB[0]
    step = np.zeros(axes.size)
    for k in range(q.shape[0]):
        if k > 0:
            difference(q[k - 1], q[k], axes, step)
            set_twist(step, axes, frame)
            port_rates(J, frame, port[DS])
        pose_stage(q[k], tables, ws)
        if k > 0:  # the mean of the rates at both ends
            port_rates(J, frame, port[SD])
            for i in range(port.shape[1]):
                path.slip[k, i] = 0.5 * (port[DS, i] + port[SD, i])
        set_twist(v[k], axes, frame)
        port_rates(J, frame, path.rate[k])
        path.s[k] = port[S]
        path.column[k] = ws.JB[1]
        path.turn[k] = frame[:3]
