"""Sensor errors as unknowns: gain and offset of every column, delay of every group, each with its prior.

    measured(t) = (1 + gain) true(t - delay) + offset

Commands are held for a sample of the controller, and valves are late by no whole number of samples: a record may show
each spool up to half such a sample early or late, beside the delay of the group.

Displacement, velocity and acceleration of the platen are fused into one motion; each channel's gain acts on its share
in it, to first order. Their skews have been taken out; what the others are late against is the platen's motion.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...core.names import AXES
from ...data.channels import sensor_groups
from ...data.records import sample_interval
from ...data.sensors import SensorSet
from ...data.signals import align
from ...machine.machine import Machine
from ...mechanics.pose import PlatenMotion
from ..residuals import MeasuredTest

__all__ = ["CHANNELS", "SensorUnknown", "corrected", "corrected_record", "sensor_unknowns"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SensorUnknown:
    """One error of one sensor: `kind` gain [1], offset [unit of the channel] or delay [s]."""

    name: str  # such as "gain actuator_force[H1]", "delay spool_position"
    kind: str
    channel: str  # a group of channels for a delay
    column: int  # in the fields of a test that the channel is in; -1 for the delay of a whole group
    sd: float  # of the prior, about zero
    unit: str
    alone: tuple[str, int]  # evaluated together: unknowns of one `alone[0]` act on different rows, marked by alone[1]


CHANNELS = {
    "platen_displacement": "m | rad",
    "platen_velocity": "m/s | rad/s",
    "platen_acceleration": "m/s2 | rad/s2",
    "actuator_force": "N",
    "chamber_pressure_a": "Pa",
    "chamber_pressure_b": "Pa",
    "strut_pressure": "Pa",
    "spool_position": "1",
    "supply_pressure": "Pa",
}
"""Channels that a machine is calibrated by, with their units."""

_FIELDS: Mapping[str, tuple[tuple[str, bool], ...]] = {
    "actuator_force": (("actuator_force", True),),
    "chamber_pressure_a": (("pressure", True), ("pressure_rate", False)),
    "chamber_pressure_b": (("pressure", True), ("pressure_rate", False)),
    "strut_pressure": (("strut_pressure", True),),
    "spool_position": (("spool", True),),
    "supply_pressure": (("supply_pressure", True),),
}
"""Fields of a test that a channel's error is in, and whether an offset is in them."""

_DELAYED: Mapping[str, tuple[str, ...]] = {
    "actuator_force": ("actuator_force",),
    "chamber_pressure": ("pressure", "pressure_rate"),
    "strut_pressure": ("strut_pressure",),
    "spool_position": ("spool",),
    "spool_command": ("spool_command",),
}
"""Fields of a test that the delay of a group of channels is in."""


def sensor_unknowns(machine: Machine, sensors: SensorSet, test: MeasuredTest) -> tuple[SensorUnknown, ...]:
    """Unknown errors of the channels that a test has, for which the sensors state a range."""
    columns: dict[str, tuple[str, ...]] = {
        **dict.fromkeys(("platen_displacement", "platen_velocity", "platen_acceleration"), ()),
        **dict.fromkeys(test.share, AXES),
        "actuator_force": machine.actuator_names if test.actuator_force is not None else (),
        "chamber_pressure_a": machine.actuator_names if test.pressure is not None else (),
        "chamber_pressure_b": machine.double_acting if test.pressure is not None else (),
        "strut_pressure": machine.strut_names if test.strut_pressure is not None else (),
        "spool_position": machine.actuator_names if test.spool is not None else (),
        "supply_pressure": ("",) if test.supply_pressure is not None else (),
    }
    found = []
    for channel, unit in CHANNELS.items():
        first = len(machine.actuator_names) if channel == "chamber_pressure_b" else 0  # after chambers A
        for kind, sd in (("gain", sensors.gain_sd(channel)), ("offset", sensors.offset_sd(channel))):
            if channel.startswith("platen") and kind == "offset":
                continue  # the control zero-position is where they are zero
            for i, label in enumerate(columns[channel] if sd > 0.0 else ()):
                if channel.startswith("platen") and not np.any(test.motion.displacement[:, i]):
                    continue  # a guided platen
                found.append(
                    SensorUnknown(
                        f"{kind} {channel}[{label}]" if label else f"{kind} {channel}",
                        kind,
                        channel,
                        first + i,
                        sd,
                        "1" if kind == "gain" else unit,
                        _alone(machine, kind, channel, i, forces=test.actuator_force is not None),
                    )
                )
    columns["spool_command"] = machine.actuator_names if test.spool_command is not None else ()
    for group in _DELAYED:
        # a command is no measurement, but what records it has a clock of its own beside the spool's, and holds it
        sd = 2.0 * sensors.delay_sd("spool_position") if group == "spool_command" else sensors.delay_sd(group)
        if sd > 0.0 and columns[{"chamber_pressure": "chamber_pressure_a"}.get(group, group)]:
            found.append(SensorUnknown(f"delay {group}", "delay", group, -1, sd, "s", (f"delay {group}", -1)))
    if sensors.delay_sd("spool_position") > 0.0:
        held = 0.5 / sensors.rate / np.sqrt(3.0)
        for i, label in enumerate(columns["spool_position"]):
            name, alone = f"delay spool_position[{label}]", ("delay of a spool_position", i)
            found.append(SensorUnknown(name, "delay", "spool_position", i, held, "s", alone))
    return tuple(found)


