"""What a specimen is as data: a rigid body with fixed-base modes, points of it, springs of joints. SI, base axes."""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import ParameterError

__all__ = ["DIRECTIONS", "JointSpring", "Modes", "Point", "RigidBody", "SpecimenContents", "check_shares"]
__all__ += ["influence_of", "rigid_body_of", "spatial_inertia"]

Vec3 = tuple[float, float, float]

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Directions of a point's coordinate: translations [m], rotations [rad]."""

_SHARE = 1e-3
"""Share of the rigid body's inertia by which modes may exceed it: frequencies and masses are stated to four digits."""
_ALIKE = 1e-6
"""Share of the largest entry within which an inertia is that of a rigid body."""


class RigidBody(NamedTuple):
    """The whole specimen as one rigid body."""

    mass: float  # [kg]
    centre: Vec3  # of gravity, from the base [m]
    inertia: Array  # (3, 3) about the centre [kg m2]


class Point(NamedTuple):
    """A coordinate of the specimen: the motion of a point along, or about, an axis of the base."""

    name: str
    at: Vec3  # from the base [m]
    direction: str  # of DIRECTIONS


class Modes(NamedTuple):
    """Modes of n on the fixed base, mass-normalised."""

    frequency: Array  # (n,) circular [rad/s]
    damping: Array  # (n, n) [1/s]; 2 zeta w on its diagonal, elsewhere zero unless damping couples modes
    participation: Array  # (n, 6) of the base's twist, linear first [sqrt(kg), sqrt(kg) m]
    shape: Array  # (n_points, n) displacement of the points [1/sqrt(kg)], of rotations [rad/(m sqrt(kg))]


class SpecimenContents(NamedTuple):
    """A specimen without joints: one rigid body, which may have modes."""

    title: str
    body: RigidBody
    modes: Modes | None
    points: tuple[Point, ...]


class JointSpring(NamedTuple):
    """Spring and damper in a joint of a URDF."""

    stiffness: float  # [N/m or N m/rad]
    damping: float  # [N s/m or N m s/rad], beside that of the URDF
    rest: float  # position without force of the spring [m or rad]


def influence_of(points: tuple[Point, ...]) -> Array:
    """Motion (n, 6) of points for a unit twist of the base: d . (v + omega x r), or d . omega of a rotation."""
    rows = []
    for point in points:
        axis = np.eye(3)["xyz".index(point.direction[-1])]
        turns = point.direction.startswith("r")
        rows.append([*np.zeros(3), *axis] if turns else [*axis, *np.cross(point.at, axis)])
    return np.array(rows).reshape(-1, 6)


def _skew(x: Vec3) -> Array:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def spatial_inertia(body: RigidBody) -> Array:
    """Spatial inertia (6, 6) at the base, linear first."""
    across = body.mass * _skew(body.centre)
    about = body.inertia - across @ _skew(body.centre)
    return np.block([[body.mass * np.eye(3), -across], [across, about]])


def rigid_body_of(inertia: Array, where: str) -> RigidBody:
    """Rigid body of a spatial inertia (6, 6) at the base; raises ParameterError if it is that of no rigid body."""
    mass = float(np.trace(inertia[:3, :3])) / 3.0
    per = 1.0 / mass if mass > 0.0 else 0.0
    centre = (float(inertia[5, 1]) * per, float(inertia[3, 2]) * per, float(inertia[4, 0]) * per)
    found = RigidBody(mass, centre, inertia[3:, 3:] + mass * _skew(centre) @ _skew(centre))
    if np.abs(spatial_inertia(found) - inertia).max() > _ALIKE * max(np.abs(inertia).max(), 1e-300):
        masses = ", ".join(f"{x:.4g}" for x in np.diag(inertia)[:3])
        raise ParameterError(
            f"{where}: the masses of the matrices are {masses} kg along x, y, z, those of no rigid body; "
            "state the whole specimen's mass, centre_of_gravity and inertia in [mass]"
        )
    return found


def check_shares(body: RigidBody, participation: Array, where: str) -> None:
    """Raise ParameterError if modes take more inertia than the rigid body has: M - sum G G^T must not be negative."""
    whole = spatial_inertia(body)
    length = np.sqrt(max(np.trace(whole[3:, 3:]) / (3.0 * body.mass), 1e-12))
    scale = np.repeat([1.0, 1.0 / length], 3) / np.sqrt(body.mass)
    values, vectors = np.linalg.eigh(scale[:, None] * (whole - participation.T @ participation) * scale)
    if values[0] < -_SHARE:
        k = int(np.argmax(np.abs(vectors[:, 0])))
        raise ParameterError(
            f"{where}: the modes' participation takes more inertia than [mass] states, by {-values[0]:.2%} of it, most "
            f"along {DIRECTIONS[k]}; correct the participation (mass-normalised, in sqrt(kg)) or the mass"
        )
