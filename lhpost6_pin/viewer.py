"""A record to look at: the machine's bodies follow it in a browser.

The URDF gives bodies and joints (`urdf`), `bodies` where they are in every frame, meshcat draws. A scene and its
animation are meshcat commands, sent to a window of `viewer_page`: a file that plays off line or a page on loopback.
"""

import logging
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import xarray as xr
from numpy.typing import NDArray

from .bodies import Bodies, body_name, body_poses, joint_positions, load_bodies, quaternions
from .errors import ParameterError, RecordError
from .files import write_whole
from .machine import Machine
from .pose import rotation
from .records import require
from .urdf import drawing_colour, legs
from .viewer_page import LoopbackWindow, Recorder, packed_array, render_page

__all__ = [
    "Frames",
    "draw_animation",
    "draw_scene",
    "live_animation",
    "make_frames",
    "record_frames",
    "save_animation",
]

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

ROOT = "table"
LOOP_FOR_EVER = 1_000_000_000  # repetitions
FIELD_OF_VIEW = 36.0  # [deg]
CAMERA = (-0.4, 1.1, 2.05)  # its place in its own axes, x right, y up, z to the viewer, over the machine's radius
LIGHTS = (
    ("FillLight", "position", [-3.0, -6.0, 10.0]),
    ("FillLight", "intensity", 0.55),
    ("AmbientLight", "intensity", 0.5),
)
HIDDEN = ("/Grid", "/Axes", "/Lights/PointLightNegativeX", "/Lights/PointLightPositiveX")
BACKGROUND = {"top_color": [0.93, 0.95, 0.97], "bottom_color": [0.80, 0.84, 0.88]}


class Frames(NamedTuple):
    """Platen motion of an animation at a uniform frame rate."""

    rate: float  # [1/s]
    displacement: Array  # (n, 6) of C in {s} and Euler angles [m, rad]
    reference: Array | None  # (n, 6) the same, as asked for
    amplify: float  # factor on both


# ------------------------------------------------------------------------------------------------ frames
def make_frames(
    time: Array,
    displacement: Array,
    reference: Array | None = None,
    *,
    rate: float = 30.0,
    amplify: float = 1.0,
) -> Frames:
    """Sample a platen motion (n, 6) over time (n,) [s] at `rate` frames a second, enlarged `amplify` times.

    Raises RecordError for a motion that cannot be drawn, ParameterError for a rate or factor that makes no sense.
    """
    for name, value in (("rate", rate), ("amplify", amplify)):
        if not (math.isfinite(value) and value > 0.0):
            raise ParameterError(f"{name} is {value:g}; it must be a positive number")
    time = np.asarray(time, float)
    moments = time[0] + np.arange(int((time[-1] - time[0]) * rate * (1.0 + 1e-12)) + 1) / rate

    def sampled(motion: Array, name: str) -> Array:
        motion = np.asarray(motion, float)
        if motion.shape != (time.size, 6) or not np.isfinite(motion).all():
            raise RecordError(f"{name} must be {time.size} samples of six finite numbers; it is {motion.shape}")
        if np.abs(motion).max(initial=0.0) > math.pi * 1e6 / amplify:
            raise ParameterError(f"amplified {amplify:g} times {name} leaves every picture; amplify less")
        return amplify * np.stack([np.interp(moments, time, column) for column in motion.T], axis=1)

    asked = None if reference is None else sampled(reference, "reference_displacement")
    frames = Frames(rate, sampled(displacement, "platen_displacement"), asked, amplify)
    if np.abs(frames.displacement[:, 3:5]).max() >= 0.5 * math.pi:
        raise ParameterError(f"amplified {amplify:g} times the platen turns over; amplify less")
    return frames


def record_frames(machine: Machine, record: xr.Dataset, *, rate: float = 30.0, amplify: float = 1.0) -> Frames:
    """Frames of a record; a record without platen displacement is drawn from its actuator displacements.

    Raises RecordError if it has neither.
    """
    if "platen_displacement" in record:
        motion = record["platen_displacement"].values
    else:
        require(record, "actuator_displacement")
        from .plant import make_plant
        from .pose import forward_kinematics

        motion, _ = forward_kinematics(make_plant(machine), record["actuator_displacement"].values)
    reference = record["reference_displacement"].values if "reference_displacement" in record else None
    return make_frames(record["time"].values, motion, reference, rate=rate, amplify=amplify)


