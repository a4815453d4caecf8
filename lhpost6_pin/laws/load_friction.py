"""Friction in proportion to the load that presses the surfaces: f = -mu |N| Z.

mu [1], N [N] the force of the actuator on the same leg; Z [1] the hysteresis of `bouc_wen`, in the plane of a pad or
along a rod. Stored energy: none is declared, all work counts as dissipated. Source: Coulomb.
"""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .bouc_wen import advance_along, advance_planar, planar_rates
from .contract import Law

__all__ = ["LAW", "LoadFriction", "advance", "force", "rates"]


class LoadFriction(NamedTuple):
    """Parameters."""

    coefficient: Annotated[float, "1"]
    yield_slip: Annotated[float, "m"]
    shape: Annotated[float, "1"]
    area_a: Annotated[float, "m2"]  # of the actuator whose force is the load
    area_b: Annotated[float, "m2"]


LAW = Law(
    LoadFriction,
    ports=(1, 2),
    states=("z_x", "z_y"),
    amplitude=("coefficient", "area_a", "area_b"),
    feels_load=True,
)


@compiled
def force(p: LoadFriction, load: float, z_x: float, z_y: float) -> tuple[float, float]:
    """Friction forces [N]; load [N]."""
    return -p.coefficient * abs(load) * z_x, -p.coefficient * abs(load) * z_y


@compiled
def rates(p: LoadFriction, v: float, v_2: float, z_x: float, z_y: float) -> tuple[float, float]:
    """Rates of Z [1/s]."""
    return planar_rates(v, v_2, z_x, z_y, p.yield_slip, p.shape)


@compiled
def advance(p: LoadFriction, d: float, d_2: float, planar: bool, z_x: float, z_y: float) -> tuple[float, float]:
    """Z after a straight slip [m]: exact."""
    if planar:
        return advance_planar(d, d_2, z_x, z_y, p.yield_slip, p.shape)
    return advance_along(d, z_x, p.yield_slip, p.shape), z_y
