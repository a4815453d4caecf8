"""Sensors measured by a campaign's own records: as a file, as the set a fit uses, and beside what a file states.

Noise, low-pass, resolution and the offsets of motion are measured. Rests show no gain, no delay and no offset of what
carries a load: their ranges are assumed (`models/procedures/rests.toml`) and say so, with the skew that redundant
channels show. A gain has a range only where another channel measures the same: else it is the scale of what the channel
tells, a mass or a friction, and no record separates the two.
"""

import json
import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array, Mask
from ..core.errors import RecordError
from ..core.files import write_whole
from ..core.names import AXES
from ..machine.machine import Machine
from ..machine.machine_toml import quantity_toml, sections_toml
from ..machine.parameters import Parameters, Quantity, Value
from ..mechanics.plant import Plant, make_plant
from .alignment import group_delays
from .channels import LAYOUT, MOTION, channel_unit, sensor_groups
from .noise_levels import CORNER, ChannelNoise, NoiseLevels, noise_levels
from .records import is_measured
from .rests import rest_numbers
from .sensors import SensorSet, load_sensors, make_sensors, recorded_spectrum

__all__ = ["NoiseComparison", "compare_noise", "find_sensors", "measured_sensors", "save_sensors"]
__all__ += ["with_measured_noise"]

log = logging.getLogger(__name__)

SHAKEN = 2.0  # density of noise over that of the resolution, below which a rest shows less noise than a motion does
MOST_BITS = 24  # no recorder has more: finer steps are those of computed numbers


class NoiseComparison(NamedTuple):
    """Noise of one channel as measured and as a file states it, both with that of the digital resolution.

    Of six axes it is the one that differs most; of other channels the mean over columns.
    """

    channel: str
    unit: str
    measured: float  # standard deviation of white noise at the records' rate [unit]
    stated: float  # nan where no file was given; of a band above the stated low-pass, that below it
    tolerance: float  # relative, stated range and three standard errors
    corner: float  # of the low-pass [Hz]; infinite where none shows
    step: float  # digital resolution [unit]
    uneven: float  # noisiest column over the median one, where all are alike
    filtered: bool = False  # it was read where the stated low-pass leaves next to nothing, and cannot be compared

    @property
    def ratio(self) -> float:
        """Measured over stated; infinite where none is stated, nan without a file or where it is `filtered`."""
        if self.filtered:
            return np.nan
        return self.measured / self.stated if self.stated else np.inf

    @property
    def warning(self) -> str:
        """What is wrong with the statement, empty if it agrees."""
        if self.filtered:
            return ""
        size = f"noise of {self.measured:.2g} {self.unit}"
        if self.stated == 0.0:
            return f"{size}, where the sensors file states none"
        if self.ratio > 1 + self.tolerance:
            return f"{size} is {self.ratio:.2g} times what the sensors file states: it may pass for an effect"
        if self.ratio < 1 / (1 + self.tolerance):
            return f"{size} is {self.ratio:.2g} of what the sensors file states: an effect may pass for noise"
        return ""


def find_sensors(
    machine: Machine, records: Sequence[xr.Dataset], name: str | Path | None = None, remedy: str = ""
) -> SensorSet:
    """Sensors by name or file; else those that the machine file names; else as the records themselves show them.

    Noise that a file states and measured records contradict is replaced by what they show.

    Raises RecordError, with the `remedy`, if these do not show the noise of a channel, or none was recorded.
    """
    known = name or machine.sensors
    measured = [record for record in records if is_measured(record)]
    if known:
        return with_measured_noise(load_sensors(known), measured)
    try:
        if not measured:
            raise RecordError("the records are simulated without noise")
        content = measured_sensors(make_plant(machine), measured)
    except RecordError as error:
        way = remedy or "`lhpost6 check CAMPAIGN --machine MACHINE --sensors-out FILE` writes one where tests rest"
        why = f"{machine.name} names no sensors file, and {error}"
        raise RecordError(f"{why}; give one with --sensors: {way}") from None
    log.warning("sensors: %s, %s", content.words["sensors.name"], content["sampling.rate"].source)
    return make_sensors(content)


