"""The machine drawn in its control zero-position: bodies, outlines, arrows, traces, camera and light."""

import math
from collections.abc import Sequence
from itertools import combinations, product
from typing import Any

import numpy as np
import pinocchio as pin

from ...core.arrays import Array
from ...machine.machine import Machine
from ..bodies import Bodies, body_name, body_poses, joint_positions, load_specimen_bodies, specimen_poses
from ..urdf import drawing_colour, legs
from .arrows import OPACITY, arrow_solid
from .frames import Frames
from .window import Window

__all__ = [
    "ROOT",
    "draw_arrows",
    "draw_machine",
    "draw_motion",
    "draw_names",
    "names_layer",
    "specimen_body",
    "table_of",
]


ROOT = "table"
FIELD_OF_VIEW = 36.0  # [deg]
CAMERA = (-0.4, 1.1, 2.05)  # its place in its own axes, x right, y up, z to the viewer, over the machine's radius
LIGHTS = (
    ("FillLight", "position", [-3.0, -6.0, 10.0]),
    ("FillLight", "intensity", 0.55),
    ("AmbientLight", "intensity", 0.5),
)
HIDDEN = ("/Grid", "/Axes", "/Lights/PointLightNegativeX", "/Lights/PointLightPositiveX")
FACES = {"radialSegments": 18, "widthSegments": 14, "heightSegments": 8}  # of round bodies: fewer than usual
NAMES = "names"
NAME = 0.12  # edge of the square that a leg's name is written in, over the platen's length
FINE = 0.004  # [m] between points of a path: a pixel where the whole table is seen
BACKGROUND = {"top_color": [0.93, 0.95, 0.97], "bottom_color": [0.80, 0.84, 0.88]}


def draw_machine(window: Window, machine: Machine, bodies: Bodies) -> None:
    """Send the machine in its control zero-position, the camera and the light."""
    from meshcat import geometry

    poses = body_poses(bodies.model, joint_positions(machine, bodies.model, np.zeros((1, 6))))[0]
    table, specimen = table_of(window), load_specimen_bodies(machine)
    for shape in bodies.shapes:
        *rgb, opacity = (float(c) for c in shape.meshColor)
        colour = sum(round(255.0 * c) << s for c, s in zip(rgb, (16, 8, 0), strict=True))
        material = geometry.MeshLambertMaterial(color=colour, opacity=opacity, depthWrite=opacity == 1.0)
        _draw(table[body_name(bodies.model, shape.parentJoint)], shape, poses, material)
    if specimen is not None:
        poses = specimen_poses(specimen, {}, 1)[0]
        for shape in specimen.shapes:
            material = geometry.MeshLambertMaterial(color=_number("specimen"))
            _draw(table[specimen_body(shape.parentJoint)], shape, poses, material)
    _set_stage(window, machine, specimen)


def names_layer() -> list[str]:
    """Paths in the scene of the legs' names."""
    return [f"meshcat/{ROOT}/{NAMES}", f"meshcat/{ROOT}/platen/{NAMES}"]


def specimen_body(joint: int) -> str:
    """Path in the scene of a body of the specimen, by joint: part of the platen."""
    return f"platen/specimen/{joint}"


def draw_names(window: Window, machine: Machine) -> None:
    """Send the names of the legs, upright: of swivel actuators over their barrels, of the others on the platen."""
    from meshcat import geometry

    table, size = table_of(window), NAME * max(machine.platen.size)
    upright = pin.rpy.rpyToMatrix(0.5 * math.pi, 0.0, 0.0)
    for leg in legs(machine):
        base, point = np.array(leg.base_point), np.array(leg.platen_point)
        if getattr(leg, "mount", "strut") == "swivel":
            body, place = table[NAMES], 0.75 * base + 0.25 * point + [0.0, 0.0, 0.4 * size]
        else:  # beside its arrow, in {b}
            body, place = table["platen"][NAMES], np.array([point[0] + 0.3 * size, point[1], 0.2 * size])
            place -= machine.platen.centre_of_gravity
        letters = {"type": "_text", "text": leg.name, "font_size": 110, "font_face": "sans-serif"}
        written = geometry.GenericTexture(letters)
        material = geometry.MeshBasicMaterial(map=written, side=0, transparent=True, depthWrite=False)
        body[leg.name].set_object(geometry.Box([size, size, 1e-3]), material)
        body[leg.name].set_transform(pin.SE3(upright, place).homogeneous)


def draw_motion(window: Window, machine: Machine, frames: Frames) -> None:
    """Send what frames add that stands still: outlines of the ghosts, and the path of C of every motion."""
    table = table_of(window)
    corners = _box_edges(np.array([*machine.platen.size, -machine.platen.bearing_plane[2]]))
    for ghost in frames.ghosts:
        table[ghost.name].set_object(_lines(corners, ghost.name))
    for name, motion in (*((g.name, g.displacement) for g in frames.ghosts), ("platen", frames.displacement)):
        path = motion[:, :3]
        if len(path) > 1:
            pieces = np.repeat(_thinned(path), 2, axis=0)[1:-1]
            table["trace"][name].set_object(_lines(pieces, "trace" if name == "platen" else name, seen_through=True))


