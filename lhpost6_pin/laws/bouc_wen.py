"""Bouc-Wen hysteresis in two dimensions (Eqs. 4-9 to 4-12); with v_y = Z_y = 0 it is the seal law (Eq. 4-18).

Kernels of `bouc_wen_1d`, `bouc_wen_2d` and of all friction that has the same hysteresis.

Y dZ/dt = v - H Z,  H = tau v.Z + (1 - tau) (|v_x Z_x| + |v_y Z_y|),  f = -F_mu Z

v [m/s] slip velocity, Y [m] yield displacement, tau [1] loop shape, Z [1] hysteretic state with |Z_i| <= 1,
F_mu [N] sliding force. H takes the absolute value of each product. Rate-independent: only the slip's path counts.
Stored energy: none is declared, all work counts as dissipated. (With tau <= 1/2, F_mu Y |Z|^2 / 2 could be set apart
as recoverable: Z.v = d/dt (Y |Z|^2 / 2) + H |Z|^2.)
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled

__all__ = ["Friction", "advance_along", "advance_planar", "friction_force", "planar_rates"]


class Friction(NamedTuple):
    """Parameters of friction with Bouc-Wen hysteresis."""

    friction: Annotated[float, "N"]  # sliding force F_mu
    yield_slip: Annotated[float, "m"]  # yield displacement Y
    shape: Annotated[float, "1"]  # loop shape tau


_SEGMENTS = 12
"""Pieces of one step between changes of sign; two opposing components need three for shapes up to 1/2."""

_SATURATED = 100.0
"""Slip over yield displacement beyond which Z changes no more; keeps exponentials finite."""
_TINY = 1e-200
"""Z that counts as zero, so that no product or ratio underflows."""
_ZERO = 1e-15
"""Share of an opposing component that rounding leaves of it where it reaches zero."""


@compiled
def friction_force(friction: float, z: float) -> float:
    """Friction force on the platen along one slip direction [N] (Eq. 4-11): -F_mu Z."""
    return -friction * z


@compiled
def planar_rates(
    v_x: float, v_y: float, z_x: float, z_y: float, yield_slip: float, shape: float
) -> tuple[float, float]:
    """Rates of Z_x and Z_y [1/s] (Eq. 4-9); v [m/s], yield_slip [m], shape tau [1]."""
    p_x = v_x * z_x
    p_y = v_y * z_y
    h = shape * (p_x + p_y) + (1.0 - shape) * (abs(p_x) + abs(p_y))
    return (v_x - h * z_x) / yield_slip, (v_y - h * z_y) / yield_slip


@compiled
def _growth(curvature: float, slope: float, t: float) -> tuple[float, float]:
    """Solve w'' = curvature w with w(0) = 1, w'(0) = slope: w(t) and its integral from 0 to t."""
    x = curvature * t * t
    if abs(x) < 1e-3:  # Taylor series: the next terms are below 1e-15
        cosine = 1.0 + x / 2.0 * (1.0 + x / 12.0 * (1.0 + x / 30.0))
        sine = t * (1.0 + x / 6.0 * (1.0 + x / 20.0 * (1.0 + x / 42.0)))
        cosine_less = t * t / 2.0 * (1.0 + x / 12.0 * (1.0 + x / 30.0 * (1.0 + x / 56.0)))
    elif curvature > 0.0:
        k = math.sqrt(curvature)
        up = math.exp(k * t)
        cosine = 0.5 * (up + 1.0 / up)
        sine = 0.5 * (up - 1.0 / up) / k
        cosine_less = (cosine - 1.0) / curvature
    else:
        k = math.sqrt(-curvature)
        cosine = math.cos(k * t)
        sine = math.sin(k * t) / k
        cosine_less = (cosine - 1.0) / curvature
    return cosine + slope * sine, sine + slope * cosine_less


