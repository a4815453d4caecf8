"""Sensors: the noise and calibration uncertainty of a record's channels; simulated noise.

White noise of standard deviation sigma at the rate r has the one-sided spectrum 2 sigma^2 / r; the low-pass before
recording multiplies it by the square of its gain. What is sampled at another rate keeps its spectrum, folded at half
the new rate. Recording with a step q adds 2 (q^2 / 12) / rate, white at the record's own rate.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.errors import ParameterError, UnknownNameError, instead_of
from ..core.files import find_shipped
from ..machine.accelerometers import ACCELEROMETER, accelerometers_of
from ..machine.parameters import Parameters, load_parameters
from .accelerometers import WEIGHTS
from .channels import LAYOUT, columns_of, kinds_of, same_unit, sensor_groups
from .conditioning import resolutions
from .records import sample_interval
from .signals import Band

__all__ = ["SENSOR", "SensorSet", "add_noise", "load_sensors", "make_sensors", "recorded_spectrum", "spectrum"]

SENSOR = "lhpost6_sensors_of"
"""Attribute of a variable that is none of the layout: the channel whose sensors it comes from."""

SAMPLING = {"rate": "Hz", "low_pass": "Hz", "low_pass_order": "1", "bits": "1", "noise_range": "1"}


@dataclass(frozen=True)
class SensorSet:
    """Noise and calibration ranges by channel; what is not listed is free of them.

    `noise` is the standard deviation (1,) or (6,) of white noise at `rate` [Hz], before the low-pass `band`; gains
    [1], offsets [unit of the channel] and delays [s, by group] are uniform within plus or minus their range;
    standard deviations of noise may be off by `noise_range`.
    """

    name: str
    rate: float
    band: Band
    bits: int
    noise_range: float  # relative
    noise: Mapping[str, Array]
    gain_range: Mapping[str, float]
    offset_range: Mapping[str, float]
    delay_range: Mapping[str, float]
    parameters: Parameters

    def noise_spectrum(self, channel: str, f: ArrayLike) -> Array:
        """One-sided power spectral density (n, 1) or (n, 6) of a channel's noise at `f` (n,) [unit2/Hz].

        Raises UnknownNameError for a channel that the layout does not have.
        """
        if channel not in LAYOUT:
            raise UnknownNameError("channel of the record layout", channel, list(LAYOUT))
        f = np.asarray(f, dtype=float)
        shape = self.band.gain(f) ** 2 * (f <= self.rate / 2)
        return np.multiply.outer(shape, 2 * self.noise.get(channel, np.zeros(1)) ** 2 / self.rate)

    def noise_sd(self, channel: str, cutoff: float = np.inf) -> Array:
        """Standard deviation (1,) or (6,) of the noise below a sharp `cutoff` [Hz], by default of all recorded."""
        f = np.linspace(0.0, min(cutoff, self.rate / 2), 4097)
        return np.sqrt(np.trapezoid(self.noise_spectrum(channel, f), f, axis=0))

    def drawn_twice(self) -> "SensorSet":
        """Sensors of measured records to which `add_noise` has added as much again: a platen at rest moves more."""
        return replace(self, noise={channel: np.sqrt(2.0) * sd for channel, sd in self.noise.items()})

    def gain_sd(self, channel: str) -> float:
        """Standard deviation of a channel's gain [1]."""
        return self.gain_range.get(channel, 0.0) / np.sqrt(3.0)

    def offset_sd(self, channel: str) -> float:
        """Standard deviation of a channel's offset [its unit]."""
        return self.offset_range.get(channel, 0.0) / np.sqrt(3.0)

    def delay_sd(self, group: str) -> float:
        """Standard deviation of the delay of a group of `channels.sensor_groups` [s]."""
        return self.delay_range.get(group, 0.0) / np.sqrt(3.0)

    def relative_delay_range(self, group: str, reference: str) -> float:
        """Largest delay of one group behind another [s], as each may be off by its range."""
        return self.delay_range.get(group, 0.0) + self.delay_range.get(reference, 0.0)


