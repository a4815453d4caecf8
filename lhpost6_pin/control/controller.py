"""A controller made ready for a plant: the tables that the compiled step reads, and the step for one sample."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.errors import ControllerError
from ..core.names import SAMPLE_RATE
from ..effects.registry import actuator_rows, parameters_of
from ..laws.hydraulic import Hydraulic
from ..laws.orifice import opening
from ..mechanics.equilibrium import Equilibrium, unloaded_speeds
from ..mechanics.plant import Plant
from ..mechanics.pose import leg_jacobian
from ..mechanics.rigid_body import platen_inertia
from .filters import drive_for, feedback_generator, notch_section, reference_generator
from .loop import ACTUATOR, AXIS, CANCELLER, MEMORY_ROWS, ControlTables, Feedback, control_step, pack_control
from .plug import Wanted
from .settings import ControllerSettings

__all__ = ["Controller", "make_controller"]

Array = NDArray[np.float64]


class Controller(NamedTuple):
    """Settings made ready for a plant, as `loop.control_step` reads them; treat the arrays as read only."""

    settings: ControllerSettings
    plant: Plant
    axis: NDArray[np.void]  # loop.AXIS, one row a free axis
    actuator: NDArray[np.void]  # loop.ACTUATOR
    balance: Array  # (n_actuators, n_actuators) leg rate [m/s] per force [N] in the null space of the motion
    canceller: NDArray[np.void]  # loop.CANCELLER, empty but in sine tests
    jacobian: Array  # (n_actuators, 6) leg rates per motion of C and Euler angles, zero-position
    lever: Array  # (6, 6) motion of C and Euler angles per twist at B, zero-position

    @property
    def tables(self) -> ControlTables:
        """Its tables as compiled code reads them, packed anew."""
        return pack_control(self.axis, self.actuator, self.balance, self.canceller)

    @property
    def columns(self) -> int:
        """Columns of its drive: six, and with sine cancellers what they learn from and their level."""
        return 13 if len(self.canceller) else 6

    def init(self) -> Array:
        """The controller's memory at rest, for one run."""
        width = max(6, self.plant.spools)
        return np.zeros((MEMORY_ROWS + len(self.canceller), width))

    def step(self, memory: Array, sample: int, drive: Array, sensors: Feedback) -> Array:
        """Command (n_actuators,) of a sample from drive (n, columns) and the sensors.

        memory is changed in place. For one sample at a time: runs call the compiled step themselves. Raises
        ControllerError for arrays of another shape and a sample that the drive has not: compiled code does not look.
        """
        n = self.plant.spools
        self._check("drive", drive, (len(drive), self.columns))
        self._check("memory", memory, (MEMORY_ROWS + len(self.canceller), max(6, n)))
        for name, values, size in zip(Feedback._fields, sensors, (n, 6, n), strict=True):
            self._check(f"sensors' {name}", values, (size,))
        if not 0 <= sample < len(drive):
            raise ControllerError(f"{self.settings.name}: sample {sample} is none of the drive's {len(drive)}")
        command = np.empty(self.plant.spools)
        control_step(sample, drive, Feedback(*sensors), self.plant.tables, self.tables, memory, command)
        return command

    def _check(self, name: str, values: Array, shape: tuple[int, ...]) -> None:
        if not isinstance(values, np.ndarray) or values.shape != shape:
            what = f"{type(values).__name__} of shape {np.shape(values)}"
            raise ControllerError(f"{self.settings.name}: {name} is {what}; an array of shape {shape} is needed")

    def drive_for(self, displacement: Array, velocity: Array, acceleration: Array) -> Array:
        """Drive (n, 6) whose reference is the given motion, (n, 6) each (see `filters.drive_for`).

        Raises ControllerError for another shape.
        """
        s = self.settings
        for name, values in zip(Wanted._fields, (displacement, velocity, acceleration), strict=True):
            self._check(f"wanted {name}", values, (len(displacement), 6))
        corners = np.array(s.reference_high_pass), np.array(s.reference_damping)
        return np.ascontiguousarray(drive_for(s.mode, displacement, velocity, acceleration, *corners))


