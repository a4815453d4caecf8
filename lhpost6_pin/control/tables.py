"""Tables of a controller, and what its step works in: packed into one array each, as compiled code takes them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.compiled import compiled_inline
from ..core.packed import array_view, packed_zeros, table_view
from ..mechanics.plant import Plant
from .filters import NOTCHES

__all__ = ["ACTUATOR", "AXIS", "CANCELLER", "ControlTables", "Scratch", "make_scratch", "pack_control"]
__all__ += ["unpack_control", "unpack_scratch"]

AXIS = np.dtype(
    [
        ("displacement_feedforward", np.float64),  # Kxf [1/s]
        ("velocity_feedforward", np.float64),  # Kvf [1]
        ("acceleration_feedforward", np.float64),  # Kaf [s]
        ("jerk_feedforward", np.float64),  # Kjf [s2]
        ("displacement_gain", np.float64),  # Kx [1/s]
        ("velocity_gain", np.float64),  # Kv [1]
        ("acceleration_gain", np.float64),  # Ka [s]
        ("reset_gain", np.float64),  # Ki per sample [1/s]
        ("reset_limit", np.float64),  # [m/s, rad/s]
        ("force_gain", np.float64),  # KF [m/s/N, rad/s/(N m)]
        ("high_pass", np.float64),  # pole of the force high-pass per sample
        ("master_gain", np.float64),  # Km [1]
        ("generator_a", np.float64, (4, 4)),  # reference generator: x+ = a x + b u, (xr vr ar jr) = c x + d u
        ("generator_b", np.float64, 4),
        ("generator_c", np.float64, (4, 4)),
        ("generator_d", np.float64, 4),
        ("feedback_a", np.float64, (3, 3)),  # feedback generator: inputs xs, as; outputs xf, vf, af
        ("feedback_b", np.float64, (3, 2)),
        ("feedback_c", np.float64, (3, 3)),
        ("feedback_d", np.float64, (3, 2)),
        ("notch", np.float64, (NOTCHES, 5)),  # b0 b1 b2 a1 a2 of each second-order section
        ("notches", np.float64),  # number of active sections
    ]
)
"""Table row of a free axis."""

ACTUATOR = np.dtype(
    [
        ("extend", np.float64),  # unloaded speed at full opening [m/s]
        ("retract", np.float64),
        ("flow_curve", np.float64),  # lambda [1]
        ("bias", np.float64),  # opening at rest [1]
        ("force", np.float64),  # force at rest [N]
        ("limit", np.float64),  # largest spool command [1]
    ]
)
"""Table row of an actuator."""

CANCELLER = np.dtype(
    [
        ("axis", np.float64),  # index among the free axes
        ("turn", np.float64),  # phase per sample [rad]
        ("cosine", np.float64),  # of the phase of the path from drive to feedback at this frequency
        ("sine", np.float64),
        ("rate", np.float64),  # adaptation per sample over the gain of that path
    ]
)
"""Table row of a sine canceller: one harmonic of one axis."""


class ControlTables(NamedTuple):
    """Tables of a controller; treat the arrays as read only."""

    packed: Array  # all the following, concatenated
    axis: NDArray[np.void]  # AXIS, one row per free axis
    actuator: NDArray[np.void]  # ACTUATOR
    balance: Array  # (n_actuators, n_actuators) leg rate [m/s] per force [N] in the null space of the motion
    canceller: NDArray[np.void]  # CANCELLER, empty but in sine tests


class Scratch(NamedTuple):
    """What a step of the controller works in: made once, as a new array takes as long as what is done with it."""

    packed: Array  # all that follow, one behind the other
    port: Array  # (n_ports,)
    J: Array  # (n_ports, 6)
    B: Array  # (n_ports, 6)
    K: Array  # (n_legs, 6) pose Jacobian
    frame: Array  # (8, 3)
    reference: Array  # (4,) xr vr ar jr
    measured: Array  # (3,) xf vf af
    rate: Array  # (n_actuators,)
    displacement: Array  # (n_actuators,) this and the next two: the sensors of a run
    acceleration: Array  # (6,)
    force: Array  # (n_actuators,)


_SIZES = 3
"""Numbers at the start of packed scratch: ports, legs, actuators."""


def make_scratch(plant: Plant) -> Scratch:
    """Scratch sized for a plant."""
    ports, legs, n = len(plant.ports), plant.legs.size, plant.spools
    shapes = [(ports,), (ports, 6), (ports, 6), (legs, 6), (8, 3), (4,), (3,), (n,), (n,), (6,), (n,)]
    return Scratch(*packed_zeros((ports, legs, n), shapes))


@compiled_inline
def unpack_scratch(packed):
    """Scratch from `Scratch.packed`, which the caller holds."""
    ports, legs, n = int(packed[0]), int(packed[1]), int(packed[2])
    J = _SIZES + ports
    B = J + 6 * ports
    K = B + 6 * ports
    frame = K + 6 * legs
    reference = frame + 24
    rate = reference + 7
    return Scratch(
        array_view(packed, 0, (packed.size,)),
        array_view(packed, _SIZES, (ports,)),
        array_view(packed, J, (ports, 6)),
        array_view(packed, B, (ports, 6)),
        array_view(packed, K, (legs, 6)),
        array_view(packed, frame, (8, 3)),
        array_view(packed, reference, (4,)),
        array_view(packed, reference + 4, (3,)),
        array_view(packed, rate, (n,)),
        array_view(packed, rate + n, (n,)),
        array_view(packed, rate + 2 * n, (6,)),
        array_view(packed, rate + 2 * n + 6, (n,)),
    )


def pack_control(
    axis: NDArray[np.void], actuator: NDArray[np.void], balance: Array, canceller: NDArray[np.void]
) -> ControlTables:
    """Tables of a controller, also packed into one array."""
    parts = [np.ascontiguousarray(x) for x in (axis, actuator, balance, canceller)]
    sizes = np.array([len(axis), len(actuator), len(canceller)], float)
    packed = np.concatenate([sizes, *(x.view(float).ravel() for x in parts)])
    return ControlTables._make([packed, *parts])


_AXIS_SIZE, _ACTUATOR_SIZE, _CANCELLER_SIZE = (d.itemsize // 8 for d in (AXIS, ACTUATOR, CANCELLER))


@compiled_inline
def unpack_control(packed):
    """Tables of a controller from `ControlTables.packed`, which the caller holds."""
    axes, n, cancellers = int(packed[0]), int(packed[1]), int(packed[2])
    actuator = 3 + _AXIS_SIZE * axes
    balance = actuator + _ACTUATOR_SIZE * n
    canceller = balance + n * n
    return ControlTables(
        array_view(packed, 0, (packed.size,)),
        table_view(packed, AXIS, 3, actuator),
        table_view(packed, ACTUATOR, actuator, balance),
        array_view(packed, balance, (n, n)),
        table_view(packed, CANCELLER, canceller, canceller + _CANCELLER_SIZE * cancellers),
    )
