"""Friction of a bearing pad (Eqs. 4-9 to 4-12): f = -F_mu Z, Z by `bouc_wen` in a plane. All work is dissipated."""

from ..core.compiled import compiled
from .bouc_wen import Friction, advance_planar, friction_force, planar_rates
from .contract import Law

__all__ = ["LAW", "advance", "force", "rates"]

LAW = Law(Friction, ports=(2, 2), states=("z_x", "z_y"), amplitude=("friction",), inlined=True, friction_memory=True)


@compiled
def force(p: Friction, z_x: float, z_y: float) -> tuple[float, float]:
    """Friction forces [N]."""
    return friction_force(p.friction, z_x), friction_force(p.friction, z_y)


@compiled
def rates(p: Friction, v: float, v_2: float, z_x: float, z_y: float) -> tuple[float, float]:
    """Rates of Z [1/s]."""
    return planar_rates(v, v_2, z_x, z_y, p.yield_slip, p.shape)


@compiled
def advance(p: Friction, d: float, d_2: float, z_x: float, z_y: float) -> tuple[float, float]:
    """Z after a straight slip [m]: exact."""
    return advance_planar(d, d_2, z_x, z_y, p.yield_slip, p.shape)
