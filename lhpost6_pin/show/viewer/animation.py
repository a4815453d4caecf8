"""Frames as one meshcat animation: tracks of packed numbers, a tenth of the size of meshcat's lists of keys."""

import logging
from typing import Any

import numpy as np

from ...core.arrays import Array
from ...machine.machine import Machine
from ...mechanics.pose import rotation
from ..bodies import (
    Bodies,
    body_name,
    body_poses,
    joint_positions,
    load_specimen_bodies,
    quaternions,
    specimen_poses,
)
from ..urdf import legs
from .arrows import arrow_colours, arrow_sizes, largest_force
from .frames import Frames
from .scene import ROOT, specimen_body
from .window import Window, packed_array

__all__ = ["draw_animation", "leg_forces"]

log = logging.getLogger(__name__)


LOOP_FOR_EVER = 1_000_000_000  # repetitions
UNSEEN = 1e-9  # [m, 1] invisible change

_POSE = (("position", "vector3", slice(0, 3)), ("quaternion", "quaternion", slice(3, 7)))


def draw_animation(window: Window, machine: Machine, bodies: Bodies, frames: Frames) -> None:
    """Send the frames as one animation that loops; bodies at rest are omitted."""
    q = joint_positions(machine, bodies.model, frames.displacement)
    _warn_of_strokes(machine, bodies.model, q)
    poses = body_poses(bodies.model, q)
    moving = {body_name(bodies.model, joint): poses[:, joint] for joint in range(1, bodies.model.njoints)}
    if frames.joints and (specimen := load_specimen_bodies(machine)) is not None:
        on_platen = specimen_poses(specimen, frames.joints, len(frames.time))
        moving |= {specimen_body(joint): on_platen[:, joint] for joint in range(1, specimen.model.njoints)}
    moving |= {g.name: _outline_poses(machine, g.displacement) for g in frames.ghosts}
    clips = []
    for name, pose in moving.items():
        moves = [one for one in _POSE if np.ptp(pose[:, one[2]], axis=0).max() > UNSEEN]
        tracks = [_track(key, kind, pose[:, part]) for key, kind, part in moves]
        clips.append(_clip(frames, name, tracks))
    largest = frames.full_scale or (largest_force(frames.force) if frames.force is not None else 1.0)
    for name, force in leg_forces(machine, frames).items():
        arrow = f"{name}_rod/force"
        clips.append(_clip(frames, arrow, [_track("scale", "vector", arrow_sizes(machine, force, largest))]))
        colours = _track("material.color", "color", arrow_colours(force, largest))
        clips.append(_clip(frames, f"{arrow}/<object>", [colours]))
    window.send(_Animation([clip for clip in clips if clip["clip"]["tracks"]]))


def leg_forces(machine: Machine, frames: Frames) -> dict[str, Array]:
    """Forces (n,) [N] of the legs whose forces are recorded, by name."""
    if frames.force is None:
        return {}
    named = zip(legs(machine), frames.force.T, strict=True)
    return {leg.name: force for leg, force in named if np.isfinite(force).all()}


def _outline_poses(machine: Machine, displacement: Array) -> Array:
    """Position and quaternion (n, 7) in {s} of the box that a ghost's platen is drawn as."""
    middle = np.array([0.0, 0.0, 0.5 * machine.platen.bearing_plane[2]])
    turn = rotation(displacement[:, 3:])
    return np.hstack([displacement[:, :3] + turn @ middle, quaternions(turn)])


def _warn_of_strokes(machine: Machine, model: Any, q: Array) -> None:
    """Log which actuators are drawn beyond their stroke."""
    extension = [np.abs(q[:, model.idx_qs[model.getJointId(f"{a.name}_extension")]]).max() for a in machine.actuators]
    beyond = [a.name for a, most in zip(machine.actuators, extension, strict=True) if most > a.stroke]
    if beyond:
        log.warning(
            "drawn beyond the stroke: %s; reduce --amplify to draw positions within the stroke", ", ".join(beyond)
        )


class _Animation:
    """A `set_animation` command."""

    def __init__(self, clips: list[dict[str, Any]]) -> None:
        self.clips = clips

    def lower(self) -> dict[str, Any]:
        options = {"play": True, "repetitions": LOOP_FOR_EVER}
        return {"type": "set_animation", "animations": self.clips, "options": options, "path": ""}


def _track(key: str, kind: str, values: Array) -> dict[str, Any]:
    times = packed_array(np.arange(len(values)))
    return {"name": f".{key}", "type": kind, "times": times, "values": packed_array(values)}


def _clip(frames: Frames, name: str, tracks: list[dict[str, Any]]) -> dict[str, Any]:
    clip = {"fps": frames.look.rate, "name": name, "tracks": tracks}
    return {"path": f"/meshcat/{ROOT}/{name}", "clip": clip}