def with_measured_noise(sensors: SensorSet, records: Sequence[xr.Dataset]) -> SensorSet:
    """The same sensors with the noise of measured records where theirs differs from it by more than a quarter.

    Of six axes it is the mean of translations and of rotations, in proportion. Channels whose noise these records hide,
    or that rest between two steps of the converter, and those that the file states free of noise, stay as stated, as
    does noise below an upper bound: that of records without a rest.
    """
    if not records:
        return sensors
    numbers = rest_numbers()
    most, levels = numbers.number("assumed.agrees"), noise_levels(records, numbers)
    found, quantities = dict[str, float](), dict(sensors.parameters.quantities)
    for name, one in levels.channels.items():
        due = _stated_density(one, levels.rate, sensors)
        if not due.any() or _filtered(one, levels.rate, sensors):
            continue
        old = quantities[f"noise.{name}"]
        sd = np.broadcast_to(np.asarray(old.value, float), one.density.shape).copy()
        for kind, part in _parts(one):
            varies = part & (one.density > 0)
            if one.density[varies].sum() < SHAKEN * one.quantum[varies].sum() or not due[varies].any():
                continue
            ratio = float(np.sqrt(one.density[varies].mean() / due[varies].mean()))
            if ratio < 1 / most or (ratio > most and levels.seconds):  # an upper bound above does not contradict
                found[name + kind] = ratio
                sd[part] *= ratio
                value = sd.tolist() if kind else float(sd[0])
                quantities[f"noise.{name}"] = _measured(value, old.unit, levels.source)
    if not found:
        return sensors
    said = ", ".join(f"{name} {ratio:.2g}" for name, ratio in found.items())
    log.warning("sensors: %s: noise replaced by %s (times stated: %s)", sensors.name, levels.source, said)
    return make_sensors(replace(sensors.parameters, quantities=quantities), sensors.name)


def _parts(one: ChannelNoise) -> list[tuple[str, Mask]]:
    """Columns (k,) whose noise is of one kind: translations and rotations of six axes, else all; in words."""
    if "axis" not in LAYOUT[one.channel].dims:
        return [("", np.ones(len(one.density), bool))]
    translation = np.arange(len(AXES)) < 3
    return [(" of translations", translation), (" of rotations", ~translation)]


def measured_sensors(
    plant: Plant, records: Sequence[xr.Dataset], levels: NoiseLevels | None = None, title: str = ""
) -> Parameters:
    """Complete content of a sensors file for the channels of a campaign, in SI.

    Raises RecordError naming the channels whose noise the records do not show.
    """
    numbers = rest_numbers()
    levels = levels or noise_levels(records, numbers)
    if levels.hidden:
        raise RecordError(f"no rest, and tests in motion hide the noise of {', '.join(levels.hidden)}")
    if not levels.channels:
        longest = max(record.sizes["time"] for record in records)
        if longest < levels.rate:
            remedy = "record two seconds of rest before each test"
            raise RecordError(f"{longest} samples are too few to show noise: {remedy}")
        why = f"no channel shows any noise at {levels.rate:g} Hz, the rate of the records"
        raise RecordError(f"{why}: it is too slow, or they are simulated without noise and need no sensors file")
    found = {f"sampling.{key}": quantity for key, quantity in _sampling(levels, numbers).items()}
    for name, one in levels.channels.items():
        six = "axis" in LAYOUT[name].dims
        sd = one.sd(levels.rate).tolist() if six else float(np.sqrt(one.pooled() * levels.rate / 2))
        found[f"noise.{name}"] = _measured(sd, _unit(name), f"{levels.source}, {one.low:.3g} to {one.high:.3g} Hz")
    sensors = [name for name in levels.channels if LAYOUT[name].role != "command"]
    skews = group_delays(plant, records)
    commanded = all("spool_command" in record for record in records)  # the scale of a spool is then that of its command
    for name in sensors:
        if (LAYOUT[name].group or name) in skews or (commanded and name == "spool_position"):
            found[f"gain_range.{name}"] = numbers["assumed.gain"]
    for name in sensors:
        offset = _offset(plant.machine, levels.channels[name], levels.source, numbers)
        if offset is not None:
            found[f"offset_range.{name}"] = offset
    for group, members in sensor_groups().items():
        if set(members) & set(sensors):
            said, skew = numbers["assumed.delay"].source, skews.get(group)
            if skew is not None and np.isfinite(skew.standard_error):
                size = f"{1e3 * skew.delay:+.3f} +- {1e3 * skew.standard_error:.2g} ms"
                said += f"; these records: {size} behind {skew.reference}"
            found[f"delay_range.{group}"] = Quantity(numbers.number("assumed.delay"), "s", "assumed", said)
    name = title or f"of {plant.machine.name}, measured"
    return Parameters(found, {"sensors.name": name}, name)