# --------------------------------------------------------------------------------------------- drawing
def draw_scene(window: Recorder | LoopbackWindow, machine: Machine, bodies: Bodies, reference: bool = False) -> None:
    """Send the machine in its control zero-position, the camera and the light; with the reference's outline."""
    import meshcat
    from meshcat import geometry

    vis = meshcat.Visualizer(window=window)
    poses = body_poses(bodies.model, joint_positions(machine, bodies.model, np.zeros((1, 6))))[0]
    table = vis[ROOT]
    for shape in bodies.shapes.geometryObjects:
        body = table[body_name(bodies.model, shape.parentJoint)]
        body.set_transform(pin.XYZQUATToSE3(poses[shape.parentJoint]).homogeneous)
        primitive, upright = _primitive(shape.geometry)
        red, green, blue, opacity = (float(c) for c in shape.meshColor)
        colour = sum(round(255.0 * c) << s for c, s in ((red, 16), (green, 8), (blue, 0)))
        material = geometry.MeshLambertMaterial(color=colour, opacity=opacity, depthWrite=opacity == 1.0)
        body[shape.name].set_object(primitive, material)
        body[shape.name].set_transform(shape.placement.homogeneous @ upright)
    if reference:
        corners = _box_edges(np.array([*machine.platen.size, -machine.platen.bearing_plane[2]]))
        lines = geometry.LineBasicMaterial(color=int(drawing_colour("reference").lstrip("#"), 16), linewidth=2.0)
        outline = geometry.LineSegments(geometry.PointsGeometry(corners.T.astype(np.float32)), lines)
        table["reference"].set_object(outline)
    _set_stage(vis, machine)


def _set_stage(vis: Any, machine: Machine) -> None:
    """Camera that sees the whole table from -Y, +X to the right; light from above; no grid through the platen."""
    from meshcat import geometry

    points = np.array([p for leg in legs(machine) for p in (leg.base_point, leg.platen_point)])
    points = np.vstack([points, 0.5 * np.array([[*machine.platen.size, 0.0]]) * [[1, 1, 1], [-1, -1, 1]]])
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


def draw_animation(window: Recorder | LoopbackWindow, machine: Machine, bodies: Bodies, frames: Frames) -> None:
    """Send the frames as one animation that loops; bodies that stand still are left out."""
    from meshcat.path import Path as MeshcatPath

    q = joint_positions(machine, bodies.model, frames.displacement)
    _warn_of_strokes(machine, bodies.model, q)
    poses = body_poses(bodies.model, q)
    moving = {body_name(bodies.model, joint): poses[:, joint] for joint in range(1, bodies.model.njoints)}
    if frames.reference is not None:
        middle = np.array([0.0, 0.0, 0.5 * machine.platen.bearing_plane[2]])
        turn = rotation(frames.reference[:, 3:])
        moving["reference"] = np.hstack([frames.reference[:, :3] + turn @ middle, quaternions(turn)])
    clips = []
    for name, pose in moving.items():
        tracks = [
            {"name": f".{key}", "type": kind, "times": packed_array(np.arange(len(pose))), "values": packed_array(part)}
            for key, kind, part in (("position", "vector3", pose[:, :3]), ("quaternion", "quaternion", pose[:, 3:]))
            if np.ptp(part, axis=0).max() > 1e-9  # [m, 1]: nobody sees less
        ]
        path = MeshcatPath(("meshcat", ROOT, name)).lower()
        clips.append({"path": path, "clip": {"fps": frames.rate, "name": name, "tracks": tracks}})
    window.send(_Animation([clip for clip in clips if clip["clip"]["tracks"]]))


