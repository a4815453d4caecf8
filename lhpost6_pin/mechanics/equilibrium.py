"""Static equilibrium in the zero-position or another pose (Eq. 4-30): forces, pressures, spools that feed the leaks."""

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.errors import ParameterError, SimulationError
from ..core.names import AXES
from ..effects.actuator import start_line
from ..effects.registry import actuator_rows, parameters_of
from ..effects.supply import steady_supply, supply_pressures
from ..laws.hydraulic import Hydraulic, leak_flows, valve_flows
from ..laws.orifice import opening, spool_for_opening
from ..laws.supply import varies
from ..machine.machine import Machine
from .derivatives import evaluate
from .modes import rest_of_modes
from .plant import Plant, State
from .pose import PlantMotion, PlatenMotion, plant_motion
from .required_wrench import moving_wrenches
from .schemes import TAU
from .workspace import make_workspace

__all__ = ["Equilibrium", "actuator_speeds", "find_equilibrium", "parked_pose", "rest_pressures", "rest_remedy"]
__all__ += ["specimen_at_rest", "unloaded_speeds"]

Pressures = tuple[float, ...]
"""Supply and return pressure [Pa], perhaps with what follows in `laws.supply.Supply`."""

_SPRING_TURNS, _SPRING_MISS = 50, 1e-12
"""Newton's iterations for the rest of springs, and their last step [m or rad]."""
_SUPPLY_TURNS = 8
"""Rounds of pressures at rest and flow drawn: leaks lower the supply by a thousandth of its pressure."""


class Equilibrium(NamedTuple):
    """Rest in a pose: the state, spools (n_actuators,) [1] and actuator forces (n_actuators,) [N]."""

    state: State
    spool: Array
    force: Array
    pose: pin.SE3  # of the platen's axes at C, in {s}
    wrench: pin.Force  # of the actuators on the platen, at C in {c}


def find_equilibrium(plant: Plant, pose: ArrayLike | None = None) -> Equilibrium:
    """Least-squares actuator forces that hold the platen at rest, and the pressures and spools that give them.

    Ten actuators hold six degrees of freedom: of all solutions of Eq. 4-30 this is the one of least norm.
    pose: (6,) of C in {s} and Euler angles [m, rad] at which the platen rests; None: the zero-position.
    Raises SimulationError if the actuators cannot hold the platen, or not within supply and return pressure; for a pose
    that it cannot have, or another than zero with a specimen that is a program, which starts there.
    """
    at = _checked_pose(plant, pose)
    where = "the zero-position" if not at.any() else f"pose {', '.join(f'{x:.4g}' for x in at)} m, rad"
    start = specimen_at_rest(plant, at)
    ws = make_workspace(plant, start)
    if evaluate(plant, ws, np.zeros(plant.spools)):
        raise SimulationError(f"{plant.machine.name}: a leg is out of its stroke in {where}")
    free = plant.axes.size
    gravity = pin.rnea(
        plant.model, plant.model.createData(), start.q, np.zeros(plant.model.nv), np.zeros(plant.model.nv)
    )
    still = PlantMotion(start.q[None], start.v[None], start.v[None])
    weight = moving_wrenches(plant, still)[1][0, plant.axes]
    needed = gravity[:free] - weight - ws.motion[TAU][:free]
    columns = ws.JB[1][: plant.spools, plant.axes].T  # (free, n_actuators)
    force, *_ = np.linalg.lstsq(columns, needed, rcond=None)
    miss = np.abs(columns @ force - needed).max()
    if miss > 1e-6 * max(1.0, float(np.abs(needed).max())):
        raise SimulationError(f"the actuators cannot hold the platen in {where}: {miss:.3g} N or N m is left over")
    z, spool = ws.z.copy(), np.zeros(plant.spools)
    _fill(plant, force, plant.supply[:2], z, spool)
    for _ in range(_SUPPLY_TURNS if varies(plant.supply) else 0):  # what leaks at rest is drawn from the supply, too
        steady_supply(plant.rows, spool, plant.supply, z)
        _fill(plant, force, supply_pressures(plant.supply, z), z, spool)
    turn = pin.rpy.rpyToMatrix(at[3:])
    wrench = pin.SE3(turn, -turn @ plant.body[0]["rho_c"]).act(pin.Force(ws.JB[1][: plant.spools].T @ force))
    return Equilibrium(State(start.q, start.v, z), spool, force, pin.SE3(turn, at[:3]), wrench)


