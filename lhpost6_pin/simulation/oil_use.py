"""Oil that a test draws from the supply, against pumps and accumulators."""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array

__all__ = ["OilUse", "oil_use"]


class OilUse(NamedTuple):
    """Flow and volume that the valves of a test draw."""

    peak: float  # largest flow [m3/s]
    mean: float  # [m3/s]
    volume: float  # drawn in all [m3]
    from_accumulators: float  # largest volume that pumps had not replaced; not-a-number without their flow [m3]


def oil_use(flow: Array, step: float, pump_flow: float = np.nan) -> OilUse:
    """Use of oil by a flow drawn (n,) [m3/s] at an interval [s], with pumps that give up to `pump_flow` [m3/s].

    Pumps give nothing to full accumulators: V(t) = max over s <= t of the integral of flow less pump flow from s to t.
    Integrals are trapezoidal.
    """
    drawn = np.concatenate([[0.0], np.cumsum(0.5 * step * (flow[:-1] + flow[1:]))])
    lack = drawn - pump_flow * step * np.arange(len(flow))
    missing = float(np.max(lack - np.minimum.accumulate(lack)))
    return OilUse(float(np.max(flow)), float(drawn[-1] / (step * (len(flow) - 1))), float(drawn[-1]), missing)
