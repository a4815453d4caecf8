"""Sensor errors as unknowns: gain and offset of every column, delay of every group, each with its prior.

    measured(t) = (1 + gain) true(t - delay) + offset

Commands are held for a sample of the controller, while the valves' delay is not a multiple of it: each spool of a
record may be up to half such a sample early or late, in addition to the delay of its group.

The gain of a sensor that alone fixes the scale of numbers that are free (the only one of force on an axis, the only one
of motion, a floor's) is none of them: it cannot be identified from these numbers.

Displacement, velocity and acceleration of the platen are fused into one motion; each channel's gain acts on its share
of the motion, to first order. Skews between them have been removed; other delays are relative to the platen's motion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...core.names import AXES
from ...data.alignment import Delay
from ...data.channels import LAYOUT, Channel, channel_unit, residuals_of, sensor_groups
from ...data.records import sample_interval
from ...data.sensors import SensorSet
from ...data.signals import align
from ...machine.machine import Machine
from ...mechanics.pose import PlatenMotion
from ..prepare import MeasuredTest
from .scale import measures_alone

__all__ = ["RemovedDelay", "SensorUnknown", "corrected", "corrected_record", "removed_delays"]
__all__ += ["sensor_unknowns"]


@dataclass(frozen=True)
class SensorUnknown:
    """One error of one sensor: `kind` gain [1], offset [unit of the channel] or delay [s]."""

    name: str  # such as "gain actuator_force[H1]", "delay spool_position"
    kind: str
    channel: str  # a group of channels for a delay
    column: int  # of the channel; -1 for the delay of a whole group
    sd: float  # of the prior, about zero
    unit: str
    alone: tuple[str, int]  # unknowns of one alone[0] act on different rows (alone[1]) and are evaluated together
    shows_in: tuple[str, ...] = ()  # residuals that depend on it
    lowest: float = -np.inf
    highest: float = np.inf
    step: float | None = None  # for derivatives; None: the comparison's share of sd


class RemovedDelay(NamedTuple):
    """Delay of a group of channels that redundant channels show, removed before the fit."""

    group: str
    delay: float  # [s]
    deviation: float  # standard [s]
    stated: float  # largest delay behind the reference that the sensors' file allows [s]: the sum of both ranges
    reference: str  # group of channels that it is relative to

    def beyond(self, reach: float) -> bool:
        """Whether it is beyond the stated one by more than `reach` standard deviations."""
        return abs(self.delay) > self.stated + reach * self.deviation


def removed_delays(delays: Mapping[str, Delay], sensors: SensorSet) -> tuple[RemovedDelay, ...]:
    """Delays by group that were removed, each with the largest one that the sensors' file allows."""
    return tuple(
        RemovedDelay(*(group, d.delay, d.standard_error, sensors.relative_delay_range(group, d.reference), d.reference))
        for group, d in delays.items()
    )


def removed_of(unknowns: Sequence["SensorUnknown"], delays: Sequence[RemovedDelay]) -> tuple[Array, Array]:
    """What was removed before the fit of each unknown (k,), and its variance (k,): of delays of groups, else zero."""
    group = {f"delay {one.group}": one for one in delays}
    found = [group.get(one.name) for one in unknowns]
    each = [(0.0, 0.0) if one is None else (one.delay, one.deviation**2) for one in found]
    delay, variance = np.array(each).reshape(-1, 2).T
    return delay, variance


def sensor_unknowns(machine: Machine, sensors: SensorSet, test: MeasuredTest) -> tuple[SensorUnknown, ...]:
    """Unknown errors of the channels that a test has, for which the sensors state a range."""
    labels = {"axis": AXES, **machine.labels}
    present = {*test.share, *test.channels}
    channels = {name: c for name, c in LAYOUT.items() if name in present and c.residuals}
    found: list[SensorUnknown] = []

    def add(kind: str, name: str, i: int, label: str, sd: float, unit: str, alone: tuple[str, int]) -> None:
        full = f"{kind} {name}[{label}]" if label else f"{kind} {name}"
        found.append(SensorUnknown(full, kind, name, i, sd, unit, alone, residuals_of(name, test.channels)))

    for name, channel in channels.items():
        columns = labels[channel.dims[1]] if len(channel.dims) > 1 else ("",)
        for kind, sd, unit in (
            ("gain", sensors.gain_sd(name), "1"),
            ("offset", sensors.offset_sd(name), channel_unit(name)),
        ):
            free = sd > 0.0 and not (kind == "gain" and _scales_alone(machine, name, test))
            for i, label in enumerate(columns if kind in channel.errors and free else ()):
                if channel.role != "motion" or np.any(test.motion.displacement[:, i]):  # else a guided platen
                    add(kind, name, i, label, sd, unit, _together(machine, kind, name, i, label, present))
    for group, sd in _delays(sensors, channels).items():
        add("delay", group, -1, "", sd, "s", (f"delay {group}", -1))
    for name, channel in channels.items():
        if channel.held and sensors.delay_sd(name) > 0.0:
            held = 0.5 / sensors.rate / np.sqrt(3.0)
            for i, label in enumerate(labels[channel.dims[1]]):
                add("delay", name, i, label, held, "s", (f"delay of a {name}", i))
    return tuple(found)


