"""Friction of a ball joint, the same about every axis, with Bouc-Wen hysteresis.

Y dZ/dt = w - H Z,  H = tau w.Z + (1 - tau) |w.Z|,  m = -T Z

w [rad/s] relative turn, Y [rad] yield turn, tau [1] loop shape, Z [1] hysteretic state with |Z| <= 1, T [N m] sliding
moment. About one axis this is the seal law (Eq. 4-18). Where all slides Z lies along w and m is Coulomb's moment.
All work counts as dissipated, as in `bouc_wen`.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .bouc_wen import advance_planar, friction_force
from .contract import Law

__all__ = ["LAW", "Ball", "advance", "force", "rates"]


class Ball(NamedTuple):
    """Parameters."""

    moment: Annotated[float, "N m"]
    yield_turn: Annotated[float, "rad"]
    shape: Annotated[float, "1"]


LAW = Law(Ball, ports=(2, 3), states=("z_1", "z_2", "z_3"), amplitude=("moment",))


@compiled
def force(p: Ball, z_1: float, z_2: float, z_3: float) -> tuple[float, float, float]:
    """Moments [N m]."""
    return friction_force(p.moment, z_1), friction_force(p.moment, z_2), friction_force(p.moment, z_3)


@compiled
def rates(p: Ball, v: float, v_2: float, v_3: float, z_1: float, z_2: float, z_3: float) -> tuple[float, float, float]:
    """Rates of Z [1/s]; v [rad/s]."""
    along = v * z_1 + v_2 * z_2 + v_3 * z_3
    h = p.shape * along + (1.0 - p.shape) * abs(along)
    return (v - h * z_1) / p.yield_turn, (v_2 - h * z_2) / p.yield_turn, (v_3 - h * z_3) / p.yield_turn


@compiled
def advance(
    p: Ball, d: float, d_2: float, d_3: float, z_1: float, z_2: float, z_3: float
) -> tuple[float, float, float]:
    """Z after a turn d [rad] about one axis: the exact solution.

    Z stays in the plane of d and Z, where the two-dimensional law with slip along its first axis is the same.
    """
    size = math.sqrt(d * d + d_2 * d_2 + d_3 * d_3)
    if size == 0.0:
        return z_1, z_2, z_3
    e_1, e_2, e_3 = d / size, d_2 / size, d_3 / size
    along = e_1 * z_1 + e_2 * z_2 + e_3 * z_3
    a_1, a_2, a_3 = z_1 - along * e_1, z_2 - along * e_2, z_3 - along * e_3
    across = math.sqrt(a_1 * a_1 + a_2 * a_2 + a_3 * a_3)
    new_along, new_across = advance_planar(size, 0.0, along, across, p.yield_turn, p.shape)
    keeps = new_across / across if across > 0.0 else 0.0
    return new_along * e_1 + keeps * a_1, new_along * e_2 + keeps * a_2, new_along * e_3 + keeps * a_3
