"""Measured accelerations of points of the platen, and the platen's acceleration from them.

A record holds the readings as `point_acceleration`, with points and directions as attributes, and beside them
`platen_acceleration`. After a test pose and rates are known from displacements, so that tilt and turning, which a
controller's constant weights mistake for acceleration (`mechanics.accelerometers`), are subtracted first. The noise of
the result is that of the accelerometers times the weights.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.arrays import Array
from ..core.compiled import compiled
from ..core.errors import RecordError
from ..core.names import AXES
from ..mechanics.accelerometers import acceleration_weights, reading
from ..mechanics.plant import Plant
from ..mechanics.pose import PlatenMotion, forward_kinematics, frame_of_pose
from ..mechanics.spatial import from_body, rpy_acceleration, turning, turning_rate
from .channels import LAYOUT
from .records import sample_interval
from .signals import Band, differentiate

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["WEIGHTS", "acceleration_of_signals", "accelerometer_channel", "accelerometer_signals"]
__all__ += ["rows_of", "with_platen_acceleration"]

WEIGHTS = "noise_of_accelerometer"
"""Attribute (6,) of a platen acceleration that was computed: its noise over that of one accelerometer."""

FAST = 100.0
"""Frequency [Hz] up to which tilt and turning are subtracted: beyond it they are noise of the displacement sensors."""


def accelerometer_signals(plant: Plant, motion: PlatenMotion, rows: Array) -> Array:
    """Readings (n, n_accelerometers) [m/s2] of accelerometers in a motion; rows (n_accelerometers, 6)."""
    out = np.zeros((len(motion.displacement), len(rows)))
    moved = PlatenMotion(*(np.ascontiguousarray(x, float) for x in motion))
    _readings(moved, plant.body, plant.machine.platen.gravity, np.ascontiguousarray(rows, float), out)
    return out


def acceleration_of_signals(
    plant: Plant, signals: Array, rows: Array, displacement: Array, velocity: Array
) -> tuple[Array, Array]:
    """Acceleration (n, 6) of C and Euler angles from readings (n, n_accelerometers), at a pose and its rates (n, 6).

    Returns also the noise (6,) of each axis over that of one accelerometer. Raises ParameterError naming an axis that
    the accelerometers do not determine.
    """
    weights = acceleration_weights(rows, plant.machine)
    steady = PlatenMotion(*(np.ascontiguousarray(x, float) for x in (displacement, velocity, 0.0 * displacement)))
    beyond = (signals - accelerometer_signals(plant, steady, rows)) @ weights.T
    out = np.zeros((len(signals), 6))
    _accelerations(steady, plant.body, np.ascontiguousarray(beyond), out)
    return out, np.linalg.norm(weights, axis=1)


def accelerometer_channel(rows: Array, signals: Array) -> tuple[tuple[str, ...], Array, dict[str, Any]]:
    """The channel of readings for `make_record`: dimensions, values, and attributes with points and directions."""
    channel = LAYOUT["point_acceleration"]
    about = {"units": channel.units, "long_name": channel.long_name}
    return channel.dims, signals, {**about, "points": rows[:, :3].ravel(), "directions": rows[:, 3:].ravel()}


def rows_of(record: "xr.Dataset") -> Array:
    """Rows (n_accelerometers, 6) of a record's accelerometers: point from C [m] and unit direction, in platen axes.

    Raises RecordError if their attributes do not state them.
    """
    parts = []
    for key in ("points", "directions"):
        values = np.asarray(record["point_acceleration"].attrs.get(key, ()), float)
        if values.size != 3 * record.sizes["accelerometer"] or not np.isfinite(values).all():
            where = record.encoding.get("source", "the record")
            raise RecordError(
                f"{where}: point_acceleration has no attribute {key} of three numbers each; import it again with point "
                "and direction of each in the channel map"
            )
        parts.append(values.reshape(-1, 3))
    return np.hstack(parts)


def with_platen_acceleration(plant: Plant, record: "xr.Dataset") -> "xr.Dataset":
    """The record with `platen_acceleration` computed from its `point_acceleration`, in place of any that it has.

    Where neither platen displacement nor actuator lengths were measured, the platen is taken to be level and not to
    turn. Raises RecordError without points and directions, ParameterError if they do not determine an axis.
    """
    signals, dt = record["point_acceleration"].values.astype(float), sample_interval(record)
    pose = np.zeros((len(signals), 6))
    if "platen_displacement" in record:
        pose = record["platen_displacement"].values.astype(float)
    elif "actuator_displacement" in record:
        pose, _ = forward_kinematics(plant, record["actuator_displacement"].values)
    pose = Band(high=FAST).apply(pose, dt) if 0.4 / dt > FAST else pose
    values, noise = acceleration_of_signals(plant, signals, rows_of(record), pose, differentiate(pose, dt))
    channel = LAYOUT["platen_acceleration"]
    about = {"units": channel.units, "long_name": f"{channel.long_name}; from accelerometers", WEIGHTS: noise}
    return record.assign(platen_acceleration=(channel.dims, values, about)).assign_coords(axis=list(AXES))


@compiled
def _readings(motion, body, gravity, rows, out):
    displacement, velocity, acceleration = motion
    frame = np.zeros((8, 3))
    for k in range(len(out)):
        euler, rates = displacement[k, 3:], velocity[k, 3:]
        frame_of_pose(displacement[k], body, frame)
        omega, alpha = turning(euler, rates), turning_rate(euler, rates, acceleration[k, 3:])
        for i in range(len(rows)):
            out[k, i] = reading(frame, acceleration[k], omega, alpha, gravity, rows[i])


@compiled
def _accelerations(motion, body, beyond, out):
    """Acceleration out (n, 6) from that `beyond` (n, 6) the motion with Euler angles at constant rates."""
    displacement, velocity, _ = motion
    frame, none = np.zeros((8, 3)), np.zeros(3)
    for k in range(len(out)):
        euler, rates = displacement[k, 3:], velocity[k, 3:]
        frame_of_pose(displacement[k], body, frame)
        ax, ay, az = turning_rate(euler, rates, none)
        out[k, 0], out[k, 1], out[k, 2] = from_body(frame, beyond[k])
        turned = (ax + beyond[k, 3], ay + beyond[k, 4], az + beyond[k, 5])
        out[k, 3], out[k, 4], out[k, 5] = rpy_acceleration(frame, rates, turned)
