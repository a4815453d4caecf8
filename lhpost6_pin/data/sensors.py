"""Sensors: the noise and calibration uncertainty of a record's channels; noise simulated and estimated.

White noise of standard deviation sigma at the rate r has the one-sided spectrum 2 sigma^2 / r; the low-pass before
recording multiplies it by the square of its gain. What is sampled at another rate keeps its spectrum, folded at half
the new rate. Recording with a step q adds 2 (q^2 / 12) / rate, white at the record's own rate.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..core.errors import ParameterError, UnknownNameError, instead_of
from ..core.files import find_shipped
from ..machine.parameters import Parameters, load_parameters
from .channels import LAYOUT, channel_name, same_unit, sensor_groups
from .conditioning import resolution
from .records import sample_interval
from .signals import Band

__all__ = ["NoiseEstimate", "SensorSet", "add_noise", "estimate_noise", "find_rest", "load_sensors", "spectrum"]

Array = NDArray[np.float64]
log = logging.getLogger(__name__)

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
        """Standard deviation (1,) or (6,) that is left below a sharp `cutoff` [Hz], by default of all recorded."""
        f = np.linspace(0.0, min(cutoff, self.rate / 2), 4097)
        return np.sqrt(np.trapezoid(self.noise_spectrum(channel, f), f, axis=0))

    def gain_sd(self, channel: str) -> float:
        """Standard deviation of a channel's gain [1]."""
        return self.gain_range.get(channel, 0.0) / np.sqrt(3.0)

    def offset_sd(self, channel: str) -> float:
        """Standard deviation of a channel's offset [its unit]."""
        return self.offset_range.get(channel, 0.0) / np.sqrt(3.0)

    def delay_sd(self, group: str) -> float:
        """Standard deviation of the delay of a group of `channels.sensor_groups` [s]."""
        return self.delay_range.get(group, 0.0) / np.sqrt(3.0)


def load_sensors(name_or_path: str | Path = "lhpost6") -> SensorSet:
    """Read a file of sensors by shipped name or by path.

    Raises UnknownNameError, or ParameterError naming file and key for what is missing, unknown or impossible.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = find_shipped("sensors", str(name_or_path), "sensors")
    given = load_parameters(path)
    tables: dict[str, dict[str, Array]] = {"noise": {}, "gain_range": {}, "offset_range": {}, "delay_range": {}}
    for key, quantity in given.items():
        section, _, channel = key.partition(".")
        if section not in tables:
            if section != "sampling":
                raise ParameterError(f"{given.origin}: {key} is unknown; {instead_of(section, ('sampling', *tables))}")
            if channel not in SAMPLING:
                raise ParameterError(f"{given.origin}: {key} is unknown; {instead_of(channel, list(SAMPLING))}")
            if quantity.unit != SAMPLING[channel]:
                raise ParameterError(f"{given.origin}: {key}: unit {quantity.unit!r} should be {SAMPLING[channel]!r}")
            continue
        valid = sensor_groups() if section == "delay_range" else LAYOUT
        if channel not in valid:
            raise UnknownNameError(f"channel for {section} in {given.origin}", channel, list(valid))
        right = {"gain_range": "1", "delay_range": "s"}.get(section) or LAYOUT[channel].units
        values = np.atleast_1d(np.asarray(quantity.value, dtype=float))
        if not same_unit(quantity.unit.replace(" |", ","), right):
            raise ParameterError(f"{given.origin}: {key}: unit {quantity.unit!r} should be {right!r}")
        if len(values) != (6 if section == "noise" and "axis" in LAYOUT[channel].dims else 1) or (values < 0).any():
            raise ParameterError(f"{given.origin}: {key}: {quantity.value!r} has the wrong length, or is negative")
        tables[section][channel] = values
    if missing := [key for key in SAMPLING if f"sampling.{key}" not in given]:
        raise ParameterError(f"{given.origin}: sampling.{missing[0]} is missing")
    sampling = {key: given.number(f"sampling.{key}") for key in SAMPLING}
    if min(sampling.values()) <= 0:
        raise ParameterError(f"{given.origin}: sampling: {sampling} should be positive")
    for key, least, most in (("bits", 1, 64), ("low_pass_order", 2, 1000)):  # no recorder, no filter has more
        if not (sampling[key].is_integer() and least <= sampling[key] <= most):
            what = f"{sampling[key]:g} should be a whole number from {least} to {most}"
            raise ParameterError(f"{given.origin}: sampling.{key}: {what}")
    noise, *ranges = tables.values()
    return SensorSet(
        name=str(given.words.get("sensors.name", path.stem)),
        rate=sampling["rate"],
        band=Band(high=sampling["low_pass"], order=int(sampling["low_pass_order"])),
        bits=int(sampling["bits"]),
        noise_range=sampling["noise_range"],
        noise=noise,
        gain_range={k: float(v[0]) for k, v in ranges[0].items()},
        offset_range={k: float(v[0]) for k, v in ranges[1].items()},
        delay_range={k: float(v[0]) for k, v in ranges[2].items()},
        parameters=given,
    )


def spectrum(sensors: SensorSet, record: xr.Dataset, channel: str, f: ArrayLike) -> Array:
    """Noise spectrum (n, columns) of a channel in this record: its sensor's, and that of its digital resolution."""
    values = _columns(record, channel)
    step = resolution(values)
    stated = sensors.noise_spectrum(channel, f) + step**2 / 6 * sample_interval(record)
    return np.broadcast_to(stated, (len(stated), values.shape[1]))


