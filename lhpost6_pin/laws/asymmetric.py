"""The part of friction that does not change sign with the slip: f = -F_a |Z|, Z [1] the hysteresis of `bouc_wen`.

Stored energy: none is declared, all work counts as dissipated; it vanishes over a cycle but for its reversals. Source:
the simplest form that is linear in its amplitude.
"""

from ..core.compiled import compiled
from .bouc_wen import Friction, advance_along, planar_rates
from .contract import Law

__all__ = ["LAW", "advance", "force", "rates"]

LAW = Law(Friction, states=("z",), amplitude=("friction",))


@compiled
def force(p: Friction, z: float) -> float:
    """Friction [N]."""
    return -p.friction * abs(z)


@compiled
def rates(p: Friction, v: float, z: float) -> float:
    """Rate of Z [1/s]."""
    return planar_rates(v, 0.0, z, 0.0, p.yield_slip, p.shape)[0]


@compiled
def advance(p: Friction, d: float, z: float) -> float:
    """Z after a slip [m]: exact."""
    return advance_along(d, z, p.yield_slip, p.shape)
