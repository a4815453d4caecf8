"""Response of a specimen in a run: its modes and points, springs in its joints, and the wrench at its base."""

from typing import NamedTuple, Protocol

import numpy as np

from ..core.arrays import Array
from ..core.errors import SimulationError
from ..machine.specimen_forms import influence_of
from ..mechanics.interface_wrench import at_interface, driven_specimen, specimen_wrenches
from ..mechanics.modal_march import fine_steps, march_modes
from ..mechanics.modes import ModalMotion, modal_motion
from ..mechanics.plant import Plant
from ..mechanics.pose import PlantMotion, platen_motion, rotation
from ..mechanics.specimen_mount import base_twist
from .coupling import CouplingResult

__all__ = ["base_wrench", "driven_wrenches", "interface_wrench", "modes_of_run", "point_response", "spring_energy"]
__all__ += ["twists_of_run"]


class History(Protocol):
    """States of a plant over time, as of a run: q (n, nq), v and a (n, nv), z (n, n_states)."""

    @property
    def plant(self) -> Plant:
        """Plant."""

    @property
    def q(self) -> Array:
        """Configurations."""

    @property
    def v(self) -> Array:
        """Velocities."""

    @property
    def a(self) -> Array:
        """Accelerations."""

    @property
    def z(self) -> Array:
        """Hidden states."""


def twists_of_run(run: History) -> tuple[Array, Array, Array]:
    """Twist of B and its rate (n, 6), and gravity (n, 3) [m/s2], in platen axes, along a run."""
    plant = run.plant
    twist, rate = np.zeros((2, len(run.q), 6))
    twist[:, plant.axes], rate[:, plant.axes] = (x[:, : plant.axes.size] for x in (run.v, run.a))
    turn = rotation(platen_motion(plant, run.q, run.v, run.a).displacement[:, 3:])
    return twist, rate, -plant.machine.platen.gravity * turn[:, 2, :]


def modes_of_run(run: History) -> ModalMotion:
    """Modes of the specimen along a run."""
    return modal_motion(run.plant.modes, run.plant.coupling, run.z, *twists_of_run(run))


def spring_energy(run: History) -> tuple[Array, Array]:
    """Power [W] into, and energy [J] of, the springs in a specimen's joints along a run, each (n,)."""
    power, energy = np.zeros((2, len(run.q)))
    for spring in run.plant.springs:
        at = run.q[:, spring["q"]]
        if spring["turns"]:
            at = np.arctan2(run.q[:, spring["q"] + 1], at)
        power += spring["stiffness"] * (at - spring["rest"]) * run.v[:, spring["v"]]
        energy += 0.5 * spring["stiffness"] * (at - spring["rest"]) ** 2
    return power, energy


def point_response(run: History) -> dict[str, Array]:
    """Motion of a modal specimen's points (n, n_points) along their directions, in base axes.

    displacement and velocity relative to the base [m or rad], absolute acceleration [m/s2 or rad/s2]. Empty without
    points.
    """
    plant, specimen = run.plant, run.plant.machine.specimen
    if specimen is None or specimen.contents is None or not specimen.contents.points:
        return {}
    twist, rate, _ = twists_of_run(run)
    to_base = base_twist(plant.machine)
    base, moved = rate @ to_base.T, twist @ to_base.T
    base[:, :3] += np.cross(moved[:, 3:], moved[:, :3])
    carried = base @ influence_of(specimen.contents.points).T
    if specimen.modes is None:
        return {"displacement": 0.0 * carried, "velocity": 0.0 * carried, "acceleration": carried}
    modes, shape = modes_of_run(run), specimen.modes.shape
    return {
        "displacement": modes.displacement @ shape.T,
        "velocity": modes.velocity @ shape.T,
        "acceleration": carried + modes.acceleration @ shape.T,
    }


def base_wrench(run: History) -> Array:
    """Wrench (n, 6) [N, N m] of the platen on the specimen at its base, in base axes, linear first.

    Base shear, axial force and overturning moment, weight included (`_at_b` reversed). Raises SimulationError for a
    bare table.
    """
    machine = run.plant.machine
    if machine.specimen is None:
        raise SimulationError("a bare table carries no specimen; mount one (--specimen)")
    return -_at_b(run) @ np.linalg.inv(base_twist(machine))


def interface_wrench(run: History) -> Array:
    """Wrench (n, 6) [N, N m] of a run's specimen on the platen at the interface, in platen axes."""
    return at_interface(run.plant, _at_b(run))


def driven_wrenches(plant: Plant, motion: PlantMotion, dt: float, *, model_step: bool = False) -> Array:
    """Wrenches (n, 6) [N, N m] of a specimen on the platen at B in platen axes, along a prescribed motion of it.

    Its joints and modes respond from rest (`driven_specimen`, `march_modes`); with `model_step` modes take one step a
    sample, as in a run whose steps are these samples. Raises SimulationError for a specimen that is a program.
    """
    if plant.coupled is not None:
        raise SimulationError("a specimen that is a program runs with the table only, not along a recorded motion")
    modes = march_modes(plant, motion, dt, substeps=1 if model_step else fine_steps(plant, dt))
    return _at_b(_States(plant, *driven_specimen(plant, motion, dt), modes))


class _States(NamedTuple):
    plant: Plant
    q: Array
    v: Array
    a: Array
    z: Array


def _at_b(run: History) -> Array:
    """Wrench (n, 6) of a specimen on the platen at B in platen axes; of a coupled specimen what it exchanged."""
    plant = run.plant
    if plant.coupled is not None:
        exchanged: CouplingResult = run.coupling  # type: ignore[attr-defined]
        return exchanged.wrench @ base_twist(plant.machine)
    found = specimen_wrenches(plant, run.q, run.v, run.a)
    return found + modes_of_run(run).reaction if plant.modes.size else found