def parked_pose(machine: Machine) -> Array:
    """Pose (6,) [m, rad] of the parked platen; raises ParameterError where none is stated or it cannot move so."""
    if machine.platen.parked is None or 2 not in machine.axes:
        raise ParameterError(
            f"{machine.parameters.origin}: platen.parked is missing: where along Z the platen is parked; state "
            "it, for a table that moves along Z, or start in the zero-position"
        )
    return np.array([0.0, 0.0, machine.platen.parked, 0.0, 0.0, 0.0])


def _checked_pose(plant: Plant, pose: ArrayLike | None) -> Array:
    at = np.zeros(6) if pose is None else np.array(pose, float)
    if at.shape != (6,) or not np.isfinite(at).all():
        raise SimulationError(f"a pose is six finite numbers, x y z [m], roll pitch yaw [rad]; got {pose!r}")
    if stuck := [name for k, name in enumerate(AXES) if at[k] and k not in plant.axes]:
        raise SimulationError(f"{plant.machine.name} cannot move in {', '.join(stuck)}; give 0 there")
    if at.any() and plant.coupled is not None:
        raise SimulationError("a specimen that is a program starts in the zero-position; mount another form of it")
    return at


def specimen_at_rest(plant: Plant, pose: Array | None = None) -> State:
    """The zero state with the specimen at rest under its weight; raises SimulationError for one that falls over.

    pose: (6,) [m, rad] of the platen; None: the zero-position.
    """
    start, down = plant.zero_state(), plant.model.gravity.linear
    if pose is not None and pose.any():
        still = plant_motion(plant, PlatenMotion(pose[None], np.zeros((1, 6)), np.zeros((1, 6))))
        start.q[: still.q.shape[1]] = still.q[0]
        down = pin.rpy.rpyToMatrix(pose[3:]).T @ down
    if plant.modes.size:
        start.z[-2 * plant.modes.size :] = rest_of_modes(plant.modes, down)
    return State(_rest_of_springs(plant, start.q), start.v, start.z)


def _rest_of_springs(plant: Plant, q: Array) -> Array:
    """Configuration at which the springs in a specimen's joints carry its weight; other joints stay.

    Raises SimulationError if there is none nearby: the specimen falls over.
    """
    springs, model = plant.springs[plant.springs["stiffness"] > 0.0], plant.model
    if not springs.size:
        return q
    data, at, v = model.createData(), springs["v"], np.zeros(model.nv)
    for _ in range(_SPRING_TURNS):
        table = [np.arctan2(q[s["q"] + 1], q[s["q"]]) if s["turns"] else q[s["q"]] for s in springs]
        miss = springs["stiffness"] * (springs["rest"] - table) - pin.computeGeneralizedGravity(model, data, q)[at]
        rate = np.diag(springs["stiffness"]) + pin.computeGeneralizedGravityDerivatives(model, data, q)[np.ix_(at, at)]
        if np.linalg.eigvalsh(0.5 * (rate + rate.T))[0] <= 0.0:
            break
        v[at] = np.linalg.solve(rate, miss)
        q = pin.integrate(model, q, v)
        if np.abs(v).max() < _SPRING_MISS:
            return np.asarray(q)
    raise SimulationError(
        f"specimen {plant.machine.specimen.name if plant.machine.specimen else ''} has no stable rest: its weight "
        "overcomes the springs in its joints; make them stiffer"
    )


