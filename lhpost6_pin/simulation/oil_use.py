"""Oil that a test draws from the supply, against pumps and accumulators."""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array

__all__ = ["Bank", "OilUse", "oil_use"]


class OilUse(NamedTuple):
    """Flow and volume that the valves of a test draw."""

    peak: float  # largest flow [m3/s]
    mean: float  # [m3/s]
    volume: float  # drawn in all [m3]
    from_accumulators: float  # largest volume that pumps had not replaced; not-a-number without their flow [m3]


class Bank(NamedTuple):
    """Accumulators: their volume, and the pressures of their gas: without oil, charged, and the lowest allowed.

    Charged slowly, at constant temperature, the gas fills V_1 = V_0 P_0 / P_1. A test then expands it by a polytropic
    law with index n, P V^n constant (n = 1.4: without heat exchange).
    """

    volume: float  # V_0 [m3]
    precharge: float  # P_0 [Pa]
    charged: float  # P_1 [Pa]
    lowest: float  # P_2 [Pa]
    gas_index: float  # n [1]

    @property
    def gas(self) -> float:
        """Volume of the charged gas [m3]."""
        return self.volume * self.precharge / self.charged

    @property
    def usable(self) -> float:
        """Oil that they give until the lowest pressure [m3]: V_1 ((P_1 / P_2)^(1/n) - 1)."""
        return self.gas * ((self.charged / self.lowest) ** (1.0 / self.gas_index) - 1.0)

    def pressure_after(self, drawn: float) -> float:
        """Pressure [Pa] once a volume of oil is drawn [m3]."""
        return self.charged * (1.0 + drawn / self.gas) ** -self.gas_index


def oil_use(flow: Array, step: float, pump_flow: float = np.nan) -> OilUse:
    """Use of oil by a flow drawn (n,) [m3/s] at an interval [s], with pumps that give up to `pump_flow` [m3/s].

    Pumps give nothing to full accumulators: V(t) = max over s <= t of the integral of flow less pump flow from s to t.
    Integrals are trapezoidal.
    """
    drawn = np.concatenate([[0.0], np.cumsum(0.5 * step * (flow[:-1] + flow[1:]))])
    lack = drawn - pump_flow * step * np.arange(len(flow))
    missing = float(np.max(lack - np.minimum.accumulate(lack)))
    return OilUse(float(np.max(flow)), float(drawn[-1] / (step * (len(flow) - 1))), float(drawn[-1]), missing)