# -------------------------------------------------------------------------------------------- simulation
def add_noise(record: xr.Dataset, sensors: SensorSet, rng: np.random.Generator) -> xr.Dataset:
    """Record with simulated noise on every channel that has any, recorded with the sensors' bits over its range.

    The noise is Gaussian with the stated spectrum: white at the sensors' rate, low-passed, and sampled at the record's
    rate, whatever that is; what lies above half of it is folded down, as sampling does.
    """
    channels = {}
    for name in sensors.noise:
        if name in record:
            values = _columns(record, name)
            noisy = values + _draw(sensors, name, values.shape, 1 / sample_interval(record), rng)
            step = np.ptp(noisy) / (2**sensors.bits - 1)
            noisy = step * np.round(noisy / step) if step > 0 else noisy
            channels[name] = record[name].copy(data=noisy.reshape(record[name].shape))
    return record.assign(channels).assign_attrs(noise=f"simulated: {sensors.name}")


def _draw(sensors: SensorSet, channel: str, shape: tuple[int, int], rate: float, rng: np.random.Generator) -> Array:
    from scipy import fft

    extra = int(np.ceil(0.1 * rate))  # the Fourier sum is periodic: what wraps around is thrown away
    n = fft.next_fast_len(shape[0] + extra, real=True)
    f = fft.rfftfreq(n, 1 / rate)
    folds = range(int(np.ceil(sensors.rate / 2 / rate)) + 1)
    places = [f + k * rate for k in folds] + [k * rate - f for k in folds[1:]]
    power = np.sum([sensors.noise_spectrum(channel, place) for place in places], axis=0)
    white = fft.rfft(rng.standard_normal((n, shape[1])), axis=0)  # of unit variance: spectrum 2 / rate
    return fft.irfft(white * np.sqrt(power * rate / 2), n, axis=0)[: shape[0]]


# -------------------------------------------------------------------------------------------- estimation
class NoiseEstimate(NamedTuple):
    """Noise of one column at rest, as the standard deviation before the low-pass, beside what is stated."""

    channel: str  # as in `platen_displacement[yaw]`
    sd: float
    standard_error: float
    stated: float  # with the share of the digital resolution

    @property
    def ratio(self) -> float:
        """Estimated over stated [1]."""
        return self.sd / self.stated


def find_rest(record: xr.Dataset, sensors: SensorSet, k: float = 6.0) -> slice:
    """Leading samples in which no channel moves beyond `k` standard deviations of its stated noise.

    Each column is judged from its mean over the first 1/16 s. Two periods of the low-pass at the start are left out:
    they bear its edge. Channels without stated noise do not count. An empty slice means that the record does not
    begin at rest (or is noisier than `k` allows).
    """
    n, dt = record.sizes["time"], sample_interval(record)
    edge = int(np.ceil(2 / (sensors.band.high * dt)))
    least = max(2, round(1 / 16 / dt))
    if n < edge + least:
        return slice(0, 0)
    for name in sensors.noise:
        if name in record:
            values = _columns(record, name)[edge:]
            limit = k * _recorded_sd(sensors, record, name)
            moved = (np.abs(values - values[:least].mean(axis=0)) > limit).any(axis=1)
            n = min(n, edge + int(np.argmax(moved))) if moved.any() else n
    return slice(edge, n) if n >= edge + least else slice(0, 0)


def estimate_noise(record: xr.Dataset, sensors: SensorSet, rest: slice | None = None) -> tuple[NoiseEstimate, ...]:
    """Noise of every column that has any stated, from the samples `rest` (found by `find_rest` if not given).

    Its variance over that left by the low-pass is scaled back to white noise at the sensors' rate. The standard error
    is that of as many independent values as the band allows, 2 x bandwidth x time. Empty without a rest of 1/4 s.
    """
    rest = find_rest(record, sensors) if rest is None else rest
    start, stop, _ = rest.indices(record.sizes["time"])
    duration = (stop - start) * sample_interval(record)
    if duration < 0.25:
        log.info("no rest of 1/4 s to estimate noise from: %g s", duration)
        return ()
    f = np.linspace(0.0, sensors.rate / 2, 4097)
    kept = np.sqrt(np.trapezoid(sensors.band.gain(f) ** 2, f) / (sensors.rate / 2))
    error = 1 / np.sqrt(2 * (2 * sensors.band.high * duration - 1))  # relative, of a standard deviation
    found = []
    for name in sensors.noise:
        if name in record:
            sd = (_columns(record, name)[rest].std(axis=0, ddof=1) / kept).tolist()
            stated = (_recorded_sd(sensors, record, name) / kept).tolist()
            names = [channel_name(record[name], j) for j in range(len(sd))]
            found += [
                NoiseEstimate(c, float(s), float(s * error), float(w))
                for c, s, w in zip(names, sd, stated, strict=True)
            ]
    return tuple(found)


def _recorded_sd(sensors: SensorSet, record: xr.Dataset, channel: str) -> Array:
    """Standard deviation (columns,) of a channel's noise as recorded: the sensor's and that of the resolution."""
    values = _columns(record, channel)
    sd = np.sqrt(sensors.noise_sd(channel) ** 2 + resolution(values) ** 2 / 12)
    return np.broadcast_to(sd, values.shape[1:])


def _columns(record: xr.Dataset, channel: str) -> Array:
    return record[channel].values.astype(float).reshape(record.sizes["time"], -1)
