"""A mass on a spring and a damper on the platen, moving along one of its axes: something that is not rigid.

    de/dt = u,  u = V - b',  dV/dt = -w^2 e - 2 d w u,  f = m (w^2 e + 2 d w u)

b' [m/s] velocity of its foot, e [m] its displacement and u [m/s] its velocity relative to the foot, V [m/s] its
velocity in the world, m [kg], w [rad/s], d [1] share of critical damping, f [N] on the foot. No acceleration is needed.
Where the mass has weight, -m g acts on the foot, too; e is measured from where it hangs at rest.
Stored energy: none is declared, all work counts as dissipated. (m V^2 / 2 + m w^2 e^2 / 2 comes back in part; the
damper takes 2 d w m u^2.) One step is exact for a foot at constant velocity.
"""

import math

from ..core.compiled import compiled

__all__ = ["advance_oscillator", "oscillator_force", "oscillator_rate"]


@compiled
def oscillator_force(stretch: float, relative: float, mass: float, frequency: float, damping: float) -> float:
    """Force [N] on the foot; stretch e [m], relative u [m/s]."""
    return mass * frequency * (frequency * stretch + 2.0 * damping * relative)


@compiled
def oscillator_rate(stretch: float, relative: float, frequency: float, damping: float) -> float:
    """Acceleration of the mass [m/s2]."""
    return -frequency * (frequency * stretch + 2.0 * damping * relative)


@compiled
def advance_oscillator(
    stretch: float, velocity: float, slip: float, dt: float, frequency: float, damping: float
) -> tuple[float, float]:
    """Stretch e [m] and velocity V [m/s] after the foot has moved by `slip` [m] in dt [s]; damping below one."""
    foot = slip / dt
    relative = velocity - foot
    decay = damping * frequency
    ringing = frequency * math.sqrt(1.0 - damping * damping)
    shrink = math.exp(-decay * dt)
    cosine, sine = math.cos(ringing * dt), math.sin(ringing * dt) / ringing
    after = shrink * (stretch * cosine + (relative + decay * stretch) * sine)
    speed = shrink * (relative * cosine - (decay * relative + frequency * frequency * stretch) * sine)
    return after, speed + foot
