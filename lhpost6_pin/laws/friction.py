"""Friction beyond a constant sliding force. Z [1] is the hysteretic state of `bouc_wen`, full at |Z| = 1.

    Stribeck          f = -F_s exp(-(v/v_s)^2) Z          more at rest than in motion; breakaway
    asymmetric        f = -F_a |Z|                        more one way than the other
    load-dependent    f = -mu |N| Z                       N the force that presses the surfaces
    warming up        f = -a h Z,  T dh/dt = |v| - h      grows (a < 0: shrinks) with the mean speed h of the last T

F_s, F_a, N [N], v, v_s, h [m/s], mu [1], a [N s/m], T [s]. Stored energy: none is declared, all work counts as
dissipated; that of the asymmetric one vanishes over a cycle but for its reversals. Source: Stribeck's curve as in
Armstrong-Helouvry et al. (1994); the others are the simplest forms linear in their amplitude.
"""

import math

from ..core.compiled import compiled

__all__ = [
    "advance_mean_speed",
    "asymmetric_force",
    "load_force",
    "mean_speed_rate",
    "stribeck_force",
    "warm_up_force",
]


@compiled
def stribeck_force(friction: float, z: float, velocity: float, speed: float) -> float:
    """Friction [N] that is lost in motion: -F_s exp(-(v/v_s)^2) Z."""
    ratio = velocity / speed
    return -friction * math.exp(-ratio * ratio) * z


@compiled
def asymmetric_force(friction: float, z: float) -> float:
    """Part of friction [N] that does not change sign with the slip: -F_a |Z|."""
    return -friction * abs(z)


@compiled
def load_force(coefficient: float, load: float, z: float) -> float:
    """Friction [N] in proportion to a load [N]: -mu |N| Z."""
    return -coefficient * abs(load) * z


@compiled
def warm_up_force(growth: float, mean_speed: float, z: float) -> float:
    """Friction [N] in proportion to the mean speed of the last while: -a h Z."""
    return -growth * mean_speed * z


@compiled
def mean_speed_rate(mean_speed: float, velocity: float, memory: float) -> float:
    """Rate [m/s2] of the mean speed: (|v| - h) / T."""
    return (abs(velocity) - mean_speed) / memory


@compiled
def advance_mean_speed(mean_speed: float, slip: float, dt: float, memory: float) -> float:
    """Mean speed [m/s] after a slip [m] at constant velocity over dt [s]: exact."""
    gain = -math.expm1(-dt / memory)
    return mean_speed + gain * (abs(slip) / dt - mean_speed)