def _fill(plant: Plant, force: Array, supply: Pressures, z: Array, spool: Array) -> None:
    """Fill pressures, flows through lines and spools at which nothing flows into any chamber."""
    high, low = supply
    for i, row in enumerate(plant.rows[actuator_rows(plant.rows)]):
        solve = rest_pressures if row["modified"] == 0 else _rest_of_modified
        pressures, spool[i] = solve(parameters_of(row), float(force[i]), supply)
        k = row["state"]
        z[k : k + len(pressures)] = pressures
        if not all(low <= p <= high for p in pressures):
            raise SimulationError(_out_of_supply(plant.machine, i, float(force[i]), pressures, supply))
        if row["modified"]:
            start_line(row, spool[i], pressures[0], pressures[-1], high, low, z)


def _out_of_supply(machine: Machine, i: int, force: float, pressures: Pressures, supply: Pressures) -> str:
    """Why actuator `i` cannot give its force [N] at rest: too little load on a single chamber, or too much load."""
    shown, low, high = (" and ".join(f"{p / 1e6:.3g}" for p in of) for of in (pressures, supply[1:2], supply[:1]))
    start = f"{machine.actuator_names[i]} must give {force:.4g} N at rest, "
    if machine.actuators[i].area_b is None and force < supply[1] * machine.actuators[i].area_a:
        why = f"which unloads it: {shown} MPa in its chamber, below the return pressure of {low} MPa"
        return f"{start}{why}; it lifts off there: {rest_remedy(machine, unloaded=True)}"
    why = f"beyond its supply: {shown} MPa, not between {low} and {high} MPa"
    return f"{start}{why}; {rest_remedy(machine, unloaded=False)}"


def rest_remedy(machine: Machine, *, unloaded: bool) -> str:
    """What helps an actuator that bears too little at rest to stay in contact, or more than its supply can give."""
    mounted = machine.specimen is not None
    if unloaded:
        struts = dict.fromkeys(f"{strut.kind}.pressure" for strut in machine.struts)
        found = ["move the specimen towards the centre"] * mounted
        found += [f"raise the pressure of the struts ({', '.join(struts)})"] if struts else []
    else:
        found = ["lighten the specimen", "move it towards the centre"] * mounted + ["raise hydraulics.supply_pressure"]
    return ", or ".join(found) or "check the masses and places of its parts"


def _rest_of_modified(p: Hydraulic, force: float, supply: Pressures) -> tuple[tuple[float, ...], float]:
    """As `rest_pressures` with all that modifiers add; a spool of full stroke where none is enough."""
    from scipy.optimize import brentq

    high, low = (float(x) for x in supply)
    if not (p.leakage or p.turbulent or p.external or p.null_leakage):  # nothing leaks: the spool rests at its null
        pressures, spool = rest_pressures(p, force, supply)
        return pressures, spool - p.null_bias

    def flows(pressure_a: float, pressure_b: float, spool: float) -> tuple[float, float]:
        flow_a, flow_b, _, _ = valve_flows(p, True, spool, pressure_a, pressure_b, high, low)
        across, _, out_a, out_b, _, _ = leak_flows(p, True, pressure_a, pressure_b, low)
        return flow_a - across - out_a, flow_b + across - out_b

    def spool_for(pressure_a: float, pressure_b: float) -> float:
        ends = [flows(pressure_a, pressure_b, x)[0] for x in (-1.0, 1.0)]
        if ends[0] >= 0.0 or ends[1] <= 0.0:
            return -1.0 if ends[0] >= 0.0 else 1.0
        return float(
            brentq(lambda x: flows(pressure_a, pressure_b, x)[0], -1.0, 1.0, xtol=1e-18, rtol=1e-15, maxiter=1000)
        )

    area_a, area_b = p.area_a, p.area_b
    if area_b == 0.0:
        return (force / area_a,), spool_for(force / area_a, 0.0)

    def other(pressure_a: float) -> float:
        return (pressure_a * area_a - force) / area_b

    def miss(pressure_a: float) -> float:
        return flows(pressure_a, other(pressure_a), spool_for(pressure_a, other(pressure_a)))[1]

    least, most = max(low, (low * area_b + force) / area_a), min(high, (high * area_b + force) / area_a)
    if least < most and miss(least) > 0.0 > miss(most):
        a = float(brentq(miss, least, most, xtol=1e-6, rtol=1e-15, maxiter=1000))
    else:  # no pressures within the supply's: those of the report's law, whose check raises
        a = float(rest_pressures(p, force, supply)[0][0])
    return (a, other(a)), spool_for(a, other(a))


