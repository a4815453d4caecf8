"""The channels of a record: one descriptor each, from which all tables of sensors follow.

A new sensor is one entry of `LAYOUT`, and its noise and ranges those of a sensors file (`models/sensors`): records,
import, checks, simulated campaigns, alignment, cross-checks and the sensor errors of calibration take it from there.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from ..core.arrays import Array
from ..core.names import AXES
from ..core.units import parse_unit

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "LAYOUT",
    "LAYOUT_VERSION",
    "MOTION",
    "Channel",
    "calibrated_channels",
    "channel_name",
    "channel_unit",
    "column_units",
    "columns_of",
    "residuals_of",
    "same_unit",
    "sensor_groups",
    "unit_doubt",
]

LAYOUT_VERSION = 1
"""Of the layout below. A change that older records do not follow (of a name, unit or sign) counts it up."""


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One variable of the layout: its dimensions, unit and meaning, what it is for, and what may be wrong with it."""

    dims: tuple[str, ...]
    units: str  # "translations, rotations" where the last dimension is `axis`
    long_name: str
    needed_by: tuple[str, ...] = ()  # jobs that cannot do without it
    role: Literal["motion", "sensor", "command"] = "sensor"  # motion: fused; command: the controller's own number
    errors: tuple[Literal["gain", "offset", "delay"], ...] = ("gain", "offset", "delay")  # that calibration estimates
    group: str = ""  # channels that share conditioning, and so a delay; by default the channel alone
    residuals: tuple[str, ...] = ()  # kinds of residuals that it enters; none: calibration does not use it
    fault: str = ""  # family of the library by which an error beyond its stated range is named
    companions: tuple[str, ...] = ()  # channels without which it serves no residual
    replaces: str = ""  # channel whose place in the wrench it takes where that was not measured
    same_as: str = ""  # channel that measures the same quantity, if this one is redundant
    held: bool = False  # held over a controller sample, or follows what is: a column may be late by part of one
    differentiated: bool = False  # residuals use its rate, too


_AXIS, _ACTUATOR = ("time", "axis"), ("time", "actuator")
_INVERSE, _OPEN = ("inverse dynamics",), ("open loop",)
_MOVED: tuple[str, ...] = ("wrench", "flow", "gas")
_PRESSURE: dict[str, Any] = {"units": "Pa", "fault": "pressure_sensor_error"}
_CHAMBER: dict[str, Any] = {
    **_PRESSURE,
    "needed_by": _OPEN,
    "group": "chamber_pressure",
    "residuals": ("flow", "force"),
    "replaces": "actuator_force",
    "differentiated": True,
}
_GIVEN: dict[str, Any] = {"role": "command", "errors": ()}  # free of noise, and nothing is estimated of it
_PLATEN: dict[str, Any] = {
    "dims": _AXIS,
    "role": "motion",
    "errors": ("gain", "delay"),  # the control zero-position is where they are zero
    "residuals": _MOVED,
    "fault": "accelerometer_error",
}

LAYOUT: Mapping[str, Channel] = {
    "platen_displacement": Channel(
        **_PLATEN, units="m, rad", long_name="position of C in {s}; Euler angles", needed_by=_INVERSE
    ),
    "platen_velocity": Channel(**_PLATEN, units="m/s, rad/s", long_name="velocity of C in {s}; Euler angle rates"),
    "platen_acceleration": Channel(
        **_PLATEN,
        units="m/s2, rad/s2",
        long_name="acceleration of C in {s} without gravity; Euler angle accelerations",
        needed_by=_INVERSE,
    ),
    "actuator_displacement": Channel(
        dims=_ACTUATOR,
        units="m",
        long_name="actuator length minus its length in the zero pose",
        fault="length_sensor_error",
    ),
    "actuator_force": Channel(
        dims=_ACTUATOR,
        units="N",
        long_name="actuator force P_A A_1 - P_B A_2",
        needed_by=_INVERSE,
        residuals=("wrench", "force"),
        fault="pressure_sensor_error",
        differentiated=True,
    ),
    "chamber_pressure_a": Channel(**_CHAMBER, dims=_ACTUATOR, long_name="pressure in chamber A"),
    "chamber_pressure_b": Channel(**_CHAMBER, dims=("time", "horizontal"), long_name="pressure in chamber B"),
    "strut_pressure": Channel(
        **_PRESSURE,
        dims=("time", "strut"),
        long_name="nitrogen pressure of the hold-down strut",
        residuals=("gas",),
    ),
    "spool_command": Channel(
        dims=_ACTUATOR,
        units="1",
        long_name="normalised fourth-stage spool command",
        role="command",
        errors=("delay",),
        residuals=("servo",),
        companions=("spool_position",),
        held=True,
    ),
    "spool_position": Channel(
        dims=_ACTUATOR,
        units="1",
        long_name="normalised fourth-stage spool position",
        needed_by=_OPEN,
        residuals=("flow", "servo"),
        fault="spool_null_bias",
        held=True,
    ),
    "supply_pressure": Channel(
        **_PRESSURE, dims=("time",), long_name="supply pressure", errors=("gain", "offset"), residuals=("supply",)
    ),
    "reference_displacement": Channel(
        dims=_AXIS, units="m, rad", long_name="displacement the test asked for", role="command", errors=()
    ),
    **{
        f"drive_{mode}": Channel(
            dims=_AXIS, units=units, long_name=f"drive: input of reference generators in {mode} mode", **_GIVEN
        )
        for mode, units in (("acceleration", "m/s2, rad/s2"), ("velocity", "m/s, rad/s"), ("displacement", "m, rad"))
    },
    "spool_command_b": Channel(
        **_GIVEN,
        dims=("time", "horizontal"),
        units="1",
        long_name="normalised fourth-stage spool command of servovalve B, where A's is spool_command",
    ),
    "spool_position_b": Channel(
        dims=("time", "horizontal"),
        units="1",
        long_name="normalised fourth-stage spool position of servovalve B, where A's is spool_position",
        errors=(),
    ),
    "pressure_difference": Channel(
        **_PRESSURE,
        dims=("time", "horizontal"),
        long_name="pressure in chamber A minus that in chamber B",
        residuals=("flow",),
        replaces="actuator_force",
        differentiated=True,
    ),
    "valve_command": Channel(
        dims=_ACTUATOR,
        units="1",
        long_name="command to a valve whose spool is not measured, over full command",
        role="command",
        errors=(),  # a delay is the valve's
        residuals=("flow",),
    ),
    "point_acceleration": Channel(
        dims=("time", "accelerometer"),
        units="m/s2",
        long_name="acceleration less gravity of a point of the platen along a direction, zero at rest",
        group="platen_acceleration",
    ),
    "floor_acceleration": Channel(
        dims=("time", "floor"),
        units="m/s2",
        long_name="absolute acceleration of a specimen's floor along its direction",
        residuals=("wrench",),
        fault="accelerometer_error",
    ),
}

