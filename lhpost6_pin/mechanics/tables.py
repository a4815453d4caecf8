"""The tables of a plant, that do not change while it runs, as compiled code reads them.

Handing a tuple of arrays from Python to compiled code costs microseconds an array. Code that is called once a step
takes one packed array instead, which holds all tables one behind the other, and unpacks it: a few nanoseconds.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.compiled import borrowed, compiled_views
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


@compiled_views
def unpack_tables(packed):
    """Tables from `Tables.packed`, which the caller holds."""
    packed = borrowed(packed)
    at = packed[: _PARTS + 1].view(np.int64)
    values = packed[at[13] : at[14]]
    supply = Supply(values[0], values[1], values[2], values[3], values[4], values[5], values[6], values[7], values[8])
    return Tables(
        packed,
        packed[at[0] : at[1]].view(np.int64),
        packed[at[1] : at[2]].view(LEG),
        packed[at[2] : at[3]].view(BODY),
        packed[at[3] : at[4]].view(ROW),
        packed[at[4] : at[5]],
        packed[at[5] : at[6]].view(np.int64),
        packed[at[6] : at[7]],
        packed[at[7] : at[8]].view(INERTIA),
        packed[at[8] : at[9]].view(SPRING),
        packed[at[9] : at[10]].view(MODE),
        packed[at[10] : at[11]],
        packed[at[11] : at[12]],
        packed[at[12] : at[13]].view(PLACE),
        supply,
    )
