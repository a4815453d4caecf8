"""Friction of a ball joint smoothed by speed, as films are and many simulators have it.

m = -T w / sqrt(w.w + w_0^2)

w [rad/s] relative turn, w_0 [rad/s] the speed at which it slides, T [N m] sliding moment. All work is dissipated.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "SmoothBall", "force"]


class SmoothBall(NamedTuple):
    """Parameters."""

    moment: Annotated[float, "N m"]
    slow: Annotated[float, "rad/s"]  # w_0


LAW = Law(SmoothBall, ports=(2, 3))


@compiled
def force(p: SmoothBall, v: float, v_2: float, v_3: float) -> tuple[float, float, float]:
    """Moments [N m]; v [rad/s]."""
    share = p.moment * (-1.0 / math.sqrt(v * v + v_2 * v_2 + v_3 * v_3 + p.slow * p.slow))
    return share * v, share * v_2, share * v_3
