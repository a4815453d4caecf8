"""Static equilibrium in the control zero-position (Eq. 4-30): forces, chamber pressures, spools that feed the leaks."""

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .errors import SimulationError
from .law_table import HYDRAULIC_DOUBLE
from .laws.orifice import spool_for_opening
from .plant import Plant, State
from .schemes import TAU, forces_stage, pose_stage
from .workspace import make_workspace

__all__ = ["Equilibrium", "find_equilibrium", "hydraulic_rows", "rest_pressures", "unloaded_speeds"]

Array = NDArray[np.float64]


class Equilibrium(NamedTuple):
    """Rest in the zero-position: the state, spools (n_actuators,) [1] and actuator forces (n_actuators,) [N]."""

    state: State
    spool: Array
    force: Array


def hydraulic_rows(plant: Plant) -> NDArray[np.int64]:
    """Rows of the effect table that are actuators, in the order of their spools."""
    fed = np.flatnonzero(plant.rows["input"] >= 0)
    return fed[np.argsort(plant.rows["input"][fed], kind="stable")]


def find_equilibrium(plant: Plant) -> Equilibrium:
    """Least-squares actuator forces that hold the platen at rest, and the pressures and spools that give them.

    Ten actuators hold six degrees of freedom: of all solutions of Eq. 4-30 this is the one of least norm.
    Raises SimulationError if the actuators cannot hold the platen, or not within supply and return pressure.
    """
    start = plant.zero_state()
    ws = make_workspace(plant, start)
    ws.z[:] = 0.0
    pose_stage(ws.q, plant.axes, plant.legs, plant.body, ws.frame, ws.port, ws.JB)
    forces_stage(
        plant.axes,
        plant.legs,
        plant.body,
        plant.rows,
        plant.model.damping,
        ws.frame,
        ws.port,
        ws.JB,
        ws.z,
        ws.force,
        ws.motion,
    )
    free = plant.axes.size
    gravity = pin.rnea(
        plant.model, plant.model.createData(), start.q, np.zeros(plant.model.nv), np.zeros(plant.model.nv)
    )
    needed = gravity[:free] - ws.motion[TAU][:free]
    columns = ws.JB[1][: plant.spools, plant.axes].T  # (free, n_actuators)
    force, *_ = np.linalg.lstsq(columns, needed, rcond=None)
    miss = np.abs(columns @ force - needed).max()
    if miss > 1e-6 * max(1.0, float(np.abs(needed).max())):
        raise SimulationError(
            f"the actuators cannot hold the platen in the zero-position: {miss:.3g} N or N m is left over"
        )
    z, spool = ws.z.copy(), np.zeros(plant.spools)
    for i, row in enumerate(plant.rows[hydraulic_rows(plant)]):
        pressures, spool[i] = rest_pressures(row, float(force[i]), plant.supply)
        k = row["state"]
        z[k : k + len(pressures)] = pressures
        low, high = plant.supply[1], plant.supply[0]
        if not all(low <= p <= high for p in pressures):
            name = plant.machine.actuators[i].name
            raise SimulationError(
                f"{name} must give {force[i]:.4g} N at rest, beyond its supply: {pressures} Pa is not between "
                f"{low:g} and {high:g} Pa; lighten the specimen or raise hydraulics.supply_pressure"
            )
    return Equilibrium(State(start.q, start.v, z), spool, force)


def rest_pressures(row: np.void, force: float, supply: Array) -> tuple[tuple[float, ...], float]:
    """Pressures [Pa] and spool [1] at which an actuator gives `force` [N] with no net flow into its chambers.

    The spool feeds the leak across the piston; with no leak, its limit as the leak vanishes.
    """
    area_a, area_b, k_pa, k_bt, k_at, k_pb, curve, leakage = row["p"][:8]
    high, low = supply
    if row["law"] != HYDRAULIC_DOUBLE:
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


def unloaded_speeds(row: np.void, force: float, supply: Array) -> tuple[float, float]:
    """Steady piston speeds [m/s] at full opening under the rest force: extending, retracting (Eqs. 4-2, 4-5)."""
    area_a, area_b, k_pa, k_bt, k_at, k_pb = (float(v) for v in row["p"][:6])
    high, low = supply
    if row["law"] != HYDRAULIC_DOUBLE:
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