def make_controller(plant: Plant, rest: Equilibrium, settings: ControllerSettings) -> Controller:
    """Work out the loop's tables for a plant: filters, force gains from oil stiffness and mass, valves, null space.

    Force feedback of damping ratio zeta on an oil column of stiffness K and mass M is a velocity of
    2 zeta / sqrt(K M) per unit force. Valve gains are steady unloaded piston speeds at full opening. Raises
    ControllerError for settings of another rate than the samples'.
    """
    if settings.rate != SAMPLE_RATE:
        origin = settings.stated.origin
        raise ControllerError(f"{origin}: loop.rate {settings.rate:g} Hz is not the samples' {SAMPLE_RATE} Hz")
    n, axes = plant.spools, plant.axes
    ports = len(plant.ports)
    jacobian = np.zeros((plant.legs.size, 6))
    scratch = np.zeros(ports), np.zeros((ports, 6)), np.zeros((ports, 6)), np.zeros((8, 3))
    leg_jacobian(np.zeros(6), plant.legs, plant.body, *scratch, jacobian)
    jacobian = jacobian[:n]
    rows = plant.rows[actuator_rows(plant.rows)]
    actuator = np.zeros(n, ACTUATOR)
    actuator["limit"] = settings.spool_limit
    for row, out, force, spool in zip(rows, actuator, rest.force, rest.spool, strict=True):
        p = parameters_of(row)
        out["extend"], out["retract"] = unloaded_speeds(p, float(force), plant.supply)
        curve = p.flow_curve
        out["flow_curve"], out["bias"], out["force"] = curve, opening(spool, curve), force
    oil = np.array([_oil_stiffness(parameters_of(row)) for row in rows])
    stiffness = (jacobian.T * oil) @ jacobian
    mass = _mass_about_c(plant)
    axis = np.zeros(axes.size, AXIS)
    for out, k in zip(axis, axes, strict=True):
        _fill_axis(out, settings, int(k))
        out["force_gain"] = 2.0 * settings.force_damping[k] / np.sqrt(stiffness[k, k] * mass[k, k])
    free = jacobian[:, axes]
    null = np.eye(n) - free @ np.linalg.pinv(free)
    balance = settings.balance_gain * null @ np.diag(1.0 / oil) @ null
    lever = _lever(plant)
    return Controller(settings, plant, axis, actuator, balance, np.zeros(0, CANCELLER), jacobian, lever)


def _fill_axis(out: np.void, settings: ControllerSettings, k: int) -> None:
    """Gains and filters of degree of freedom k."""
    s, rate = settings, settings.rate
    for name in ("displacement", "velocity", "acceleration"):
        out[f"{name}_feedforward"] = getattr(s, f"{name}_feedforward")[k]
        out[f"{name}_gain"] = getattr(s, f"{name}_gain")[k]
    out["jerk_feedforward"], out["master_gain"] = s.jerk_feedforward[k], s.master_gain[k]
    out["reset_gain"], out["reset_limit"] = s.reset_gain[k] / rate, s.reset_limit[k]
    out["high_pass"] = 1.0 / (1.0 + 2.0 * np.pi * s.force_cut_in / rate)
    corners = s.reference_high_pass[k], s.reference_damping[k], s.reference_low_pass[k]
    for part, matrix in zip("abcd", reference_generator(s.mode, *corners, rate), strict=True):
        out[f"generator_{part}"] = matrix
    for part, matrix in zip("abcd", feedback_generator(s.crossover[k], rate), strict=True):
        out[f"feedback_{part}"] = matrix
    acting = [n for n in s.notches if n.depth[k] != 0.0]
    for j, notch in enumerate(acting):
        out["notch"][j] = notch_section(notch.frequency[k], notch.bandwidth[k], notch.depth[k], rate)
    out["notches"] = len(acting)


def _oil_stiffness(p: Hydraulic) -> float:
    """Stiffness of an actuator's oil column with the valve closed, zero-position [N/m]."""
    stiffness = p.bulk_modulus * p.area_a / p.chamber_a
    return stiffness + (p.bulk_modulus * p.area_b / p.chamber_b if p.area_b > 0.0 else 0.0)


def _mass_about_c(plant: Plant) -> Array:
    """Mass matrix of the platen for motion of C and turns at the zero-position (6, 6)."""
    _, at_b = platen_inertia(plant.model, plant.machine)
    back = np.linalg.inv(_lever(plant))
    return back.T @ at_b @ back


def _lever(plant: Plant) -> Array:
    """Motion of C and Euler angles per twist at B (6, 6), zero-position: v_C = v_B + omega x rho."""
    rho = plant.body[0]["rho_c"]
    lever = np.eye(6)
    lever[:3, 3:] = np.array([[0.0, rho[2], -rho[1]], [-rho[2], 0.0, rho[0]], [rho[1], -rho[0], 0.0]])
    return lever
