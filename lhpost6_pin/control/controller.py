"""A controller of a given plant: the tables of the compiled step, and the step for one sample."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.errors import ControllerError
from ..core.names import SAMPLE_RATE
from ..effects.registry import parameters_of
from ..laws.orifice import opening
from ..machine.machine import Machine
from ..mechanics.equilibrium import Equilibrium, find_equilibrium, unloaded_speeds
from ..mechanics.payload import lock_joints
from ..mechanics.plant import Plant, make_plant
from ..mechanics.pose import kinematic_jacobian
from ..mechanics.rigid_body import platen_inertia
from .filters import drive_for, feedback_generator, notch_section, reference_generator
from .loop import FEEDBACK, FORCE, GENERATOR, MEMORY_ROWS, POSE, Feedback, control_step
from .plug import Wanted
from .settings import ControllerSettings
from .tables import ACTUATOR, AXIS, CANCELLER, ControlTables, make_scratch, pack_control

__all__ = ["Controller", "controlled", "make_controller"]


class Controller(NamedTuple):
    """Settings for a given plant as tables of `loop.control_step`; treat the arrays as read only."""

    settings: ControllerSettings
    plant: Plant
    axis: NDArray[np.void]  # tables.AXIS, one row a free axis
    actuator: NDArray[np.void]  # tables.ACTUATOR
    balance: Array  # (n_actuators, n_actuators) leg rate [m/s] per force [N] in the null space of the motion
    canceller: NDArray[np.void]  # tables.CANCELLER, empty but in sine tests
    jacobian: Array  # (n_actuators, 6) leg rates per motion of C and Euler angles, zero-position
    lever: Array  # (6, 6) motion of C and Euler angles per twist at B, zero-position

    @property
    def tables(self) -> ControlTables:
        """Tables as compiled code reads them, newly packed."""
        return pack_control(self.axis, self.actuator, self.balance, self.canceller)

    @property
    def columns(self) -> int:
        """Columns of the drive: six; with sine cancellers also the wanted acceleration and the level."""
        return 13 if len(self.canceller) else 6

    def init(self) -> Array:
        """The controller's memory at rest, for one run."""
        return np.zeros((MEMORY_ROWS + len(self.canceller), max(6, self.plant.spools)))

    def init_at(self, place: Array, force: Array) -> Array:
        """The controller's memory at rest at a place (6,) [m, rad], held by forces (n_actuators,) [N]."""
        memory, axes = self.init(), self.plant.axes
        drive = self.drive_for(place[None], *np.zeros((2, 1, 6)))[0]
        memory[POSE, :6] = place
        memory[FORCE, : len(axes)] = (force - self.actuator["force"]) @ self.jacobian[:, axes]
        for a, k in enumerate(axes):
            row = self.axis[a]
            for first, matrix, inputs in (
                (GENERATOR, row["generator_a"], row["generator_b"] * drive[k]),
                (FEEDBACK, row["feedback_a"], row["feedback_b"] @ np.array([place[k], 0.0])),
            ):
                memory[first : first + len(matrix), a] = np.linalg.solve(np.eye(len(matrix)) - matrix, inputs)
        return memory

    def step(self, memory: Array, sample: int, drive: Array, sensors: Feedback) -> Array:
        """Command (n_actuators,) of a sample from drive (n, columns) and the sensors.

        memory is changed in place. For one sample at a time: runs call the compiled step directly. Raises
        ControllerError for a wrong shape or sample number, which compiled code does not check.
        """
        n = self.plant.spools
        self._check("drive", drive, (len(drive), self.columns))
        self._check("memory", memory, (MEMORY_ROWS + len(self.canceller), max(6, n)))
        for name, values, size in zip(Feedback._fields, sensors, (n, 6, n), strict=True):
            self._check(f"sensors' {name}", values, (size,))
        if not 0 <= sample < len(drive):
            raise ControllerError(f"{self.settings.name}: sample {sample} of a drive with {len(drive)} samples")
        command = np.empty(n)
        scratch = make_scratch(self.plant)
        control_step(sample, drive, Feedback(*sensors), self.plant.tables, self.tables, memory, scratch, command)
        return command

    def _check(self, name: str, values: Array, shape: tuple[int, ...]) -> None:
        if not isinstance(values, np.ndarray) or values.shape != shape:
            what = f"{type(values).__name__} of shape {np.shape(values)}"
            raise ControllerError(f"{self.settings.name}: {name} is {what}; an array of shape {shape} is needed")

    def drive_for(self, displacement: Array, velocity: Array, acceleration: Array) -> Array:
        """Drive (n, 6) whose reference is the given motion, (n, 6) each (`filters.drive_for`).

        Raises ControllerError for a wrong shape.
        """
        s = self.settings
        for name, values in zip(Wanted._fields, (displacement, velocity, acceleration), strict=True):
            self._check(f"wanted {name}", values, (len(displacement), 6))
        corners = np.array(s.reference_high_pass), np.array(s.reference_damping)
        return np.ascontiguousarray(drive_for(s.mode, displacement, velocity, acceleration, *corners))


