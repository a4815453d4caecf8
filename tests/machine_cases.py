"""What the tests of kinematics, ports, poses and the rigid body share: machines, poses, smooth motions."""

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin

from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.pose import PlatenMotion

DATA = Path(__file__).parent / "data"
REFERENCE = DATA / "records" / "open_loop_ridgecrest.nc"
PRACTICE = DATA / "records" / "practice_a_TX.nc"
PENDULUM = DATA / "pendulum.urdf"
STEWART = DATA / "stewart.toml"
SCRIPTS = Path(__file__).parent.parent / "scripts"
FREE_MACHINES = ("lhpost6", "stewart", "hexapod")
MACHINES = (*FREE_MACHINES, "uniaxial", "biaxial")


@cache
def machine_named(name: str, thrust: str = "report") -> Machine:
    """The shipped machine, or one of the test machines in tests/data."""
    path = DATA / f"{name}.toml"
    return load_machine(path if path.is_file() else name).with_params({"machine.thrust": thrust})


@cache
def plant_named(name: str, thrust: str = "report") -> Plant:
    """Plant of `machine_named`."""
    return make_plant(machine_named(name, thrust))


def random_poses(machine: Machine, count: int, seed: int = 0) -> np.ndarray:
    """Poses (count, 6), uniform over the whole travel range, its corners first."""
    rng = np.random.default_rng(seed)
    reach = np.array(machine.limits.displacement)
    reach[~np.isin(np.arange(6), machine.axes)] = 0.0
    corners = np.sign(rng.uniform(-1.0, 1.0, (count // 4, 6)))
    inside = rng.uniform(-1.0, 1.0, (count - len(corners), 6))
    return reach * np.vstack([corners, inside])


def smooth_motion(machine: Machine, t: np.ndarray, seed: int = 0) -> PlatenMotion:
    """Sum of sines over the travel range at times t (n,), with exact derivatives; (n, 6) each."""
    rng = np.random.default_rng(seed)
    reach = np.array(machine.limits.displacement) / 3.0
    reach[~np.isin(np.arange(6), machine.axes)] = 0.0
    omega, phase = rng.uniform(1.0, 8.0, (3, 6)), rng.uniform(0.0, 2.0 * np.pi, (3, 6))
    angle = np.multiply.outer(t, omega) + phase  # (n, 3, 6)
    return PlatenMotion(
        reach * np.sin(angle).sum(axis=1),
        reach * (omega * np.cos(angle)).sum(axis=1),
        reach * (-(omega**2) * np.sin(angle)).sum(axis=1),
    )


def platen_se3(machine: Machine, pose: np.ndarray) -> pin.SE3:
    """Placement of {b} in {s}, made by Pinocchio alone."""
    turn = pin.rpy.rpyToMatrix(*pose[3:])
    top = pin.SE3(turn, np.array(pose[:3]))
    return top * pin.SE3(np.eye(3), np.array(machine.platen.centre_of_gravity))


def frame_array(machine: Machine, pose: np.ndarray) -> np.ndarray:
    """The compiled code's frame (8, 3) at a pose; rows 4 to 7 are zero."""
    placement = platen_se3(machine, pose)
    frame = np.zeros((8, 3))
    frame[:3], frame[3] = placement.rotation, placement.translation
    return frame
