"""Forward dynamics of the platen in compiled code, without articulated specimen; ABA is its oracle."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled_inline
from ..machine.machine import Machine
from .rigid_body import platen_body, platen_inertia

__all__ = ["INERTIA", "inertia_table", "platen_acceleration"]

INERTIA = np.dtype(
    [
        ("plain", np.float64, (6, 6)),  # spatial inertia of the platen body at B, linear first
        ("modal", np.float64, (6, 6)),  # share of the mass that modes of a specimen take
        # of plain plus directional mass less modal, on the free axes, zero elsewhere
        ("inverse", np.float64, (6, 6)),
        ("gravity", np.float64),  # [m/s2]
        ("bodies", np.int64),  # 1: moving parts are bodies of their own (`moving_parts`), inverse is not used
        ("extra", np.float64, (6, 6)),  # of the platen beyond plain then, which no Inertia can hold
    ]
)


def inertia_table(model: Any, machine: Machine, axes: NDArray[np.int64], modes: NDArray[np.void]) -> NDArray[np.void]:
    """Table (one row) of the rigid body; all zero for an articulated specimen on a platen with lumped parts.

    modes (`modes.MODE`) reduce its mass.
    """
    table = np.zeros(1, INERTIA)
    if model.nv > axes.size and machine.bodies == "lumped":
        return table
    plain, full = platen_inertia(model, machine)
    table["plain"] = plain
    table["modal"] = modes["participation"].T @ modes["participation"]
    table["gravity"] = machine.platen.gravity
    if machine.bodies == "full":
        table["bodies"], table["extra"] = 1, platen_body(machine)[1]
        return table
    block = np.ix_(axes, axes)
    inverse = np.zeros((6, 6))
    inverse[block] = np.linalg.inv((full - table["modal"][0])[block])
    table["inverse"] = inverse
    return table


@compiled_inline
def platen_acceleration(inertia, axes, frame, tau, work, a):
    """Forward dynamics of the platen body: fill a (n_axes,) from tau at the pose and twist in frame (ABA's oracle).

    M a = tau + I g_b - v x* (I v), g_b gravity in platen axes, I the Inertia's part of M. work (2, 6) is scratch.
    """
    plain = inertia[0].plain
    inverse = inertia[0].inverse
    g = inertia[0].gravity
    momentum, total = work[0], work[1]
    v0, v1, v2 = frame[4, 0], frame[4, 1], frame[4, 2]
    w0, w1, w2 = frame[5, 0], frame[5, 1], frame[5, 2]
    gx, gy, gz = -g * frame[2, 0], -g * frame[2, 1], -g * frame[2, 2]
    for i in range(6):
        momentum[i] = (
            plain[i, 0] * v0
            + plain[i, 1] * v1
            + plain[i, 2] * v2
            + plain[i, 3] * w0
            + plain[i, 4] * w1
            + plain[i, 5] * w2
        )
        total[i] = plain[i, 0] * gx + plain[i, 1] * gy + plain[i, 2] * gz
    for k in range(axes.size):
        total[axes[k]] += tau[k]
    p0, p1, p2 = momentum[0], momentum[1], momentum[2]
    h0, h1, h2 = momentum[3], momentum[4], momentum[5]
    total[0] -= w1 * p2 - w2 * p1
    total[1] -= w2 * p0 - w0 * p2
    total[2] -= w0 * p1 - w1 * p0
    total[3] -= w1 * h2 - w2 * h1 + v1 * p2 - v2 * p1
    total[4] -= w2 * h0 - w0 * h2 + v2 * p0 - v0 * p2
    total[5] -= w0 * h1 - w1 * h0 + v0 * p1 - v1 * p0
    for k in range(axes.size):
        i = axes[k]
        value = 0.0
        for j in range(6):
            value += inverse[i, j] * total[j]
        a[k] = value
