"""What a motion of the platen requires: inertial wrench and weight, with a rigid specimen; pin.rnea is its oracle.

At B in platen axes, with I the Inertia at B, V = (v, omega), g_b gravity in platen axes and dM the directional mass
that no Inertia holds (see `rigid_body`):

    inertia = I dV/dt + V x* (I V) + dM (dv/dt + omega x v)              (Eqs. 4-26, 4-28)
    weight  = I g_b + (m_z - m_0) g_b                                    (Eq. 4-24)

Moving parts as bodies add their own (`moving_parts`), and dM is zero.
"""

import numpy as np

from ..core.arrays import Array
from ..core.compiled import compiled
from ..core.errors import SimulationError
from .moving_parts import add_moving_parts
from .plant import Plant
from .ports import platen_pose
from .pose import PlantMotion
from .schemes import set_twist
from .spatial import act_force, cross, to_body

__all__ = ["floor_wrench", "moving_wrenches", "refuse_joints", "require_alike", "required_wrench", "rigid_wrenches"]
__all__ += ["wrenches_at_c"]


def refuse_joints(plant: Plant) -> None:
    """Raise SimulationError for a specimen with free joints, or a coupled one."""
    if plant.coupled is not None:
        raise SimulationError(
            "a specimen in Python or OpenSees is not part of the plant's compiled equations: take the engine pinocchio "
            "(--engine pinocchio); forces are not decomposed with it"
        )
    if plant.articulated:
        raise SimulationError(
            "the fused engine takes no free joints: its compiled algebra is that of one rigid body, and joints need "
            "the articulated-body algorithm of Pinocchio; take that engine (--engine pinocchio), lock the joints "
            "(--locked), or describe the specimen by modes or matrices (.toml, .npz, .mat), which run on both"
        )


def require_alike(some: Plant, other: Plant) -> bool:
    """Whether two plants require the same wrench for a motion."""
    one, two = ((p.tables.inertia.tobytes(), p.body["mass_extra"].tobytes()) for p in (some, other))
    if "full" in (some.machine.bodies, other.machine.bodies) and some.legs.tobytes() != other.legs.tobytes():
        return False
    return one == two and bool(some.body["weight_extra"] == other.body["weight_extra"])


def rigid_wrenches(plant: Plant, motion: PlantMotion, turn: Array) -> tuple[Array, Array]:
    """Inertial wrench and weight (n, 6) at B in platen axes [N, N m]; turn (n, 3, 3) is the platen's rotation.

    Raises SimulationError for an articulated specimen.
    """
    refuse_joints(plant)
    n = len(motion.q)
    twist, rate = np.zeros((2, n, 6))
    twist[:, plant.axes], rate[:, plant.axes] = motion.v, motion.a
    inertia, weight = np.zeros((2, n, 6))
    _rigid_wrenches(twist, rate, np.ascontiguousarray(turn), plant.tables, inertia, weight)
    if plant.machine.bodies == "full":
        more = moving_wrenches(plant, motion)
        return inertia + more[0], weight + more[1]
    return inertia, weight


def moving_wrenches(plant: Plant, motion: PlantMotion) -> tuple[Array, Array]:
    """Inertial wrench and weight (n, 6) at B in platen axes of moving parts that are bodies; zero if they are lumped.

    The motion's rows may hold joints of a specimen behind the platen's.
    """
    n, free = len(motion.q), plant.axes.size
    inertia, weight = np.zeros((2, n, 6))
    if plant.machine.bodies == "full":
        rate = np.zeros((n, 6))
        rate[:, plant.axes] = motion.a[:, :free]
        q, v = np.ascontiguousarray(motion.q), np.ascontiguousarray(motion.v[:, :free])
        _moving_wrenches(q, v, rate, plant.tables, inertia, weight)
    return inertia, weight


@compiled
def _moving_wrenches(q, v, rate, tables, inertia, weight):
    frame, M, row = np.zeros((8, 3)), np.zeros((6, 6)), np.zeros(6)
    for k in range(q.shape[0]):
        platen_pose(q[k], tables.axes, tables.body, frame)
        set_twist(v[k], tables.axes, frame)
        M[:] = 0.0
        add_moving_parts(frame, tables.legs, tables.body, tables.inertia, row, M, inertia[k], weight[k])
        for i in range(6):
            for j in range(6):
                inertia[k, i] += M[i, j] * rate[k, j]


@compiled
def _rigid_wrenches(twist, rate, turn, tables, inertia, weight):
    plain, g = tables.inertia[0].plain, tables.inertia[0].gravity
    extra, heavier = tables.body[0].mass_extra, tables.body[0].weight_extra
    momentum = np.zeros(6)
    for k in range(twist.shape[0]):
        down = to_body(turn[k], (0.0, 0.0, -1.0))
        for i in range(6):
            momentum[i] = 0.0
            for j in range(6):
                momentum[i] += plain[i, j] * twist[k, j]
                inertia[k, i] += plain[i, j] * rate[k, j]
            for j in range(3):
                weight[k, i] += plain[i, j] * g * down[j]
        omega = twist[k, 3:]
        bend, bias = cross(omega, momentum), cross(omega, twist[k])
        turning, drift = cross(omega, momentum[3:]), cross(twist[k], momentum)
        for i in range(3):
            inertia[k, i] += bend[i] + extra[i] * (rate[k, i] + bias[i])
            inertia[k, 3 + i] += turning[i] + drift[i]
            weight[k, i] += heavier * down[i]


def required_wrench(plant: Plant, motion: PlantMotion, turn: Array) -> Array:
    """Wrench (n, 6) [N, N m] at B in platen axes that a motion requires beyond the weight, on the free axes."""
    inertia, weight = rigid_wrenches(plant, motion, turn)
    required = np.zeros_like(inertia)
    required[:, plant.axes] = (inertia - weight)[:, plant.axes]
    return required


def floor_wrench(plant: Plant, acceleration: Array) -> Array:
    """Wrench (n, 6) [N, N m] at B in platen axes that moves a specimen's floors, on the free axes.

    Their masses times their absolute `acceleration` (n, n_floors) [m/s2]; the platen turns by little. Its negative is
    the specimen's base shear and overturning moment.
    """
    out = np.zeros((len(acceleration), 6))
    for k, floor in enumerate(plant.machine.floors):
        along = np.eye(3)["xyz".index(floor.along)]
        moved = np.concatenate([along, np.cross(plant.body[0]["rho_c"] + (floor.point or (0.0, 0.0, 0.0)), along)])
        out[:, plant.axes] += floor.mass * acceleration[:, k, None] * moved[plant.axes]
    return out


def wrenches_at_c(plant: Plant, turn: Array, wrench: Array) -> Array:
    """Wrenches (n, 6) at C in {c} of those at B in platen axes; turn (n, 3, 3) is s_R_b (Eqs. 4-20 to 4-22)."""
    out = np.zeros_like(wrench)
    _at_c(turn, plant.body, np.ascontiguousarray(wrench), out)
    return out


@compiled
def _at_c(turn, body, wrench, out):
    for k in range(wrench.shape[0]):
        force, moment = act_force(turn[k], body[0].rho_c, wrench[k], wrench[k, 3:])
        for j in range(3):
            out[k, j], out[k, 3 + j] = force[j], moment[j]