def rest_pressures(p: Hydraulic, force: float, supply: Pressures) -> tuple[tuple[float, ...], float]:
    """Pressures [Pa] and spool [1] at which an actuator gives `force` [N] with no net flow into its chambers.

    The spool feeds the leak across the piston; with no leak, its limit as the leak vanishes.
    """
    area_a, area_b, curve, leakage = p.area_a, p.area_b, p.flow_curve, p.leakage
    k_pa, k_bt, k_at, k_pb = p.flow_pa, p.flow_bt, p.flow_at, p.flow_pb
    high, low = supply[:2]
    if area_b == 0.0:
        pressure = force / area_a
        drop = max(high - pressure, np.finfo(float).tiny)
        return (pressure,), float(spool_for_opening(leakage * pressure / (k_pa * math.sqrt(drop)), curve))
    # oil leaks from B to A (spool < 0: supply to B, A to return), or from A to B (spool > 0)
    for sign, out, into in ((-1.0, k_at, k_pb), (1.0, k_pa, k_bt)):
        # flow through both orifices alike: out^2 drop_A = into^2 drop_B, and P_A A_1 - P_B A_2 = force
        if sign < 0.0:
            matrix = np.array([[out**2, into**2], [area_a, -area_b]])
            right = np.array([out**2 * low + into**2 * high, force])
        else:
            matrix = np.array([[-(out**2), -(into**2)], [area_a, -area_b]])
            right = np.array([-(out**2) * high - into**2 * low, force])
        a, b = np.linalg.solve(matrix, right)
        if sign * (a - b) >= 0.0:
            drop = a - low if sign < 0.0 else high - a
            opened = leakage * abs(a - b) / (out * math.sqrt(max(drop, np.finfo(float).tiny)))
            return (float(a), float(b)), float(spool_for_opening(sign * opened, curve))
    pressure = float(force / (area_a - area_b))  # in between nothing leaks and the valve is shut
    return (pressure, pressure), 0.0


def unloaded_speeds(p: Hydraulic, force: float, supply: Pressures) -> tuple[float, float]:
    """Steady piston speeds [m/s] at full opening under the rest force: extending, retracting (Eqs. 4-2, 4-5)."""
    area_a, area_b = p.area_a, p.area_b
    k_pa, k_bt, k_at, k_pb = p.flow_pa, p.flow_bt, p.flow_at, p.flow_pb
    high, low = supply[:2]
    if area_b == 0.0:
        pressure = force / area_a
        return k_pa * math.sqrt(high - pressure) / area_a, k_at * math.sqrt(pressure - low) / area_a
    speeds = []
    for sign, a_in, b_in in ((1.0, k_pa, k_bt), (-1.0, k_at, k_pb)):
        # speed^2 = (a_in/A_1)^2 drop_A = (b_in/A_2)^2 drop_B and P_A A_1 - P_B A_2 = force
        a, b = (a_in / area_a) ** 2, (b_in / area_b) ** 2
        source_a, source_b = (high, low) if sign > 0.0 else (low, high)
        matrix = np.array([[a, b], [area_a, -area_b]])
        pressure_a, _ = np.linalg.solve(matrix, np.array([a * source_a + b * source_b, force]))
        speeds.append(float(math.sqrt(a * abs(source_a - pressure_a))))
    return speeds[0], speeds[1]


def actuator_speeds(plant: Plant) -> Array:
    """Steady unloaded piston speeds at full spool, extending and retracting, (n_actuators, 2) [m/s]."""
    rest = find_equilibrium(plant)
    speeds = np.empty((plant.spools, 2))
    for i, row in enumerate(plant.rows[plant.tables.actuators]):
        p = parameters_of(row)
        speeds[i] = unloaded_speeds(p, float(rest.force[i]), plant.supply)
        speeds[i] *= opening(1.0, p.flow_curve)
    return speeds