def _alone(machine: Machine, kind: str, channel: str, i: int, *, forces: bool) -> tuple[str, int]:
    """Spools and pressures act on one actuator's residuals, a strut's pressure on its own: one evaluation for all.

    Not so pressures that stand in for forces which were not measured: each is in the whole wrench.
    """
    if channel in ("spool_position", "strut_pressure") or (channel == "chamber_pressure_a" and forces):
        return f"{kind} {channel}", i
    if channel == "chamber_pressure_b" and forces:
        return f"{kind} {channel}", machine.actuator_names.index(machine.double_acting[i])
    return f"{kind} {channel} {i}", -1


def corrected(test: MeasuredTest, unknowns: tuple[SensorUnknown, ...], values: Array) -> MeasuredTest:
    """The test as perfect sensors would have shown it, if their errors were `values`, one an unknown.

    What has no error is not copied.
    """
    off = [(u, float(v)) for u, v in zip(unknowns, values, strict=True) if v != 0.0]
    arrays: dict[str, Array] = {}
    for kind in ("offset", "gain"):
        for unknown, value in off:
            if unknown.kind != kind or unknown.channel in test.share:
                continue
            for field, shifted in _FIELDS[unknown.channel]:
                if kind == "offset" and not shifted:
                    continue
                array = arrays.setdefault(field, _field(test, field).copy())
                if kind == "gain":
                    array[:, unknown.column] /= 1.0 + value
                else:
                    array[:, unknown.column] -= value
    late: dict[str, Array] = {}
    for unknown, value in off:
        if unknown.kind == "delay":
            for field in _DELAYED[unknown.channel]:
                _add_delay(late, field, unknown, value, _field(test, field).shape[1])
    for field, delay in late.items():
        arrays[field] = align(arrays.get(field, _field(test, field)), delay, test.dt)
    platen = [(u, v) for u, v in off if u.channel in test.share]
    motion, path = test.motion, test.path
    if platen:
        motion = PlatenMotion(*(x.copy() for x in motion))
        path = None if path is None else path.copy()
        for unknown, value in platen:
            k, part, shares = unknown.column, value / (1.0 + value), test.share[unknown.channel]
            for moved, share in zip(motion, shares, strict=True):
                moved[:, k] -= part * share[:, k]
            if path is not None:
                path[:, k] -= part * shares.displacement[:, k]
    return replace(test, motion=motion, path=path, **arrays)  # type: ignore[arg-type]  # fields of arrays, by name


def corrected_record(record: xr.Dataset, unknowns: tuple[SensorUnknown, ...], errors: Array) -> xr.Dataset:
    """A record as perfect sensors would have shown it, if these were their errors, one an unknown."""
    out = record.copy(deep=True)
    dt = sample_interval(record)
    off = [(u, float(v)) for u, v in zip(unknowns, errors, strict=True) if v != 0.0]
    late: dict[str, Array] = {}
    for unknown, value in off:
        if unknown.kind == "delay":
            for channel in sensor_groups().get(unknown.channel, (unknown.channel,)):
                if channel in out:
                    _add_delay(late, channel, unknown, value, out[channel].shape[-1])
    for channel, delay in late.items():
        out[channel].values[:] = align(out[channel].values, delay, dt)
    for unknown, value in off:
        if unknown.kind == "delay" or unknown.channel not in out:
            continue
        first = len(record["actuator"]) if unknown.channel == "chamber_pressure_b" else 0
        values = out[unknown.channel].values
        column = values[:, unknown.column - first] if values.ndim > 1 else values
        if unknown.kind == "gain":
            column /= 1.0 + value
        else:
            column -= value
    return out


def _add_delay(late: dict[str, Array], field: str, unknown: SensorUnknown, value: float, columns: int) -> None:
    """Add a delay to those (columns,) of a field."""
    delay = late.setdefault(field, np.zeros(columns))
    delay[unknown.column if unknown.column >= 0 else slice(None)] += value


def _field(test: MeasuredTest, field: str) -> Array:
    return np.asarray(getattr(test, field))