def load_sensors(name_or_path: str | Path = "lhpost6") -> SensorSet:
    """Read a file of sensors by shipped name or by path.

    Raises UnknownNameError, or ParameterError naming file and key for what is missing, unknown or impossible.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = find_shipped("sensors", str(name_or_path), "sensors")
    return make_sensors(load_parameters(path), path.stem)


def make_sensors(given: Parameters, stem: str = "sensors") -> SensorSet:
    """Sensors of the quantities of a file, called `stem` where they state none; raises ParameterError."""
    units = {name: channel.units for name, channel in LAYOUT.items()}
    delays, gains = dict.fromkeys(sensor_groups(), "s"), dict.fromkeys(LAYOUT, "1")
    accelerometers_of(given)  # raises for one that is not complete
    known = {"sampling": SAMPLING, "noise": units, "gain_range": gains, "offset_range": units, "delay_range": delays}
    found: dict[str, dict[str, Array]] = {section: {} for section in known}
    for key, quantity in given.items():
        section, _, name = key.partition(".")
        if key.startswith(ACCELEROMETER):
            continue
        if name not in (valid := known.get(section, {})):
            remedy = instead_of(name, list(valid)) if valid else instead_of(section, list(known))
            raise ParameterError(f"{given.origin}: {key} is unknown; {remedy}")
        if not same_unit(quantity.unit.replace(" |", ","), valid[name]):
            raise ParameterError(f"{given.origin}: {key}: unit {quantity.unit!r} should be {valid[name]!r}")
        values = np.atleast_1d(np.asarray(quantity.value, dtype=float))
        if len(values) != (6 if section == "noise" and "axis" in LAYOUT[name].dims else 1) or (values < 0).any():
            raise ParameterError(f"{given.origin}: {key}: {quantity.value!r} has the wrong length, or is negative")
        found[section][name] = values
    for key in SAMPLING:
        if not found["sampling"].get(key, np.zeros(1))[0] > 0:
            raise ParameterError(f"{given.origin}: sampling.{key} is missing or not positive")
    ranges = {section: {name: float(x[0]) for name, x in found[section].items()} for section in known}
    noise, sampling = found["noise"], ranges["sampling"]
    for key, least, most in (("bits", 1, 64), ("low_pass_order", 2, 1000)):  # no recorder, no filter has more
        if not (sampling[key].is_integer() and least <= sampling[key] <= most):
            what = f"{sampling[key]:g} should be a whole number from {least} to {most}"
            raise ParameterError(f"{given.origin}: sampling.{key}: {what}")
    return SensorSet(
        name=str(given.words.get("sensors.name", stem)),
        rate=sampling["rate"],
        band=Band(high=sampling["low_pass"], order=int(sampling["low_pass_order"])),
        bits=int(sampling["bits"]),
        noise_range=sampling["noise_range"],
        noise=noise,
        gain_range=ranges["gain_range"],
        offset_range=ranges["offset_range"],
        delay_range=ranges["delay_range"],
        parameters=given,
    )


def spectrum(sensors: SensorSet, record: xr.Dataset, channel: str, f: ArrayLike) -> Array:
    """Noise spectrum (n, columns) of a channel in this record: its sensor's, and that of its digital resolution."""
    values = columns_of(record[channel])
    steps = resolutions(record[channel])
    sensor, gain = _source(sensors, record[channel])
    stated = sensors.noise_spectrum(sensor, f) * gain**2 + steps**2 / 6 * sample_interval(record)
    return np.broadcast_to(stated, (len(stated), values.shape[1]))


def recorded_spectrum(sensors: SensorSet, channel: str, f: ArrayLike, rate: float) -> Array:
    """Noise spectrum (n, 1) or (n, 6) of a channel sampled at `rate` [Hz]: what lies above half of it is folded."""
    f = np.asarray(f, dtype=float)
    folds = range(int(np.ceil(sensors.rate / 2 / rate)) + 1)
    places = [f + k * rate for k in folds] + [k * rate - f for k in folds[1:]]
    return np.asarray(np.sum([sensors.noise_spectrum(channel, place) for place in places], axis=0))


def _source(sensors: SensorSet, variable: xr.DataArray) -> tuple[str, Array]:
    """Channel whose sensors a variable comes from, and its noise (1,) or (6,) over theirs."""
    if SENSOR in variable.attrs:
        return str(variable.attrs[SENSOR]), np.ones(1)
    gain = variable.attrs.get(WEIGHTS)
    if gain is None or "point_acceleration" not in sensors.noise:
        return str(variable.name), np.ones(1)
    return "point_acceleration", np.asarray(gain, float)


# -------------------------------------------------------------------------------------------- simulation
def add_noise(record: xr.Dataset, sensors: SensorSet, rng: np.random.Generator) -> xr.Dataset:
    """Record with simulated noise on every channel that has any, recorded with the sensors' bits over its range.

    Translations and rotations have a range of their own.
    The noise is Gaussian with the stated spectrum: white at the sensors' rate, low-passed, and sampled at the record's
    rate, whatever that is; what lies above half of it is folded down, as sampling does.
    """
    channels = {}
    for name in (*sensors.noise, *(name for name, variable in record.items() if SENSOR in variable.attrs)):
        if name in record:
            values, (sensor, gain) = columns_of(record[name]), _source(sensors, record[name])
            noisy = values + gain * _draw(sensors, sensor, values.shape, 1 / sample_interval(record), rng)
            for kind in kinds_of(record[name]):
                step = np.ptp(noisy[:, kind]) / (2**sensors.bits - 1)
                noisy[:, kind] = step * np.round(noisy[:, kind] / step) if step > 0 else noisy[:, kind]
            channels[name] = record[name].copy(data=noisy.reshape(record[name].shape))
    return record.assign(channels).assign_attrs(noise=f"simulated: {sensors.name}")


def _draw(sensors: SensorSet, channel: str, shape: tuple[int, int], rate: float, rng: np.random.Generator) -> Array:
    from scipy import fft

    extra = int(np.ceil(0.1 * rate))  # the Fourier sum is periodic: what wraps around is discarded
    n = fft.next_fast_len(shape[0] + extra, real=True)
    f = fft.rfftfreq(n, 1 / rate)
    power = recorded_spectrum(sensors, channel, f, rate)
    white = fft.rfft(rng.standard_normal((n, shape[1])), axis=0)  # of unit variance: spectrum 2 / rate
    return fft.irfft(white * np.sqrt(power * rate / 2), n, axis=0)[: shape[0]]
