"""The arrays that a run works in: made once, changed in place by compiled code."""

from typing import NamedTuple

from ..core.arrays import Array
from ..core.compiled import compiled_inline
from ..core.packed import array_view, packed_zeros
from ..effects.registry import PORTS
from .plant import Plant, State
from .schemes import V

__all__ = ["Workspace", "make_workspace", "unpack_workspace"]


class Workspace(NamedTuple):
    """State and scratch of one running plant; array rows are named in `schemes`."""

    buffer: Array  # all that follow, one behind the other; code that is called once a step takes this alone
    q: Array  # (nq,)
    z: Array  # (n_states,)
    zd: Array  # (n_states,)
    motion: Array  # (7, nv)
    port: Array  # (4, n_ports)
    JB: Array  # (2, n_ports, 6)
    frame: Array  # (8, 3)
    force: Array  # (n_rows, 3)
    external: Array  # (6,) wrench on the platen from outside, at B in platen axes, linear first [N, N m]
    modal: Array  # (4, n_modes) scratch of `modes`


_HEAD = 6
"""Numbers at the start of a buffer: its sizes nq, n_states, nv, n_ports, n_rows, n_modes."""


def make_workspace(plant: Plant, start: State) -> Workspace:
    """Arrays sized for a plant, holding a copy of the start state."""
    states, n, rows = len(plant.states), len(plant.ports), plant.rows.size
    nq, nv, modes = plant.model.nq, plant.model.nv, plant.modes.size
    shapes = [(nq,), (states,), (states,), (7, nv), (4, n), (2, n, 6), (8, 3), (rows, len(PORTS)), (6,)]
    shapes.append((4, modes))
    ws = Workspace(*packed_zeros((nq, states, nv, n, rows, modes), shapes))
    ws.q[:], ws.motion[V], ws.z[:] = start
    ws.external[:] = plant.rest_external
    return ws


@compiled_inline
def unpack_workspace(buffer):
    """Workspace from its buffer, which the caller holds."""
    nq, states, nv = int(buffer[0]), int(buffer[1]), int(buffer[2])
    n, rows, modes = int(buffer[3]), int(buffer[4]), int(buffer[5])
    z = _HEAD + nq
    zd = z + states
    motion = zd + states
    port = motion + 7 * nv
    JB = port + 4 * n
    frame = JB + 12 * n
    force = frame + 24
    external = force + 3 * rows
    modal = external + 6
    return Workspace(
        array_view(buffer, 0, (buffer.size,)),
        array_view(buffer, _HEAD, (nq,)),
        array_view(buffer, z, (states,)),
        array_view(buffer, zd, (states,)),
        array_view(buffer, motion, (7, nv)),
        array_view(buffer, port, (4, n)),
        array_view(buffer, JB, (2, n, 6)),
        array_view(buffer, frame, (8, 3)),
        array_view(buffer, force, (rows, 3)),
        array_view(buffer, external, (6,)),
        array_view(buffer, modal, (4, modes)),
    )
