"""A loose joint before the friction itself, in any share: the contact rubs only once the joint's gap is crossed.

    f = -F (b - Z),  b = dz(e, g) / Y_b

e [m] and dz(e, g) as in `backlash`, with gap g [m] and elastic slip Y_b [m] of joint and contact, b [1] within one;
F [N] share of the sliding force; Z [1] is the hysteresis of `bouc_wen`, of which that share is taken back.
Rate-independent: only the slip's path counts. Stored energy: none is declared, all work counts as dissipated. Source:
dead zone in series with Coulomb friction, elementary.
"""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from . import backlash
from .backlash import Backlash
from .bouc_wen import advance_along, planar_rates
from .contract import Law

__all__ = ["LAW", "BacklashInstead", "advance", "force", "rates"]


class BacklashInstead(NamedTuple):
    """Parameters."""

    friction: Annotated[float, "N"]
    yield_slip: Annotated[float, "m"]  # of the form that is replaced
    shape: Annotated[float, "1"]
    elastic_slip: Annotated[float, "m"]  # Y_b
    gap: Annotated[float, "m"]  # half of what is loose, g


LAW = Law(BacklashInstead, states=("z", "offset"), amplitude=("friction",))


@compiled
def force(p: BacklashInstead, z: float, offset: float) -> float:
    """Friction [N] beyond that of the form that is replaced."""
    return backlash.force(Backlash(p.friction, p.elastic_slip, p.gap), offset) + p.friction * z


@compiled
def rates(p: BacklashInstead, v: float, z: float, offset: float) -> tuple[float, float]:
    """Rates of Z [1/s] and of the offset [m/s]."""
    joint = Backlash(p.friction, p.elastic_slip, p.gap)
    return planar_rates(v, 0.0, z, 0.0, p.yield_slip, p.shape)[0], backlash.rates(joint, v, offset)


@compiled
def advance(p: BacklashInstead, d: float, z: float, offset: float) -> tuple[float, float]:
    """Z and the offset after a slip [m]: exact."""
    joint = Backlash(p.friction, p.elastic_slip, p.gap)
    return advance_along(d, z, p.yield_slip, p.shape), backlash.advance(joint, d, offset)
