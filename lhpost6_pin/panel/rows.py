"""One row of numbers a sample: what the controller of a panel measured, wanted and commanded, by name."""

from functools import cached_property

from ..core.arrays import Array
from ..data.metrics import QUANTITIES
from .interlocks import INTERLOCKS

__all__ = ["PRESSURES", "Rows"]

STATE = ("sample", "plant_state", "program_time", "stamp")
PRESSURES = ("chamber_pressure_a", "chamber_pressure_b", "spool_position", "strut_pressure", "supply_pressure")
"""In the order of a reading's."""


class Rows:
    """Places of named columns in a row, for a plant of so many actuators and struts.

    `stamp` [s] is the time on the plant's clock at which the sample was taken. Pressures and spools are not-a-number
    where the server does not send them.
    """

    def __init__(self, actuators: int, struts: int) -> None:
        """Lay out the columns."""
        widths = dict.fromkeys(STATE, 1)
        for who in ("platen", "reference"):
            widths |= {f"{who}_{quantity}": 6 for quantity in QUANTITIES}
        widths |= {"shares": len(INTERLOCKS)}
        widths |= dict.fromkeys(("actuator_displacement", "actuator_force", "spool_command"), actuators)
        widths |= dict(zip(PRESSURES, (actuators, actuators, actuators, struts, 1), strict=True))
        self.widths = widths

    @cached_property
    def places(self) -> dict[str, slice]:
        """Columns of each name."""
        found, at = {}, 0
        for name, width in self.widths.items():
            found[name] = slice(at, at + width)
            at += width
        return found

    @property
    def width(self) -> int:
        """Numbers of a row."""
        return sum(self.widths.values())

    def of(self, rows: Array, name: str) -> Array:
        """Columns (n, k) of a name in rows (n, width)."""
        return rows[:, self.places[name]]
