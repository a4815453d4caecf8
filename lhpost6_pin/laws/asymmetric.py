"""The part of friction that does not change sign with the slip: f = -F_a |Z|^p, Z [1] the hysteresis of `bouc_wen`.

While the friction slips |Z| is one, and the power p [1] does not show; it shapes what a reversal of the slip does. With
p = 2 the sliding force of friction is F + F_a Z, different in the two directions. Stored energy: none is declared, all
work counts as dissipated; it vanishes over a cycle but for its reversals. Source: the simplest form that is linear in
its amplitude.
"""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .bouc_wen import advance_along, planar_rates
from .contract import Law

__all__ = ["LAW", "AsymmetricFriction", "advance", "force", "rates"]


class AsymmetricFriction(NamedTuple):
    """Parameters."""

    friction: Annotated[float, "N"]  # F_a, of either sign
    yield_slip: Annotated[float, "m"]
    shape: Annotated[float, "1"]
    power: Annotated[float, "1"]  # p > 0


LAW = Law(AsymmetricFriction, states=("z",), amplitude=("friction", "power"))


@compiled
def force(p: AsymmetricFriction, z: float) -> float:
    """Friction [N]."""
    return -p.friction * abs(z) ** p.power


@compiled
def rates(p: AsymmetricFriction, v: float, z: float) -> float:
    """Rate of Z [1/s]."""
    return planar_rates(v, 0.0, z, 0.0, p.yield_slip, p.shape)[0]


@compiled
def advance(p: AsymmetricFriction, d: float, z: float) -> float:
    """Z after a slip [m]: exact."""
    return advance_along(d, z, p.yield_slip, p.shape)