def make_controller(plant: Plant, rest: Equilibrium, settings: ControllerSettings) -> Controller:
    """Compute the controller's tables for a plant: filters, force gains, valves, null space of the motion.

    Force feedback of damping ratio zeta on an oil column of stiffness K and mass M is a velocity of
    2 zeta / sqrt(K M) per unit force; M is that of the platen with a specimen, its joints locked. Valve gains are
    steady unloaded piston velocities at full opening. Raises ControllerError for settings whose rate differs from that
    of the samples.
    """
    if settings.rate != SAMPLE_RATE:
        origin = settings.stated.origin
        raise ControllerError(f"{origin}: loop.rate is {settings.rate:g} Hz; the rate of samples is {SAMPLE_RATE} Hz")
    n, axes = plant.spools, plant.axes
    jacobian = np.ascontiguousarray(kinematic_jacobian(plant))
    actuator, oil = np.zeros(n, ACTUATOR), np.zeros(n)
    for i, row in enumerate(plant.rows[plant.tables.actuators]):
        p, force, spool = parameters_of(row), float(rest.force[i]), float(rest.spool[i])
        extend, retract = unloaded_speeds(p, force, plant.supply)
        actuator[i] = extend, retract, p.flow_curve, opening(spool, p.flow_curve), force, settings.spool_limit
        oil[i] = p.bulk_modulus * p.area_a / p.chamber_a  # stiffness with the valve closed, zero-position [N/m]
        oil[i] += p.bulk_modulus * p.area_b / p.chamber_b if p.area_b > 0.0 else 0.0
    stiffness = (jacobian.T * oil) @ jacobian
    lever = _lever(plant)
    carrying = lock_joints(plant)  # whether a specimen moves or not, the table carries all of its mass
    _, mass_at_b = platen_inertia(carrying.model, carrying.machine)
    back = np.linalg.inv(lever)
    mass = back.T @ mass_at_b @ back  # of C and Euler angles
    axis = np.zeros(axes.size, AXIS)
    for out, k in zip(axis, axes, strict=True):
        _fill_axis(out, settings, int(k))
        out["force_gain"] = 2.0 * settings.force_damping[k] / np.sqrt(stiffness[k, k] * mass[k, k])
    free = jacobian[:, axes]
    null = np.eye(n) - free @ np.linalg.pinv(free)
    balance = settings.balance_gain * null @ np.diag(1.0 / oil) @ null
    return Controller(settings, plant, axis, actuator, balance, np.zeros(0, CANCELLER), jacobian, lever)


def controlled(machine: Machine, settings: ControllerSettings) -> tuple[Plant, Equilibrium, Controller]:
    """Plant of a machine, its equilibrium in the zero-position, and its controller."""
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    return plant, rest, make_controller(plant, rest, settings)


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
    generators = {
        "generator": reference_generator(s.mode, *corners, rate),
        "feedback": feedback_generator(s.crossover[k], rate),
    }
    for name, matrices in generators.items():
        for part, matrix in zip("abcd", matrices, strict=True):
            out[f"{name}_{part}"] = matrix
    acting = [n for n in s.notches if n.depth[k] != 0.0]
    for j, notch in enumerate(acting):
        out["notch"][j] = notch_section(notch.frequency[k], notch.bandwidth[k], notch.depth[k], rate)
    out["notches"] = len(acting)


def _lever(plant: Plant) -> Array:
    """Motion of C and Euler angles per twist at B (6, 6), zero-position: v_C = v_B + omega x rho."""
    lever = np.eye(6)
    lever[:3, 3:] = np.cross(np.eye(3), plant.body[0]["rho_c"]).T
    return lever