@compiled
def _crossing(z: float, a: float, curvature: float, slope: float, t: float) -> float:
    """Time in (0, t] at which z + a W reaches zero, W the integral of `_growth`; Newton, safeguarded."""
    wanted = -z / a
    low, high = 0.0, t
    guess = min(t, wanted)
    for _ in range(60):
        w, total = _growth(curvature, slope, guess)
        miss = total - wanted
        if miss > 0.0:
            high = guess
        else:
            low = guess
        step = guess - miss / w
        following = step if low < step < high else 0.5 * (low + high)
        if abs(following - guess) <= 1e-15 * t or high - low <= 1e-15 * t:
            break
        guess = following
    return guess


@compiled
def advance_planar(
    dx: float, dy: float, z_x: float, z_y: float, yield_slip: float, shape: float
) -> tuple[float, float]:
    """Z_x and Z_y after a straight slip (dx, dy) [m]: the exact solution of Eq. 4-9, whatever the step.

    While no product v_i Z_i changes sign H is linear in Z, dZ/dt = a - (b.Z) Z, a = slip/Y, b_i = a_i where slip
    and Z agree and (2 tau - 1) a_i where they oppose. Z = p/w with p' = a w and w' = b.p makes it linear:
    w'' = (a.b) w. A component that opposes the slip is followed to its zero first, where the piece ends.
    """
    scale = 1.0 / yield_slip
    a_x = dx * scale
    a_y = dy * scale
    reach = max(abs(a_x), abs(a_y))
    if reach > _SATURATED:
        a_x *= _SATURATED / reach
        a_y *= _SATURATED / reach
    z_x = z_x if abs(z_x) > _TINY else 0.0
    z_y = z_y if abs(z_y) > _TINY else 0.0
    if a_x * z_x >= 0.0 and a_y * z_y >= 0.0:  # nothing opposes the slip: one piece
        w, total = _growth(a_x * a_x + a_y * a_y, a_x * z_x + a_y * z_y, 1.0)
        scale = 1.0 / w
        return (z_x + a_x * total) * scale, (z_y + a_y * total) * scale
    left = 1.0
    for _ in range(_SEGMENTS):
        b_x = a_x if a_x * z_x >= 0.0 else (2.0 * shape - 1.0) * a_x
        b_y = a_y if a_y * z_y >= 0.0 else (2.0 * shape - 1.0) * a_y
        curvature = a_x * b_x + a_y * b_y
        slope = b_x * z_x + b_y * z_y
        t = left  # not beyond the time that an opposing component needs without H; the solution is regular there
        if a_x * z_x < 0.0:
            t = min(t, -z_x / a_x)
        if a_y * z_y < 0.0:
            t = min(t, -z_y / a_y)
        w, total = _growth(curvature, slope, t)
        cross = 0
        if a_x * z_x < 0.0 and a_x * total / z_x <= _ZERO - 1.0:
            t = _crossing(z_x, a_x, curvature, slope, t)
            cross = 1
        if a_y * z_y < 0.0 and a_y * total / z_y <= _ZERO - 1.0:
            t_y = _crossing(z_y, a_y, curvature, slope, t)
            if cross == 0 or t_y < t:
                t = t_y
                cross = 2
        if cross != 0:
            w, total = _growth(curvature, slope, t)
        scale = 1.0 / w
        z_x = 0.0 if cross == 1 else (z_x + a_x * total) * scale
        z_y = 0.0 if cross == 2 else (z_y + a_y * total) * scale
        left -= t
        if left <= 0.0:
            break
    return z_x, z_y


@compiled
def advance_along(dx: float, z: float, yield_slip: float, shape: float) -> float:
    """Z after a slip dx [m] along one direction: `advance_planar` with dy = Z_y = 0, faster (a test compares them).

    Where slip and Z agree, dZ/dx = (1 - Z^2)/Y adds the slip inside a hyperbolic tangent.
    """
    a = dx / yield_slip
    if a * z < 0.0:
        return advance_planar(dx, 0.0, z, 0.0, yield_slip, shape)[0]
    if abs(a) < 0.03:  # Taylor series of tanh: the next term is below 1e-15
        x = a * a
        t = a * (1.0 - x * (1.0 / 3.0 - x * (2.0 / 15.0 - x * (17.0 / 315.0))))
    else:
        t = math.tanh(a)
    return (z + t) / (1.0 + z * t)
