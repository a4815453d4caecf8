"""Friction of a seal (Eq. 4-18): f = -F_mu Z, Z by `bouc_wen` along one direction. All work counts as dissipated."""

from ..core.compiled import compiled
from .bouc_wen import Friction, advance_along, friction_force, planar_rates
from .contract import Law

__all__ = ["LAW", "advance", "force", "rates"]

LAW = Law(Friction, states=("z",), amplitude=("friction",), inlined=True, friction_memory=True)


@compiled
def force(p: Friction, z: float) -> float:
    """Friction force [N]."""
    return friction_force(p.friction, z)


@compiled
def rates(p: Friction, v: float, z: float) -> float:
    """Rate of Z [1/s]."""
    return planar_rates(v, 0.0, z, 0.0, p.yield_slip, p.shape)[0]


@compiled
def advance(p: Friction, d: float, z: float) -> float:
    """Z after a slip [m]: exact."""
    return advance_along(d, z, p.yield_slip, p.shape)
