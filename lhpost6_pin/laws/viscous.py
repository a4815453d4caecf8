"""Linear viscous damping (Eq. 4-19): f = -C_v v, C_v [N s/m], v [m/s]. Stored energy: none; dissipates C_v v^2."""

from ..core.compiled import compiled

__all__ = ["viscous_force"]


@compiled
def viscous_force(velocity: float, coefficient: float) -> float:
    """Viscous force [N] (or [N m] on a rotation) (Eq. 4-19)."""
    return -coefficient * velocity
