"""Controller settings: what a panel holds (TOML), and the tables that the compiled step reads."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..effects import HYDRAULIC_DOUBLE
from ..equilibrium import Equilibrium, hydraulic_rows, unloaded_speeds
from ..errors import ParameterError
from ..files import models_folder
from ..parameters import Parameters, load_parameters
from ..plant import Plant
from ..pose import leg_jacobian
from ..rigid_body import platen_inertia
from ..schema import build_section, quantity_field
from .loop import ACTUATOR, AXIS, MEMORY_ROWS

__all__ = ["Controller", "LoopSettings", "load_controller", "make_controller"]

Array = NDArray[np.float64]
Six = tuple[float, ...]


@dataclass(frozen=True)
class LoopSettings:
    """Displacement loop with velocity feed-forward and force feedback, per degree of freedom x y z roll pitch yaw."""

    rate: float = quantity_field("Hz", bound="positive")
    displacement_gain: Six = quantity_field("1/s", length=6, bound="nonnegative")
    velocity_feedforward: Six = quantity_field("1", length=6, bound="nonnegative")
    reset_gain: Six = quantity_field("1/s2", length=6, bound="nonnegative")
    reset_limit: Six = quantity_field("m/s | rad/s", length=6, bound="nonnegative")
    force_damping: Six = quantity_field("1", length=6, bound="nonnegative")
    force_cut_in: float = quantity_field("Hz", bound="positive")
    balance_gain: float = quantity_field("1/s", bound="nonnegative")


class Controller(NamedTuple):
    """Settings made ready for a plant, as `loop.control_step` reads them; treat the arrays as read only."""

    settings: LoopSettings
    axis: NDArray[np.void]  # loop.AXIS, one row a free axis
    actuator: NDArray[np.void]  # loop.ACTUATOR
    balance: Array  # (n_actuators, n_actuators) leg rate [m/s] per force [N] in the null space of the motion
    memory: Array  # (loop.MEMORY_ROWS, max(6, n_actuators)), at rest

    def fresh_memory(self) -> Array:
        """A copy of the memory at rest, for one run."""
        return self.memory.copy()


def load_controller(name_or_path: str | Path) -> LoopSettings:
    """Read controller settings by shipped name or path; raises ParameterError naming file and key."""
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = models_folder() / "controllers" / f"{name_or_path}.toml"
        if not path.is_file():
            valid = ", ".join(sorted(p.stem for p in path.parent.glob("*.toml")))
            raise ParameterError(f"no controller settings named {name_or_path!r}; valid names: {valid}")
    parameters: Parameters = load_parameters(path)
    return build_section(LoopSettings, parameters, ("loop",))


def make_controller(plant: Plant, rest: Equilibrium, settings: LoopSettings) -> Controller:
    """Work out the loop's tables for a plant: force gains from oil stiffness and mass, valve gains, null space.

    Force feedback of damping ratio zeta on an oil column of stiffness K and mass M is a velocity of
    2 zeta / sqrt(K M) per unit force. Valve gains are steady unloaded piston speeds at full opening.
    """
    n, axes = plant.spools, plant.axes
    ports = len(plant.ports)
    jacobian = np.zeros((plant.legs.size, 6))
    leg_jacobian(
        np.zeros(6),
        plant.legs,
        plant.body,
        np.zeros(ports),
        np.zeros((ports, 6)),
        np.zeros((ports, 6)),
        np.zeros((8, 3)),
        jacobian,
    )
    jacobian = jacobian[:n]
    rows = plant.rows[hydraulic_rows(plant)]
    actuator = np.zeros(n, ACTUATOR)
    for row, out, force, spool in zip(rows, actuator, rest.force, rest.spool, strict=True):
        out["extend"], out["retract"] = unloaded_speeds(row, float(force), plant.supply)
        out["flow_curve"], out["bias"], out["force"] = row["p"][6], spool, force
    oil = np.array([_oil_stiffness(row) for row in rows])
    stiffness = (jacobian.T * oil) @ jacobian
    mass = _mass_about_c(plant)
    axis = np.zeros(axes.size, AXIS)
    turn = 2.0 * np.pi * settings.force_cut_in / settings.rate
    for out, k in zip(axis, axes, strict=True):
        out["displacement_gain"] = settings.displacement_gain[k]
        out["velocity_feedforward"] = settings.velocity_feedforward[k]
        out["reset_gain"] = settings.reset_gain[k] / settings.rate
        out["reset_limit"] = settings.reset_limit[k]
        out["force_gain"] = 2.0 * settings.force_damping[k] / np.sqrt(stiffness[k, k] * mass[k, k])
        out["high_pass"] = 1.0 / (1.0 + turn)
    free = jacobian[:, axes]
    null = np.eye(n) - free @ np.linalg.pinv(free)
    balance = settings.balance_gain * null @ np.diag(1.0 / oil) @ null
    return Controller(settings, axis, actuator, balance, np.zeros((MEMORY_ROWS, max(6, n))))


def _oil_stiffness(row: np.void) -> float:
    """Stiffness of an actuator's oil column with the valve closed, zero-position [N/m]."""
    area_a, area_b, chamber_a, chamber_b, bulk = (float(row["p"][i]) for i in (0, 1, 8, 9, 10))
    stiffness = bulk * area_a / chamber_a
    return stiffness + (bulk * area_b / chamber_b if row["law"] == HYDRAULIC_DOUBLE else 0.0)


def _mass_about_c(plant: Plant) -> Array:
    """Mass matrix of the platen for motion of C and turns at the zero-position (6, 6)."""
    _, at_b = platen_inertia(plant.model, plant.machine)
    rho = plant.body[0]["rho_c"]
    lever = np.eye(6)
    # v_B = v_C - omega x rho = v_C + [rho] omega
    lever[:3, 3:] = np.array([[0.0, -rho[2], rho[1]], [rho[2], 0.0, -rho[0]], [-rho[1], rho[0], 0.0]])
    return lever.T @ at_b @ lever
