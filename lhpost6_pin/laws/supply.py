"""The supply that all actuators share, and how flow changes its pressures.

    P_S = P_S0 - k Y,   T dY/dt + Y = sum of flows drawn from the supply, of double-acting ones times a weight
    P_R = P_R0 + k Y|Y|, T dY/dt + Y = sum of flows given to the return

T = 0 is possible: Y is then the flow itself. Stored energy: none that is counted.
"""

from typing import Annotated, NamedTuple

from ..core.compiled import compiled_inline
from .contract import Law

__all__ = ["LAWS", "BackPressure", "Supply", "SupplyDroop", "pressures", "varies"]


class Supply(NamedTuple):
    """Supply and return of a machine, as compiled code reads them."""

    pressure: float  # P_S0 [Pa]
    return_pressure: float  # P_R0 [Pa]
    droop: float = 0.0  # k of the supply [Pa s/m3]
    droop_time: float = 0.0  # [s]
    rise: float = 0.0  # k of the return [Pa s2/m6]
    rise_time: float = 0.0  # [s]
    drawn: float = -1.0  # number of the hidden state that holds the flow drawn, -1 without
    returned: float = -1.0  # the same of the flow returned
    weight: float = 1.0  # of flows of double-acting actuators in the flow drawn


class SupplyDroop(NamedTuple):
    """Parameters of a supply pressure that falls with the flow drawn."""

    droop: Annotated[float, "Pa s/m3"]
    time: Annotated[float, "s"]
    weight: Annotated[float, "1"]


class BackPressure(NamedTuple):
    """Parameters of a return pressure that rises with the square of the flow."""

    rise: Annotated[float, "Pa s2/m6"]
    time: Annotated[float, "s"]


LAWS = {
    "supply_droop": Law(
        SupplyDroop, states=("drawn_flow",), modifies="supply", fields=("droop", "droop_time", "weight", "drawn")
    ),
    "back_pressure": Law(
        BackPressure, states=("returned_flow",), modifies="supply", fields=("rise", "rise_time", "returned")
    ),
}


@compiled_inline
def varies(p: Supply) -> bool:
    """Whether flow changes its pressures."""
    return p.drawn >= 0.0 or p.returned >= 0.0


@compiled_inline
def pressures(p: Supply, drawn: float, returned: float) -> tuple[float, float]:
    """Supply and return pressure [Pa] at the filtered flows drawn and returned [m3/s]."""
    return p.pressure - p.droop * drawn, p.return_pressure + p.rise * returned * abs(returned)
