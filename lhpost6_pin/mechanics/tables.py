"""The tables of a plant, that do not change while it runs, as compiled code reads them.

Handing a tuple of arrays from Python to compiled code costs microseconds an array. Code that is called once a step
takes one packed array instead, which holds all tables one behind the other, and unpacks it: a few nanoseconds.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.compiled import compiled_inline
from ..core.packed import array_view, table_view
from ..effects.registry import ROW
from ..laws.supply import Supply
from .forward_dynamics import INERTIA
from .joint_springs import SPRING
from .modes import MODE
from .ports import BODY, LEG, PLACE

__all__ = ["Tables", "pack_tables", "unpack_tables"]


class Tables(NamedTuple):
    """Tables of a plant; treat the arrays as read only."""

    packed: Array  # all that follow, one behind the other
    axes: NDArray[np.int64]  # (n_axes,) free twist components of the platen
    legs: NDArray[np.void]  # ports.LEG, actuators then struts
    body: NDArray[np.void]  # ports.BODY, one row
    rows: NDArray[np.void]  # registry.ROW
    damping: Array  # (nv,) of joints [N s/m, N m s/rad]
    actuators: NDArray[np.int64]  # (n_actuators,) their rows
    delays: Array  # command path of the valves (`valve_delay.delayed_spools`)
    inertia: NDArray[np.void]  # forward_dynamics.INERTIA, one row
    springs: NDArray[np.void]  # joint_springs.SPRING, those of a specimen's joints
    modes: NDArray[np.void]  # modes.MODE, those of a specimen
    coupling: Array  # (n_modes * n_modes,) damping between modes [1/s], or empty
    accelerometers: Array  # `accelerometers.accelerometer_table`, or empty
    places: NDArray[np.void]  # ports.PLACE, those on which effects act
    supply: Supply


_PARTS = len(Tables._fields) - 1


def pack_tables(
    axes: NDArray[np.int64],
    legs: NDArray[np.void],
    body: NDArray[np.void],
    rows: NDArray[np.void],
    *others: "NDArray[np.generic] | Supply",
) -> Tables:
    """Tables in the order of the fields, with all of them packed."""
    parts = [np.ascontiguousarray(x) for x in (axes, legs, body, rows, *others[:-1], np.array(others[-1], float))]
    flat = [np.frombuffer(part.tobytes(), float) for part in parts]
    ends = np.cumsum([_PARTS + 1, *(x.size for x in flat)])
    packed = np.concatenate([ends.astype(np.int64).view(float), *flat])
    return Tables._make([packed, *parts[:-1], others[-1]])


@compiled_inline
def unpack_tables(packed):
    """Tables from `Tables.packed`, which the caller holds."""
    at = table_view(packed, np.int64, 0, _PARTS + 1)
    values = array_view(packed, at[13], (9,))
    supply = Supply(values[0], values[1], values[2], values[3], values[4], values[5], values[6], values[7], values[8])
    return Tables(
        table_view(packed, np.float64, 0, packed.size),
        table_view(packed, np.int64, at[0], at[1]),
        table_view(packed, LEG, at[1], at[2]),
        table_view(packed, BODY, at[2], at[3]),
        table_view(packed, ROW, at[3], at[4]),
        table_view(packed, np.float64, at[4], at[5]),
        table_view(packed, np.int64, at[5], at[6]),
        table_view(packed, np.float64, at[6], at[7]),
        table_view(packed, INERTIA, at[7], at[8]),
        table_view(packed, SPRING, at[8], at[9]),
        table_view(packed, MODE, at[9], at[10]),
        table_view(packed, np.float64, at[10], at[11]),
        table_view(packed, np.float64, at[11], at[12]),
        table_view(packed, PLACE, at[12], at[13]),
        supply,
    )