def _scales_alone(machine: Machine, name: str, test: MeasuredTest) -> bool:
    """Whether nothing but a sensor fixes the scale of free numbers: the only one of force, of motion, or of floors."""
    if name == "floor_acceleration":  # in proportion to masses that are free
        return any(machine.parameters[f"{floor.name}.mass"].sd is not None for floor in machine.floors)
    if LAYOUT[name].role == "motion":
        return len(test.share) == 1
    return measures_alone(machine, name, test.channels)


def _delays(sensors: SensorSet, channels: Mapping[str, Channel]) -> dict[str, float]:
    """Standard deviation of the delay of every group relative to the platen's motion."""
    groups = {c.group or name: sensors.delay_sd(c.group or name) for name, c in channels.items() if c.role == "sensor"}
    # a command is not measured, but recorded with another clock than its companion, and held
    for name, channel in channels.items():
        if channel.role == "command" and channel.companions:
            groups[name] = 2.0 * max(sensors.delay_sd(other) for other in channel.companions)
    return {group: sd for group, sd in groups.items() if sd > 0.0}


def _together(machine: Machine, kind: str, name: str, i: int, label: str, present: set[str]) -> tuple[str, int]:
    """A sensor of one component acts on that component's residuals, so that one evaluation serves all components.

    Except for sensors in the wrench, such as pressures in place of measured forces.
    """
    components = machine.strut_names if label in machine.strut_names else machine.actuator_names
    if label not in components or "wrench" in residuals_of(name, present):
        return f"{kind} {name} {i}", -1
    return f"{kind} {name}", components.index(label)


def corrected(test: MeasuredTest, unknowns: tuple[SensorUnknown, ...], values: Array) -> MeasuredTest:
    """The test corrected for sensor errors `values` (one per unknown); channels without error are not copied."""
    wrong = _nonzero(unknowns, values)
    own = [(u, v) for u, v in wrong if u.channel not in test.share]
    channels = _true(test.channels, own, test.dt)
    rates = _true(test.rates, [(u, v) for u, v in own if u.kind != "offset"], test.dt)
    motion, path = test.motion, test.path
    if len(own) < len(wrong):
        motion = PlatenMotion(*(x.copy() for x in motion))
        path = None if path is None else path.copy()
        for unknown, value in wrong:
            if unknown.channel in test.share:
                k, part, shares = unknown.column, value / (1.0 + value), test.share[unknown.channel]
                for moved, share in zip(motion, shares, strict=True):
                    moved[:, k] -= part * share[:, k]
                if path is not None:
                    path[:, k] -= part * shares.displacement[:, k]
    return replace(test, motion=motion, path=path, channels=channels, rates=rates)


def corrected_record(record: xr.Dataset, unknowns: tuple[SensorUnknown, ...], errors: Array) -> xr.Dataset:
    """A record corrected for sensor errors, one per unknown."""
    out = record.copy(deep=True)
    columns = {str(name): x.values.reshape(len(x), -1) for name, x in out.items() if "time" in x.dims}
    for name, values in _true(columns, _nonzero(unknowns, errors), sample_interval(record)).items():
        out[name].values[:] = values.reshape(out[name].shape)
    return out


def _nonzero(unknowns: Sequence[SensorUnknown], values: Array) -> list[tuple[SensorUnknown, float]]:
    return [(u, float(v)) for u, v in zip(unknowns, values, strict=True) if v != 0.0]


def _true(columns: Mapping[str, Array], wrong: Sequence[tuple[SensorUnknown, float]], dt: float) -> dict[str, Array]:
    """Channels (n, k) without these errors: offset, then gain, then delay; those that have none are not copied."""
    out = dict(columns)
    for name in out.keys() & {u.channel for u, _ in wrong if u.kind != "delay"}:
        out[name] = out[name].copy()
    for unknown, value in sorted(wrong, key=lambda one: one[0].kind != "offset"):
        if unknown.kind == "offset" and unknown.channel in out:
            out[unknown.channel][:, unknown.column] -= value
        elif unknown.kind == "gain" and unknown.channel in out:
            out[unknown.channel][:, unknown.column] /= 1.0 + value
    for name, delay in _late(wrong, {name: x.shape[1] for name, x in out.items()}).items():
        out[name] = align(out[name], delay, dt)
    return out


def _late(off: Sequence[tuple[SensorUnknown, float]], columns: Mapping[str, int]) -> dict[str, Array]:
    """Delays (columns,) of the delayed channels; `columns` are the channels with their numbers of columns."""
    late: dict[str, Array] = {}
    groups = sensor_groups()
    for unknown, value in off:
        if unknown.kind == "delay":
            for name in groups.get(unknown.channel, (unknown.channel,)):
                if name in columns:
                    delay = late.setdefault(name, np.zeros(columns[name]))
                    delay[unknown.column if unknown.column >= 0 else slice(None)] += value
    return late
