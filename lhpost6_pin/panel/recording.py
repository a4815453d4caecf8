"""Recordings of a driven table: rows of samples, and the record that they make."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import RecordError
from ..core.names import SAMPLE_RATE
from ..data.metrics import QUANTITIES
from ..data.records import make_record
from ..data.served_samples import ANSWERED, PLANT_STATE
from ..interfaces.link import PlantState
from ..machine.machine import Machine
from ..machine.recorded_changes import change_facts
from ..machine.recorded_specimen import specimen_facts
from ..mechanics.pose import PlatenMotion
from ..simulation.outputs import reference_channels
from .rows import Rows

__all__ = ["Recording", "record_of_rows"]

_SAME: tuple[str, ...] = ("platen_displacement", "platen_velocity", "platen_acceleration")
_SAME += ("actuator_displacement", "actuator_force", "spool_command")


class Recording:
    """Rows since a recording began; attribute `name`."""

    def __init__(self, name: str) -> None:
        """Begin without rows."""
        self.name = name
        self._rows: list[Array] = []
        self._count = 0
        self._trips: list[tuple[int, int, str]] = []  # rows before it was known, sample, reason

    @property
    def seconds(self) -> float:
        """Duration so far [s]."""
        return self._count / SAMPLE_RATE

    def add(self, rows: Array) -> None:
        """Append rows (n, width)."""
        if len(rows):
            self._rows.append(rows)
            self._count += len(rows)

    def trip(self, sample: int, reason: str) -> None:
        """Take a trip of the table, at a sample of its session; one before the recording began counts too."""
        self._trips.append((self._count, sample, reason))

    @property
    def trouble(self) -> str | None:
        """The first trip in the time [s] of the record that the rows make, and how many; None without any."""
        if not self._rows:
            return None
        samples = np.concatenate([rows[:, 0] for rows in self._rows])
        again = np.flatnonzero(np.diff(samples) < 0)  # trips of a session that began anew are not of the record
        trips = [(at, why) for count, at, why in self._trips if not len(again) or count <= again[0] + 1]
        if not trips:
            return None
        at, reason = trips[0]
        why = re.sub(r", at [\d.]+ s$", "", reason)  # time of the session
        seconds = (at - samples[0]) / SAMPLE_RATE
        when = f"at {seconds:.3f} s" if seconds >= 0.0 else "before the recording began"
        more = f"; {len(trips)} trips in all" if len(trips) > 1 else ""
        return f"tripped {when}: {why}{more}"

    def rows(self) -> Array:
        """All rows (n, width)."""
        return np.concatenate(self._rows) if self._rows else np.zeros((0, 0))


def record_of_rows(rows: Array, layout: Rows, machine: Machine, attrs: Mapping[str, Any]) -> xr.Dataset:
    """Record of rows (n, width) in the layout of measured tests, as long as one session lasts.

    `spool_command` acts from its sample to the next; where the plant holds by itself it is the last that was sent.
    A sample that the controller missed repeats the row before it; `answered` is 0 there. `plant_state` is that of the
    plant. attrs: further attributes.
    Raises RecordError for fewer than two samples.
    """
    if len(rows) < 2:
        raise RecordError("nothing was recorded: the table was not under pressure; set it high first")
    sample = rows[:, 0].astype(int)
    again = np.flatnonzero(np.diff(sample) < 0)  # a session that began anew counts from zero
    if len(again):
        rows, sample = rows[: again[0] + 1], sample[: again[0] + 1]
    last = np.append(np.diff(sample) > 0, True)  # the first command answers a sample that was read without one before
    rows, sample = rows[last], sample[last]
    if len(rows) < 2:
        raise RecordError("nothing was recorded: the table did not move; set the pressure high first")
    every = np.arange(sample[0], sample[-1] + 1)
    at = np.searchsorted(sample, every, side="right") - 1
    rows = rows[at]
    about = {"units": "1", "long_name": "1 if the controller answered this sample"}
    channels: dict[str, Any] = {name: layout.of(rows, name) for name in _SAME}
    channels[ANSWERED] = (("time",), (sample[at] == every).astype(np.int8), about)
    states = " ".join(f"{s.value} {s.name.lower()}" for s in PlantState)
    about = {"units": "1", "long_name": f"state of the served plant: {states}"}
    channels[PLANT_STATE] = (("time",), rows[:, 1].astype(np.int8), about)
    channels |= reference_channels(PlatenMotion(*(layout.of(rows, f"reference_{q}") for q in QUANTITIES)))
    labels = machine.labels
    if np.isfinite(layout.of(rows, "supply_pressure")).all():
        double = [name in machine.double_acting for name in machine.actuator_names]
        channels["chamber_pressure_a"] = layout.of(rows, "chamber_pressure_a")
        spool = layout.of(rows, "spool_position")  # a reading has its mean over the sample before, a record that after
        channels["spool_position"] = np.concatenate([spool[1:], spool[-1:]])
        channels["supply_pressure"] = layout.of(rows, "supply_pressure")[:, 0]
        if any(double):
            channels["chamber_pressure_b"] = layout.of(rows, "chamber_pressure_b")[:, double]
        if machine.struts:
            channels["strut_pressure"] = layout.of(rows, "strut_pressure")
    facts = {
        "kind": "simulated",
        "machine": machine.name,
        **change_facts(machine),
        **specimen_facts(machine.specimen),
    }
    return make_record((every - every[0]) / SAMPLE_RATE, channels, labels, {**facts, **attrs})