def save_sensors(content: Parameters, path: Path) -> None:
    """Write a sensors file, whole or not at all."""
    groups: dict[str, list[str]] = {
        "sensors": [f"name = {json.dumps(content.words['sensors.name'], ensure_ascii=False)}"]
    }
    for key, quantity in content.items():
        section, _, entry = key.partition(".")
        groups.setdefault(section, []).append(f"{entry} = {quantity_toml(quantity)}")
    about = [
        "Sensors measured by their own records (lhpost6 check --sensors-out). SI; keys as in models/sensors.",
        "noise: standard deviation of white noise at that rate, before the low-pass, without the digital resolution.",
        "No gain_range: nothing else measures what that channel does, and its gain is the scale of what it tells.",
        "Ranges are largest errors, either way: replace what is assumed there by what calibration sheets say.",
    ]
    with write_whole(path) as beside:
        beside.write_text(sections_toml(about, groups), encoding="utf-8")


def compare_noise(levels: NoiseLevels, sensors: SensorSet | None) -> tuple[NoiseComparison, ...]:
    """Noise of every channel beside what a sensors file states, if one is given."""
    return tuple(_compared(one, levels.rate, sensors) for one in levels.channels.values())


def _compared(one: ChannelNoise, rate: float, sensors: SensorSet | None) -> NoiseComparison:
    six, varies = "axis" in LAYOUT[one.channel].dims, np.flatnonzero(one.density > 0)
    own, quantum = one.density[varies], one.quantum[varies]
    measured, stated = own + quantum, np.full(len(own), np.nan)
    measured = measured if six else measured.mean(keepdims=True)
    tolerance, filtered = 0.0, False
    if sensors is not None:
        filtered = _filtered(one, rate, sensors)
        stated = (_plateau(one, rate, sensors) if filtered else _stated_density(one, rate, sensors))[varies]
        stated = np.where(stated > 0, stated + quantum, 0.0)
        tolerance = float(sensors.noise_range + 3 * one.error.max())
    stated = stated[: len(measured)]
    ratio = np.divide(measured, stated, out=np.full(len(measured), np.inf), where=stated > 0)
    worst = int(np.argmax(np.abs(np.log(ratio))))
    channel = f"{one.channel}[{AXES[varies[worst]]}]" if six else one.channel
    sd, due = (float(np.sqrt(x[worst] * rate / 2)) for x in (measured, stated))
    uneven = 1.0 if six else float(np.sqrt(own.max() / np.median(own)))
    return NoiseComparison(channel, channel_unit(channel), sd, due, tolerance, one.corner, one.step, uneven, filtered)


def _stated_density(one: ChannelNoise, rate: float, sensors: SensorSet) -> Array:
    """Density (k,) of a channel's noise as a file states it, over the band in which it was measured [unit2/Hz]."""
    f = np.linspace(one.low, one.high, 33)
    return np.broadcast_to(recorded_spectrum(sensors, one.channel, f, rate).mean(axis=0), one.density.shape)