MOTION = tuple(name for name, channel in LAYOUT.items() if channel.role == "motion")
"""Displacement, velocity and acceleration of the platen."""


def sensor_groups() -> dict[str, tuple[str, ...]]:
    """Channels that share conditioning, and so a delay against the others, by the name of their group."""
    groups: dict[str, tuple[str, ...]] = {}
    for name, channel in LAYOUT.items():
        if channel.role != "command" and "delay" in channel.errors:
            group = channel.group or name
            groups[group] = (*groups.get(group, ()), name)
    return groups


def calibrated_channels() -> dict[str, Channel]:
    """Measured channels that a machine is calibrated by."""
    return {name: c for name, c in LAYOUT.items() if c.residuals and c.role != "command"}


def residuals_of(name: str, present: Collection[str]) -> tuple[str, ...]:
    """Kinds of residuals that a channel (or a group of channels) enters in a test that has those `present`."""
    channel = LAYOUT.get(name) or LAYOUT[sensor_groups()[name][0]]
    stands_in = bool(channel.replaces) and channel.replaces not in present
    oil = {other for other, one in LAYOUT.items() if one.replaces == name}
    alone = bool(oil) and not oil & set(present)  # a force that pressures are computed from
    return (*("wrench",) * stands_in, *channel.residuals, *("flow",) * alone)


def columns_of(variable: "xr.DataArray") -> Array:
    """Values (n, columns) of a variable along time."""
    return variable.values.astype(float).reshape(len(variable), -1)


def kinds_of(variable: "xr.DataArray") -> tuple[slice, ...]:
    """Columns of a variable that share a unit, and so a recorder's range: translations and rotations, or all."""
    return (slice(0, 3), slice(3, 6)) if "axis" in variable.dims else (slice(None),)


def channel_name(variable: "xr.DataArray", column: int) -> str:
    """Name of one column of a variable, as in `platen_displacement[yaw]`."""
    if variable.ndim < 2:
        return str(variable.name)
    dim = variable.dims[1]
    return f"{variable.name}[{variable[dim].values[column] if dim in variable.coords else column}]"


def channel_unit(channel: str, units: str | None = None) -> str:
    """Unit of one column: `m` of `platen_displacement[x]`, `rad` of `platen_displacement[yaw]`.

    `units` are those of its variable, by default the layout's.
    """
    variable, _, label = channel.rstrip("]").partition("[")
    parts = (LAYOUT[variable].units if units is None else units).split(",")
    return parts[-1 if label in AXES[3:] else 0].strip()


def column_units(variable: "xr.DataArray") -> list[str]:
    """Unit of every column of a variable along time: its own `column_units`, or by its `units` and the axis."""
    if own := variable.attrs.get("column_units"):
        return [unit.strip() for unit in str(own).split(",")]
    units = str(variable.attrs.get("units", ""))
    return [channel_unit(channel_name(variable, k), units) for k in range(columns_of(variable).shape[1])]


_LIKELY_UNITS = {  # unit: least and greatest plausible peak, and the likely mistake outside
    "m": (0.0, 3.0, "mm or in for m"),
    "rad": (0.0, 1.0, "deg for rad"),
    "Pa": (1e5, 2e8, "MPa, bar or psi for Pa"),
    "1": (0.0, 1.2, "V or % for the share of full stroke"),
}


def unit_doubt(channel: str, peak: float) -> str:
    """Likely mistake of unit of a column whose largest absolute value is `peak`, in words; empty if it is plausible."""
    least, most, guess = _LIKELY_UNITS.get(channel_unit(channel), (0.0, math.inf, ""))
    return "" if least <= peak <= most else f"reaches {peak:.4g}: {guess}?"


def same_unit(units: object, wanted: str) -> bool:
    """Whether two unit strings mean the same: `m/s2`, `m s-2`, `meter/second**2` do, `mm` and `m` do not."""
    if not isinstance(units, str):
        return False
    if units == wanted:
        return True
    ours, theirs = ([parse_unit(part.strip() or "1") for part in text.split(",")] for text in (units, wanted))
    return len(ours) == len(theirs) and all(
        a is not None and b is not None and a.dimension == b.dimension and math.isclose(a.factor, b.factor)
        for a, b in zip(ours, theirs, strict=True)
    )
