"""Forces, rates and accelerations of a plant at one state."""

import numpy as np

from ..core.arrays import Array
from ..core.compiled import compiled
from .leg_model import make_dynamics
from .moving_parts import bodies_acceleration
from .plant import Plant
from .schemes import TAU, V_SEEN, A, V, rates_stage
from .tables import unpack_tables
from .workspace import Workspace, unpack_workspace

__all__ = ["evaluate", "evaluate_derivatives", "rates_at"]


def evaluate_derivatives(plant: Plant, ws: Workspace, spool: Array) -> int:
    """Forces, rates and acceleration at the state in `ws`, as every run needs them at its start."""
    status = evaluate(plant, ws, spool)
    if status == 0:
        if plant.machine.bodies == "full" and not plant.articulated:
            _accelerate_bodies(plant.tables.packed, ws.buffer)  # no Pinocchio model of the legs to build for one state
        else:
            ws.motion[A] = make_dynamics(plant)(ws.q, ws.motion[V], ws.motion[TAU])
    return status


@compiled
def _accelerate_bodies(packed, buffer):  # type: ignore[no-untyped-def]
    tables, ws = unpack_tables(packed), unpack_workspace(buffer)
    bodies_acceleration(tables, ws.frame, ws.motion[TAU], np.empty((9, 6)), ws.motion[A])


def evaluate(plant: Plant, ws: Workspace, spool: Array) -> int:
    """Ports, forces and rates at the state in `ws`; returns the stage status."""
    ws.motion[V_SEEN] = ws.motion[V]
    return rates_at(plant, ws, ws.q, ws.z, spool)


def rates_at(plant: Plant, ws: Workspace, q: Array, z: Array, spool: Array) -> int:
    """Ports, forces and rates at (q, z) for the velocity `motion[V_SEEN]` of `ws`; returns the stage status."""
    return int(_rates(q, z, plant.tables.packed, ws.buffer, spool))


@compiled
def _rates(q, z, packed, buffer, spool):  # type: ignore[no-untyped-def]
    return rates_stage(q, z, unpack_tables(packed), unpack_workspace(buffer), spool)
