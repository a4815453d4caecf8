"""Data files of tests as the 469D writes them, and a test to put in them."""

import struct
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lhpost6_pin.data.importing.raw import RawTest, make_raw

Channels = Sequence[tuple[str, str, np.ndarray]]  # description, unit, samples (n,)

LABELS = {
    "actuator": ("H1", "H2", "H3", "H4", "V1", "V2", "V3", "V4", "V5", "V6"),
    "horizontal": ("H1", "H2", "H3", "H4"),
    "strut": ("S1", "S2", "S3"),
    "floor": ["1F", "RF"],
    "accelerometer": ["AX1", "AZ1"],
}


class Typical(NamedTuple):
    """A column as a 469D would call it, and the channel of a record that it is."""

    description: str
    unit: str
    channel: str | None


_AXES = (("Long", "x"), ("Lat", "y"), ("Vert", "z"), ("Roll", "roll"), ("Pitch", "pitch"), ("Yaw", "yaw"))


def typical_channels() -> list[Typical]:
    """Channel list of a six-axis test: six axes, ten actuators, three struts, and some that no record has."""
    found = []
    for word, axis in _AXES:
        length, acceleration = ("in", "g") if axis in "xyz" else ("deg", "deg/s^2")
        found += [
            Typical(f"{word} Displ ref", length, f"reference_displacement[{axis}]"),
            Typical(f"{word} Displ fbk", length, f"platen_displacement[{axis}]"),
            Typical(f"{word} Vel fbk", f"{length}/s", f"platen_velocity[{axis}]"),
            Typical(f"{word} Accel fbk", acceleration, f"platen_acceleration[{axis}]"),
            Typical(f"{word} Accel ref", acceleration, None),
            Typical(f"{word} Force fbk", "kip", None),
        ]
    for name in LABELS["actuator"]:
        found += [
            Typical(f"{name} Displ fbk", "in", f"actuator_displacement[{name}]"),
            Typical(f"{name} Load Cell", "kip", f"actuator_force[{name}]"),
            Typical(f"{name} Press A", "psi", f"chamber_pressure_a[{name}]"),
            Typical(f"{name} Spool cmd", "%", f"spool_command[{name}]"),
            Typical(f"{name.replace('H', 'X').replace('V', 'Z')} Spool fbk", "%", f"spool_position[{name}]"),
            Typical(f"{name} Displ err", "in", None),
        ]
    found += [Typical(f"{name} Press B", "psi", f"chamber_pressure_b[{name}]") for name in LABELS["horizontal"]]
    found += [Typical(f"Hold Down {k} Press", "psi", f"strut_pressure[S{k}]") for k in (1, 2, 3)]
    return [*found, Typical("Supply Press", "psi", "supply_pressure"), Typical("Oil Temp", "degF", None)]


def header(channels: Channels, step: object, changes: Mapping[str, str | None] | None = None) -> dict[str, str]:
    """Header of a 469D file; `changes` replace keys, None takes one out."""
    entries: dict[str, str | None] = {
        "FILE_TYPE": "TIME_SERIES",
        "FILE_DATE": "01-Jan-2024 12:00:00",
        "FILE_INFO": "closed form",
        "DELTA_T": str(step),
        "CHANNELS": str(len(channels)),
    }
    for k, (description, unit, _) in enumerate(channels, 1):
        entries |= {f"DESC.CHAN_{k}": description, f"UNITS.CHAN_{k}": unit}
    return {key: value for key, value in (entries | dict(changes or {})).items() if value is not None}


def binary_469d(entries: Mapping[str, str], values: np.ndarray, order: str = "<") -> bytes:
    """Binary 469D file of values (n, k)."""
    records = b"".join(
        key.encode("latin-1").ljust(32) + text.encode("latin-1").ljust(96) for key, text in entries.items()
    )
    flat = np.ravel(values)
    return records + struct.pack(f"{order}{len(flat)}f", *flat)


def text_469d(entries: Mapping[str, str], values: np.ndarray, between: str = "", separator: str = " ") -> bytes:
    """Text 469D file; `between` key and value, or else keys in 32 columns."""
    lines = [f"{key}{between}{text}" if between else f"{key:32s}{text}" for key, text in entries.items()]
    lines += [separator.join(f"{x:.9g}" for x in row) for row in values]
    return ("\r\n".join(lines) + "\r\n").encode("latin-1")


def sines(count: int, columns: int, rate: float = 256.0) -> np.ndarray:
    """Smooth columns (count, columns) of some 1 to 8 Hz, each with its own."""
    t = np.arange(count)[:, None] / rate
    return np.sin(2 * np.pi * (1 + np.arange(columns) % 8) * t + np.arange(columns)) * (1 + np.arange(columns))


def raw(values: np.ndarray, units: Sequence[str | None], time: np.ndarray | None, source: str = "run.csv") -> RawTest:
    """Columns c1, c2, ... as a reader would hand them out."""
    return make_raw(source, "table", [f"c{k + 1}" for k in range(values.shape[1])], units, values, time)
