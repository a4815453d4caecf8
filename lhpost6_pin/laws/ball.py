"""Friction of a ball joint, the same about every axis: Bouc-Wen hysteresis, or smoothed by speed.

Y dZ/dt = w - H Z,  H = tau w.Z + (1 - tau) |w.Z|,  m = -T Z

w [rad/s] relative turn, Y [rad] yield turn, tau [1] loop shape, Z [1] hysteretic state with |Z| <= 1, T [N m] sliding
moment. About one axis this is the seal law (Eq. 4-18). Where all slides Z lies along w and m is Coulomb's moment.
All work counts as dissipated, as in `bouc_wen`. Smoothed by speed, as films are and many simulators have it:

m = -T w / sqrt(w.w + w_0^2),  w_0 [rad/s] the speed at which it slides
"""

import math

from ..core.compiled import compiled
from .bouc_wen import advance as bouc_wen_advance

__all__ = ["advance_ball", "ball_rate", "smooth_share"]


@compiled
def ball_rate(
    w_1: float, w_2: float, w_3: float, z_1: float, z_2: float, z_3: float, yield_turn: float, shape: float
) -> tuple[float, float, float]:
    """Rates of Z [1/s]; w [rad/s], yield_turn [rad], shape tau [1]."""
    along = w_1 * z_1 + w_2 * z_2 + w_3 * z_3
    h = shape * along + (1.0 - shape) * abs(along)
    return (w_1 - h * z_1) / yield_turn, (w_2 - h * z_2) / yield_turn, (w_3 - h * z_3) / yield_turn


@compiled
def smooth_share(w_1: float, w_2: float, w_3: float, slow: float) -> float:
    """Moment over sliding moment and turn w [s/rad]; w, slow [rad/s]."""
    return -1.0 / math.sqrt(w_1 * w_1 + w_2 * w_2 + w_3 * w_3 + slow * slow)


@compiled
def advance_ball(
    d_1: float, d_2: float, d_3: float, z_1: float, z_2: float, z_3: float, yield_turn: float, shape: float
) -> tuple[float, float, float]:
    """Z after a turn d [rad] about one axis: the exact solution.

    Z stays in the plane of d and Z, where the two-dimensional law with slip along its first axis is the same.
    """
    size = math.sqrt(d_1 * d_1 + d_2 * d_2 + d_3 * d_3)
    if size == 0.0:
        return z_1, z_2, z_3
    e_1, e_2, e_3 = d_1 / size, d_2 / size, d_3 / size
    along = e_1 * z_1 + e_2 * z_2 + e_3 * z_3
    a_1, a_2, a_3 = z_1 - along * e_1, z_2 - along * e_2, z_3 - along * e_3
    across = math.sqrt(a_1 * a_1 + a_2 * a_2 + a_3 * a_3)
    new_along, new_across = bouc_wen_advance(size, 0.0, along, across, yield_turn, shape)
    keeps = new_across / across if across > 0.0 else 0.0
    return new_along * e_1 + keeps * a_1, new_along * e_2 + keeps * a_2, new_along * e_3 + keeps * a_3