def _plateau(one: ChannelNoise, rate: float, sensors: SensorSet) -> Array:
    """Largest density (k,) of a channel's noise at any frequency of the records, as a file states it [unit2/Hz]."""
    f = np.linspace(0.0, rate / 2, 129)
    return np.broadcast_to(recorded_spectrum(sensors, one.channel, f, rate).max(axis=0), one.density.shape)


def _filtered(one: ChannelNoise, rate: float, sensors: SensorSet) -> bool:
    """Whether noise was read above the stated low-pass, as may be where no rest shows it below."""
    return bool((_stated_density(one, rate, sensors) < CORNER * _plateau(one, rate, sensors)).any())


# ------------------------------------------------------------------------------------------------ content
def _measured(value: float | Sequence[float], unit: str, source: str) -> Quantity:
    """A quantity to four figures."""
    rounded: Value = (
        float(f"{value:.4g}") if isinstance(value, int | float) else tuple(float(f"{x:.4g}") for x in value)
    )
    return Quantity(rounded, unit, "measured", source)


def _unit(name: str) -> str:
    return LAYOUT[name].units.replace(",", " |")


def _sampling(levels: NoiseLevels, numbers: Parameters) -> dict[str, Quantity]:
    """Rate, low-pass, resolution and uncertainty of the levels."""
    sensors = {name: one for name, one in levels.channels.items() if LAYOUT[name].role != "command"}
    coarsest = min(sensors, key=lambda name: sensors[name].bits, default="")
    bits = min(sensors[coarsest].bits if coarsest else MOST_BITS, MOST_BITS)
    own = numbers["assumed.noise_range" if levels.seconds else "assumed.without_rest"]
    error = 2 * max(float(one.error.max()) for one in levels.channels.values())
    spread = _measured(error, "1", f"two standard errors, {levels.source}")
    if levels.band is None:
        shown = "no low-pass shows below half the sampling rate"
        low_pass = _measured(levels.rate / 2, "Hz", f"{levels.source}: {shown}")
        order = Quantity(numbers.number("assumed.order"), "1", "assumed", numbers["assumed.order"].source)
    else:
        low_pass = _measured(levels.band.high, "Hz", f"{levels.source}: gain one half")
        order = Quantity(float(levels.band.order), "1", "measured", f"{levels.source}: fall of the noise")
    step = f"resolution of {coarsest}, the coarsest" if coarsest else "no resolution shows"
    return {
        "rate": Quantity(levels.rate, "Hz", "measured", f"of the records; levels from {levels.source}"),
        "low_pass": low_pass,
        "low_pass_order": order,
        "bits": Quantity(float(max(1, round(bits))), "1", "measured", f"{step}, over its largest range"),
        "noise_range": spread if error > float(own.value) else Quantity(own.value, "1", "assumed", own.source),  # type: ignore[arg-type]
    }


def _offset(machine: Machine, one: ChannelNoise, source: str, numbers: Parameters) -> Quantity | None:
    """Range of a channel's offset: measured where nothing but an offset shows at rest; None where nothing is known."""
    channel, share = LAYOUT[one.channel], numbers.number("assumed.offset") * machine.hydraulics.supply_pressure
    if channel.units == "Pa" or one.channel == "actuator_force":
        area = max(a.area_a for a in machine.actuators) if channel.units == "N" else 1.0
        return Quantity(float(f"{share * area:.4g}"), channel.units, "assumed", numbers["assumed.offset"].source)
    still = one.channel in MOTION or one.channel in (
        "actuator_displacement",
        "point_acceleration",
        "floor_acceleration",
    )
    size = np.abs(one.offset) + one.offset_spread
    if not still or not np.isfinite(size).all() or not size.any():
        return None
    read = f"largest mean at rest and difference of two, {source}"
    return _measured(float(size.max()), _unit(one.channel), read)
