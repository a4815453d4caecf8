"""Springs and drag without memory.

    spring      f = -k s
    end stop    f = -F ((|s| - s_0)_+ / d)^n sgn s     nothing within s_0; F [N] at d = 0.1 m beyond it
    drag        f = -F (|v| / v_1)^p sgn v             F [N] at v_1 = 1 m/s

s [m or rad], v [m/s], k [N/m or N m/rad], n, p [1], n >= 1, p > 0. With s_0 = 0, n = 3 the end stop is a cubic spring;
with p = 2 the drag is quadratic, with p = 1 viscous. Stored energy: the springs' potentials, zero at s = 0.
"""

import math

from ..core.compiled import compiled

__all__ = ["drag_force", "end_stop_energy", "end_stop_force", "spring_energy", "spring_force"]

REACH = 0.1
"""Stroke beyond the start of an end stop at which its force is stated [m]."""


@compiled
def spring_force(s: float, stiffness: float) -> float:
    """Force of a linear spring [N]."""
    return -stiffness * s


@compiled
def spring_energy(s: float, stiffness: float) -> float:
    """Its potential [J]."""
    return 0.5 * stiffness * s * s


@compiled
def end_stop_force(s: float, force: float, start: float, exponent: float) -> float:
    """Force of a spring that starts at a distance from the middle [N]."""
    beyond = (abs(s) - start) / REACH
    if beyond <= 0.0:
        return 0.0
    return -math.copysign(force * beyond**exponent, s)


@compiled
def end_stop_energy(s: float, force: float, start: float, exponent: float) -> float:
    """Its potential [J]: F d / (n + 1) (beyond/d)^(n + 1)."""
    beyond = (abs(s) - start) / REACH
    if beyond <= 0.0:
        return 0.0
    return force * REACH / (exponent + 1.0) * beyond ** (exponent + 1.0)


@compiled
def drag_force(velocity: float, force: float, exponent: float) -> float:
    """Force against the motion that grows with a power of the speed [N]."""
    return -math.copysign(force * abs(velocity) ** exponent, velocity)