def draw_arrows(window: Window, names: Sequence[str]) -> None:
    """Send one arrow for each of the legs `names`, fixed to its rod's end at the platen."""
    from meshcat import geometry

    table, solid = table_of(window), arrow_solid()
    for name in names:
        material = geometry.MeshBasicMaterial(opacity=OPACITY, depthTest=False)
        table[f"{name}_rod"]["force"].set_object(solid, material)


def _draw(body: Any, shape: Any, poses: Array, material: Any) -> None:
    """Send a body to its pose, and a primitive to its place on the body."""
    body.set_transform(pin.XYZQUATToSE3(poses[shape.parentJoint]).homogeneous)
    primitive, upright = _primitive(shape.geometry)
    body[shape.name].set_object(primitive, material)
    body[shape.name].set_transform(shape.placement.homogeneous @ upright)


def _number(kind: str) -> int:
    """Colour of a kind of body, as a number for meshcat."""
    return int(drawing_colour(kind).lstrip("#"), 16)


def table_of(window: Window) -> Any:
    """Meshcat's handle on all that belongs to the table, by path."""
    import meshcat

    return meshcat.Visualizer(window=window)[ROOT]


def _lines(points: Array, colour: str, seen_through: bool = False) -> Any:
    """Line segments between points (2 n, 3), two by two."""
    from meshcat import geometry

    shown = {"transparent": seen_through, "depthTest": not seen_through}
    material = geometry.LineBasicMaterial(color=_number(colour), linewidth=2.0, **shown)
    return geometry.LineSegments(geometry.PointsGeometry(points.T.astype(np.float32)), material)


def _set_stage(window: Window, machine: Machine, specimen: Bodies | None) -> None:
    """Camera from -Y, +X to the right, on the table and what stands on it; light from above; no grid."""
    import meshcat
    from meshcat import geometry

    vis = meshcat.Visualizer(window=window)
    points = np.array([p for leg in legs(machine) for p in (leg.base_point, leg.platen_point)])
    points = np.vstack([points, 0.5 * np.array([[*machine.platen.size, 0.0]]) * [[1, 1, 1], [-1, -1, 1]]])
    if specimen is not None:
        points = np.vstack([points, _reach(specimen) + machine.platen.centre_of_gravity])
    middle, radius = 0.5 * (points.max(0) + points.min(0)), 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))
    vis[ROOT].set_transform(pin.SE3(np.eye(3), -middle).homogeneous)  # meshcat's camera turns about the origin
    camera = vis["/Cameras/default/rotated"]
    camera.set_object(geometry.PerspectiveCamera(fov=FIELD_OF_VIEW, near=0.05 * radius, far=20.0 * radius))
    camera["<object>"].set_property("position", [radius * x for x in CAMERA])
    for light, property, value in LIGHTS:
        vis[f"/Lights/{light}/<object>"].set_property(property, value)
    for end, colour in BACKGROUND.items():
        vis["/Background"].set_property(end, colour)
    for thing in HIDDEN:
        vis[thing].set_property("visible", False)


def _reach(specimen: Bodies) -> Array:
    """Corners (n, 3) in the platen's {b} of boxes along it around a specimen's shapes."""
    poses, corners = specimen_poses(specimen, {}, 1)[0], []
    for shape in specimen.shapes:
        at = pin.XYZQUATToSE3(poses[shape.parentJoint]) * shape.placement
        round_body = getattr(shape.geometry, "radius", 0.0) * np.ones(3)
        round_body[2] += getattr(shape.geometry, "halfLength", 0.0)
        size = np.abs(at.rotation) @ getattr(shape.geometry, "halfSide", round_body)
        corners += [at.translation - size, at.translation + size]
    return np.array(corners)


def _primitive(shape: Any) -> tuple[Any, Array]:
    """Meshcat's geometry for a URDF primitive, and the turn (4, 4) that brings its axis to z."""
    from meshcat import geometry

    upright = np.eye(4)
    if hasattr(shape, "halfSide"):
        return geometry.Box([2.0 * float(s) for s in shape.halfSide]), upright
    if hasattr(shape, "halfLength"):
        upright[:3, :3] = pin.rpy.rpyToMatrix(0.5 * math.pi, 0.0, 0.0)
        return _with_faces(geometry.Cylinder(2.0 * float(shape.halfLength), float(shape.radius))), upright
    return _with_faces(geometry.Sphere(float(shape.radius))), upright


def _with_faces(body: Any) -> Any:
    """The same round body with `FACES`."""
    lower = body.lower
    body.lower = lambda data: {key: FACES.get(key, value) for key, value in lower(data).items()}
    return body


def _thinned(path: Array) -> Array:
    """First, last, and those points of a path (n, 3) that are `FINE` from the last one taken."""
    taken = [0]
    for k in range(1, len(path) - 1):
        if np.abs(path[k] - path[taken[-1]]).max() >= FINE:
            taken.append(k)
    return path[[*taken, len(path) - 1]]


def _box_edges(size: Array) -> Array:
    """Ends (24, 3) of the twelve edges of a box around the origin."""
    corners = np.array(list(product((-1, 1), repeat=3)))
    edges = [pair for pair in combinations(corners, 2) if np.abs(pair[0] - pair[1]).sum() == 2]
    return 0.5 * size * np.array(edges).reshape(-1, 3)
