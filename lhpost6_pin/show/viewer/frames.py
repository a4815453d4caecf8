"""Frames of an animation: motions and forces of a record, and of one laid over it, at a uniform frame rate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...core.errors import ParameterError, RecordError
from ...data.records import FULL_SCALE, refuse_other_machine, require
from ...machine.machine import Machine
from ...mechanics.plant import make_plant
from ...mechanics.pose import forward_kinematics

__all__ = ["AS_IT_IS", "Frames", "Ghost", "Look", "make_frames", "record_frames", "record_title", "recorded_forces"]


OTHERS = ("first_other", "second_other")
"""Names, which give the colours, of records overlaid."""

MOST_FRAMES = 36_000
"""Largest number of frames: 20 minutes at 30 a second, a page of some 100 MB."""

MOST_TURN = 0.5 * math.pi
"""Roll or pitch [rad] that is refused: Euler angles end at a pitch of this size."""


class Look(NamedTuple):
    """How a record is shown."""

    rate: float = 30.0  # frames a second
    amplify: float = 1.0  # factor on all motion
    gap: float = 1.0  # further factor on the differences of the outlines
    change: bool = False  # of forces from the first frame, without weight and preload

    def refuse(self) -> None:
        """Raise ParameterError naming what is not a positive number."""
        for name in ("rate", "amplify", "gap"):
            if not (math.isfinite(value := getattr(self, name)) and value > 0.0):
                raise ParameterError(f"{name} is {value:g}; it must be a positive number")

    @property
    def size(self) -> str:
        """How motion is drawn, in words."""
        words = "drawn to scale" if self.amplify == 1.0 else f"motion drawn {self.amplify:g} times as large"
        return words + f", gaps to the outlines {self.gap:g} times as large" * (self.gap != 1.0)


AS_IT_IS = Look()
"""Motion to scale, total forces."""


class Ghost(NamedTuple):
    """Another motion of the platen over its own time, to be drawn as an outline: the reference, or a second record."""

    name: str  # also its colour's
    label: str
    time: Array  # (m,) [s]
    displacement: Array  # (m, 6) of C in {s} and Euler angles [m, rad]


@dataclass(frozen=True)
class Frames:
    """Motion of C in {s} with Euler angles, and forces on the platen along the legs, at a uniform frame rate."""

    time: Array  # (n,) [s]
    displacement: Array  # (n, 6) [m, rad], enlarged
    ghosts: tuple[Ghost, ...]  # sampled and enlarged alike
    force: Array | None  # (n, n_legs) that push the platen away from the leg's base [N]; NaN where unknown
    look: Look
    full_scale: float | None = None  # force at which an arrow has its full length [N]; None: the largest
    joints: Mapping[str, Array] = field(default_factory=dict)  # (n,) of a specimen's joints, points [m, rad], enlarged


def make_frames(
    time: Array,
    displacement: Array,
    ghosts: Sequence[Ghost] = (),
    force: Array | None = None,
    look: Look = AS_IT_IS,
) -> Frames:
    """Sample a platen motion (n, 6), ghosts, and forces (n, n_legs) over time (n,) [s] as `look` states.

    Only the common time is kept. Raises RecordError for a motion that cannot be drawn, ParameterError for a number of
    the look that is not positive.
    """
    look.refuse()
    time, amplify, gap = np.asarray(time, float), look.amplify, look.gap
    moments = _moments([time, *(np.asarray(g.time, float) for g in ghosts)], look.rate)
    drawn = amplify * _sampled(moments, time, displacement, "platen_displacement", amplify)
    others = []
    for ghost in ghosts:
        there = amplify * _sampled(moments, ghost.time, ghost.displacement, ghost.label, amplify * gap)
        others.append(Ghost(ghost.name, ghost.label, moments, drawn + gap * (there - drawn)))
    for motion in (drawn, *(g.displacement for g in others)):
        if np.abs(motion[:, 3:5]).max() >= MOST_TURN:
            raise ParameterError(f"amplified {amplify * gap:g} times the platen turns over; amplify less")
    legs = None if force is None else _columns(moments, time, np.asarray(force, float))
    if legs is not None and look.change:
        legs -= legs[0].copy()
    return Frames(moments, drawn, tuple(others), legs, look)


def record_frames(
    machine: Machine, record: xr.Dataset, others: Sequence[xr.Dataset] = (), look: Look = AS_IT_IS
) -> Frames:
    """Frames of a record, with its reference and other records over it, two at most.

    A record without platen displacement is drawn from its actuator displacements. Raises RecordError if it has neither,
    if a record is of another machine, or if the records share no time; else as `make_frames`.
    """
    for one in (record, *others):
        refuse_other_machine(machine, one)
    time, ghosts = record["time"].values, []
    if "reference_displacement" in record:
        ghosts.append(Ghost("reference", "reference", time, record["reference_displacement"].values))
    if len(others) > len(OTHERS):
        raise ParameterError(f"{len(others)} records over another are not distinguishable; give at most {len(OTHERS)}")
    for name, other in zip(OTHERS, others, strict=False):
        label = f"{record_title(other)}, {other.attrs.get('kind', 'record')}"
        ghosts.append(Ghost(name, label, other["time"].values, _motion(machine, other)))
    frames = make_frames(time, _motion(machine, record), ghosts, recorded_forces(machine, record), look)
    scale = record.attrs.get(FULL_SCALE)
    return replace(frames, joints=_joints(record, frames), full_scale=None if scale is None else float(scale))


def record_title(record: xr.Dataset) -> str:
    """Title of a record, else its test."""
    return str(record.attrs.get("title", record.attrs.get("test", "record")))


def _moments(times: Sequence[Array], rate: float) -> Array:
    first, last = max(t[0] for t in times), min(t[-1] for t in times)
    if last <= first:
        spans = " and ".join(f"{t[0]:g} to {t[-1]:g} s" for t in (times[0], times[-1]))
        raise RecordError(f"the records do not overlap in time: {spans}; both must begin with the same test")
    frames = int((last - first) * rate * (1.0 + 1e-12)) + 1
    if frames > MOST_FRAMES:
        raise ParameterError(
            f"{last - first:g} s at {rate:g} frames a second are {frames}, more than {MOST_FRAMES}: cut the record, or "
            "reduce --fps"
        )
    return np.asarray(first + np.arange(frames) / rate)


def _sampled(moments: Array, time: Array, motion: Array, name: str, factor: float) -> Array:
    motion = np.asarray(motion, float)
    if motion.shape != (time.size, 6) or not np.isfinite(motion).all():
        raise RecordError(f"{name} must be {time.size} samples of six finite numbers; it is {motion.shape}")
    if np.abs(motion).max(initial=0.0) > math.pi * 1e6 / factor:
        raise ParameterError(f"amplified {factor:g} times {name} leaves the picture; amplify less")
    return _columns(moments, time, motion)


def _columns(moments: Array, time: Array, values: Array) -> Array:
    return np.stack([np.interp(moments, time, column) for column in values.T], axis=1)


def _motion(machine: Machine, record: xr.Dataset) -> Array:
    if "platen_displacement" in record:
        return np.asarray(record["platen_displacement"].values)
    require(record, "actuator_displacement")
    return forward_kinematics(make_plant(machine), record["actuator_displacement"].values)[0]


def _joints(record: xr.Dataset, frames: Frames) -> dict[str, Array]:
    """Motion of a specimen's joints or points by name."""
    found: dict[str, Array] = {}
    for name, dim in (("specimen_joint_position", "specimen_joint"), ("specimen_displacement", "specimen_point")):
        if name not in record:
            continue
        moved = record[name]
        if moved.dims != ("time", dim) or moved.dtype.kind != "f" or not np.isfinite(moved.values).all():
            raise RecordError(f"{name} must be finite numbers by time and {dim}; correct or omit it")
        drawn = _columns(frames.time, record["time"].values, moved.values)
        found |= dict(zip(map(str, record[dim].values), frames.look.amplify * drawn.T, strict=True))
    return found


def recorded_forces(machine: Machine, record: xr.Dataset) -> Array | None:
    """Forces along actuators and struts (n, n_legs); a strut's gas pulls its ends together (Eq. 4-8)."""
    parts = []
    for name, legs in (("actuator_force", machine.actuators), ("strut_pressure", machine.struts)):
        if name not in record:
            parts.append(np.full((record.sizes["time"], len(legs)), np.nan))
        elif record[name].shape[1] != len(legs):
            raise RecordError(f"{name} has {record[name].shape[1]} columns; {machine.name} has {len(legs)}")
        else:
            parts.append(record[name].values)
    forces, pressures = parts
    force = np.hstack([forces, -pressures * [s.area for s in machine.struts]])
    return None if np.isnan(force).all() else force