class _Animation:
    """A `set_animation` command whose tracks are packed arrays: a tenth of the size of meshcat's lists of keys."""

    def __init__(self, clips: list[dict[str, Any]]) -> None:
        self.clips = clips

    def lower(self) -> dict[str, Any]:
        options = {"play": True, "repetitions": LOOP_FOR_EVER}
        return {"type": "set_animation", "animations": self.clips, "options": options, "path": ""}


def _warn_of_strokes(machine: Machine, model: Any, q: Array) -> None:
    extension = [np.abs(q[:, model.idx_qs[model.getJointId(f"{a.name}_extension")]]).max() for a in machine.actuators]
    beyond = [a.name for a, most in zip(machine.actuators, extension, strict=True) if most > a.stroke]
    if beyond:
        log.warning("drawn beyond the stroke: %s; amplify less to see it as it can be", ", ".join(beyond))


def _primitive(shape: Any) -> tuple[Any, Array]:
    """Meshcat's geometry for a URDF primitive, and the turn (4, 4) that brings its axis to z."""
    from meshcat import geometry

    upright = np.eye(4)
    if hasattr(shape, "halfSide"):
        return geometry.Box([2.0 * float(s) for s in shape.halfSide]), upright
    if hasattr(shape, "halfLength"):
        upright[:3, :3] = pin.rpy.rpyToMatrix(0.5 * math.pi, 0.0, 0.0)
        return geometry.Cylinder(2.0 * float(shape.halfLength), float(shape.radius)), upright
    return geometry.Sphere(float(shape.radius)), upright


def _box_edges(size: Array) -> Array:
    """Ends (24, 3) of the twelve edges of a box around the origin."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(signs[a] - signs[b]).sum() == 2]
    return np.array([0.5 * size * signs[k] for pair in pairs for k in pair])


# ------------------------------------------------------------------------------------------------ pages
def save_animation(
    machine: Machine, record: xr.Dataset, path: Path | str, *, rate: float = 30.0, amplify: float = 1.0
) -> None:
    """Write one HTML file that shows a record and plays off line; no server is started.

    Raises RecordError or ParameterError as `record_frames`.
    """
    frames = record_frames(machine, record, rate=rate, amplify=amplify)
    recorder = Recorder()
    _draw(recorder, machine, frames)
    page = render_page(*_words(machine, record, frames), recorder.commands)
    with write_whole(path) as beside:
        beside.write_text(page, encoding="utf-8")


def live_animation(machine: Machine, record: xr.Dataset, *, rate: float = 30.0, amplify: float = 1.0) -> LoopbackWindow:
    """Return a window that shows a record at its `url` while used in a ``with`` block; only this computer can look.

    Raises RecordError or ParameterError as `record_frames`.
    """
    frames = record_frames(machine, record, rate=rate, amplify=amplify)
    window = LoopbackWindow(render_page(*_words(machine, record, frames), live=True))
    _draw(window, machine, frames)
    return window


def _draw(window: Recorder | LoopbackWindow, machine: Machine, frames: Frames) -> None:
    bodies = load_bodies(machine)
    draw_scene(window, machine, bodies, frames.reference is not None)
    draw_animation(window, machine, bodies, frames)


def _words(machine: Machine, record: xr.Dataset, frames: Frames) -> tuple[str, str, dict[str, str]]:
    """Title, note and legend of a record's page."""
    size = "drawn to scale" if frames.amplify == 1.0 else f"motion drawn {frames.amplify:g} times as large"
    seconds = (len(frames.displacement) - 1) / frames.rate
    kind = str(record.attrs.get("kind", "record"))
    note = f"{machine.name}, {kind}, {seconds:.1f} s at {frames.rate:g} frames/s, {size}; +X to the right"
    kinds = {"platen": "platen"} | {a.mount: f"{a.kind} actuators" for a in machine.actuators}
    kinds |= {"strut": f"{machine.struts[0].kind} struts"} if machine.struts else {}
    kinds |= {"reference": "reference (outline)"} if frames.reference is not None else {}
    legend = {word.replace("_", "-"): drawing_colour(kind) for kind, word in kinds.items()}
    return str(record.attrs.get("title", record.attrs.get("test", "record"))), note, legend
