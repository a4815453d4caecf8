"""A mass on a spring and a damper on the platen, moving along one of its axes: something that is not rigid.

    de/dt = u,  u = V - b',  dV/dt = -w^2 e - 2 d w u,  f = m (w^2 e + 2 d w u)

b' [m/s] velocity of its foot, e [m] its displacement and u [m/s] its velocity relative to the foot, V [m/s] its
velocity in the world, m [kg], w [rad/s], d [1] share of critical damping, f [N] on the foot. No acceleration is needed.
Where the mass has weight, -m g acts on the foot, too; e is measured from where it hangs at rest. The foot moves by
s + b_2 s_2 + b_3 s_3, b [m] levers of its second and third port.
Stored energy: none is declared, all work counts as dissipated. (m V^2 / 2 + m w^2 e^2 / 2 comes back in part; the
damper takes 2 d w m u^2.) One step is exact for a foot at constant velocity.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "Oscillator", "advance", "force", "rates"]


class Oscillator(NamedTuple):
    """Parameters."""

    mass: Annotated[float, "kg"]
    circular_frequency: Annotated[float, "rad/s"]
    damping: Annotated[float, "1"]  # share of critical
    gravity: Annotated[float, "m/s2"]
    lever_2: Annotated[float, "m"]
    lever_3: Annotated[float, "m"]


LAW = Law(
    Oscillator,
    ports=(3, 3),
    states=("stretch", "velocity"),
    amplitude=("mass", "gravity"),
    follows_motion=True,
)


@compiled
def force(
    p: Oscillator, v: float, v_2: float, v_3: float, stretch: float, velocity: float
) -> tuple[float, float, float]:
    """Forces [N, N m] on the foot."""
    relative = velocity - (v + p.lever_2 * v_2 + p.lever_3 * v_3)
    spring = p.mass * p.circular_frequency * (p.circular_frequency * stretch + 2.0 * p.damping * relative)
    f = spring - p.mass * p.gravity
    return f, p.lever_2 * f, p.lever_3 * f


@compiled
def rates(p: Oscillator, v: float, v_2: float, v_3: float, stretch: float, velocity: float) -> tuple[float, float]:
    """Rate of the stretch [m/s] and acceleration of the mass [m/s2]."""
    relative = velocity - (v + p.lever_2 * v_2 + p.lever_3 * v_3)
    return relative, -p.circular_frequency * (p.circular_frequency * stretch + 2.0 * p.damping * relative)


@compiled
def advance(
    p: Oscillator, d: float, d_2: float, d_3: float, dt: float, stretch: float, velocity: float
) -> tuple[float, float]:
    """Stretch e [m] and velocity V [m/s] after the foot has moved straight in dt [s]; damping below one."""
    foot = (d + p.lever_2 * d_2 + p.lever_3 * d_3) / dt
    relative = velocity - foot
    decay = p.damping * p.circular_frequency
    ringing = p.circular_frequency * math.sqrt(1.0 - p.damping * p.damping)
    shrink = math.exp(-decay * dt)
    cosine, sine = math.cos(ringing * dt), math.sin(ringing * dt) / ringing
    after = shrink * (stretch * cosine + (relative + decay * stretch) * sine)
    speed = shrink * (relative * cosine - (decay * relative + p.circular_frequency**2 * stretch) * sine)
    return after, speed + foot
