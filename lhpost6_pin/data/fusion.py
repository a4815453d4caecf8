"""Platen motion fused from displacement, velocity and acceleration sensors.

As in a composite feedback generator, displacement sensors give the low frequencies and accelerometers the high ones;
offline it can be done without phase. With weights W that are real functions of frequency and add up to one,

    x = W_x x_s + W_v v_s / s + W_a a_s / s^2,   v = s x,   a = s^2 x

By default each weight is the inverse of its sensor's noise spectrum, S_x, S_v / w^2 and S_a / w^4, over their sum: no
other linear combination has less noise. For white displacement and acceleration noise that is

    W_x = c^4 / (c^4 + w^4),   W_a = w^4 / (c^4 + w^4),   c^4 = S_a / S_x

a second-order Butterworth pair run both ways; a crossover c that is given takes the place of the optimum.
The integrals are formed in time and only the sensors' differences are filtered, so that a record may begin and end
in motion. Sensors are taken as calibrated and aligned: their gains and skews are not noise.
"""

import logging
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import RecordError
from ..mechanics.plant import Plant
from ..mechanics.pose import PlatenMotion, forward_kinematics, kinematic_jacobian
from .channels import MOTION, channel_name
from .conditioning import WIDTHS, integrate, quieted
from .records import sample_interval
from .sensors import SensorSet, spectrum
from .signals import Band, differentiate

__all__ = ["FusedMotion", "fuse_motion"]

log = logging.getLogger(__name__)

NO_NOISE = 1e-60  # least density [unit2/Hz], so that sensors free of noise can be weighed against each other


class FusedMotion(NamedTuple):
    """Motion of C in {s} with Euler angles; standard deviation (6,) of its noise; the channels it was made of."""

    motion: PlatenMotion  # displacement, velocity, acceleration (n, 6)
    noise: PlatenMotion  # (6,) each
    path: Array  # (n, 6) displacement, constant where it rests: for the memory of friction, which noise would erase
    used: tuple[str, ...]
    share: Mapping[str, PlatenMotion]  # of each channel in the motion, which is their sum; empty if not requested
    sample: Array  # (6,) standard deviation of a displacement before fusion, at which the motion begins


class _Sensor(NamedTuple):
    """One kind of sensor: signal (n, 6) and noise spectrum (f, 6), from frequency zero up."""

    signal: Array
    spectrum: Array

    @property
    def density(self) -> Array:
        """Noise spectrum (6,) below the low-pass, which all sensors share and so does not matter to weights."""
        return np.maximum(self.spectrum[0], NO_NOISE)


def fuse_motion(
    plant: Plant,
    record: xr.Dataset,
    sensors: SensorSet,
    *,
    crossover: float | None = None,
    band: Band | None = None,
    shares: bool = False,
) -> FusedMotion:
    """Platen motion from actuator lengths, platen displacement, velocity and acceleration, whichever there are.

    Lengths come in by forward kinematics; with platen displacement as well, the two are averaged by their noise.
    `crossover` [Hz] replaces the optimum weights (platen velocity then only serves where there is no acceleration).
    All three results are filtered by `band`, by default the sensors' own low-pass; without accelerometers give a
    narrower one, since differentiated noise grows with frequency. v and a are the derivatives of x within it.
    `shares` adds what each channel contributes: fusion is linear in its channels, the weights given.

    Raises RecordError if there is neither displacement nor length, or a channel that is used is not finite.
    """
    time = record["time"].values
    dt = sample_interval(record)
    f = np.asarray(np.fft.rfftfreq(2 * (len(time) - 1), dt), np.float64)
    displacement, parts = _displacement(plant, record, sensors, f)
    velocity, acceleration = (_sensor(record, sensors, f, n) for n in MOTION[1:])
    if crossover is not None and acceleration is not None:
        velocity = None
    signals = [None if s is None else s.signal for s in (displacement, velocity, acceleration)]
    channels = [(name, 0, part) for name, part in parts.items()]
    channels += [(n, k, x) for n, k, x in zip(MOTION[1:], (1, 2), signals[1:], strict=True) if x is not None]
    used = tuple(name for name, *_ in channels)
    log.info("platen motion from %s", ", ".join(used))
    band = sensors.band if band is None else band
    weights = _weights(f, displacement, velocity, acceleration, crossover)

    def composed(signals: Sequence[Array | None]) -> PlatenMotion:
        return PlatenMotion(*(band.apply(x, dt) for x in _composite(f, signals, weights, dt)))

    def alone(order: int, part: Array) -> PlatenMotion:
        return composed([None if x is None else part if k == order else 0.0 * x for k, x in enumerate(signals)])

    motion = composed(signals)
    power = _noise(f, (displacement, velocity, acceleration), weights, band)
    omega = 2 * np.pi * f[:, None]
    noise = PlatenMotion(*(_deviation(f, power * omega ** (2 * k)) for k in range(3)))
    gains = [np.exp(-((omega * width) ** 2) / 2) for width in (0.0, *WIDTHS)]
    lost = [_deviation(f, power * (wider - narrower) ** 2) for narrower, wider in pairwise(gains)]
    share = {name: alone(order, part) for name, order, part in channels} if shares else {}
    sample = _deviation(f, displacement.spectrum)
    return FusedMotion(motion, noise, quieted(motion.displacement, lost, dt), used, share, sample)


def _displacement(plant: Plant, record: xr.Dataset, sensors: SensorSet, f: Array) -> tuple[_Sensor, dict[str, Array]]:
    """Displacement by all sensors that measure it, each axis weighted by the inverse of their noise; their parts."""
    found: dict[str, _Sensor] = {}
    if "actuator_displacement" in record:
        pose, _ = forward_kinematics(plant, record["actuator_displacement"].values)
        inverse = np.zeros((6, plant.spools))
        inverse[plant.axes] = np.linalg.pinv(kinematic_jacobian(plant)[:, plant.axes])
        noise = spectrum(sensors, record, "actuator_displacement", f) @ (inverse**2).T
        found["actuator_displacement"] = _Sensor(pose, noise)
    name = "platen_displacement"
    platen = _sensor(record, sensors, f, name)
    if platen is not None:
        found[name] = platen
    if not found:
        where = record.encoding.get("source", "the record")
        raise RecordError(f"{where}: has neither actuator_displacement nor platen_displacement; give one of them")
    if len(found) == 1:
        ((name, only),) = found.items()
        return only, {name: only.signal}
    one, two = found.values()
    weight = two.density / (one.density + two.density)  # of the first
    parts = dict(zip(found, (weight * one.signal, (1 - weight) * two.signal), strict=True))
    noise = weight**2 * one.spectrum + (1 - weight) ** 2 * two.spectrum
    return _Sensor(np.add(*parts.values()), noise), parts


def _sensor(record: xr.Dataset, sensors: SensorSet, f: Array, name: str) -> _Sensor | None:
    """Platen channel with its noise; None if the record does not have it."""
    if name not in record:
        return None
    values = record[name].values
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        sample, column = bad[0]
        raise RecordError(f"{channel_name(record[name], column)} at sample {sample} is not finite; mend or cut it")
    return _Sensor(values, spectrum(sensors, record, name, f))


def _weights(
    f: Array, x: _Sensor, v: _Sensor | None, a: _Sensor | None, crossover: float | None
) -> tuple[Array, Array, Array]:
    """Weights (f, 6) of displacement, velocity and acceleration; they add up to one."""
    omega = 2 * np.pi * f[:, None]
    c = None if crossover is None else 2 * np.pi * crossover
    by_v = np.zeros((len(f), 6)) if v is None else omega**2 * (x.density / v.density if c is None else c**-2)
    by_a = np.zeros((len(f), 6)) if a is None else omega**4 * (x.density / a.density if c is None else c**-4)
    total = 1 + by_v + by_a
    return 1 / total, by_v / total, by_a / total


def _composite(
    f: Array, signals: Sequence[Array | None], weights: tuple[Array, Array, Array], dt: float
) -> PlatenMotion:
    """Motion by the signal of highest order, integrated, and the weighted differences of the others from it."""
    x, v, a = signals
    assert x is not None
    once = None if v is None else integrate(v, dt)[0]
    if a is not None:
        speed, base = integrate(a, dt)
        motion = [base, speed, a]
    elif v is not None and once is not None:
        base, motion = once, [once, v, differentiate(v, dt)]
    else:
        rate = differentiate(x, dt)
        return PlatenMotion(x, rate, differentiate(rate, dt))
    differences = [(x - base, weights[0])]
    if a is not None and once is not None:
        differences.append((once - base, weights[1]))
    return PlatenMotion(*(m + c for m, c in zip(motion, _weighted(differences, f, dt), strict=True)))


def _weighted(differences: list[tuple[Array, Array]], f: Array, dt: float) -> PlatenMotion:
    """Sum of differences (n, 6) between sensors, each times its weight (f, 6), and its derivatives.

    The parabola in each, of offsets and starting values, passes with the weight at zero frequency; what is left is
    continued by odd reflection about the ends, as in `signals`.
    """
    from scipy import fft

    n = len(differences[0][0])
    t = dt * (np.arange(n) - (n - 1) / 2)
    basis = np.stack([np.ones(n), t / t[-1], (t / t[-1]) ** 2], axis=1)
    spectra, slow = np.zeros((len(f), 6), complex), np.zeros((3, 6))
    for difference, weight in differences:
        parabola = np.linalg.lstsq(basis, difference, rcond=None)[0]  # the least one through two samples
        rest = difference - basis @ parabola
        middle, half = (rest[-1] + rest[0]) / 2, (rest[-1] - rest[0]) / 2
        rest = rest - middle - np.outer(basis[:, 1], half)
        spectra += weight * fft.rfft(np.concatenate([rest, -rest[-2:0:-1]]), axis=0)
        slow += weight[0] * (parabola + np.stack([middle, half, np.zeros(6)]))
    s = 2j * np.pi * f[:, None]
    x, v, a = (fft.irfft(spectra * s**k, 2 * (n - 1), axis=0)[:n] for k in range(3))
    speed = (slow[1] + 2 * np.outer(basis[:, 1], slow[2])) / t[-1]
    return PlatenMotion(x + basis @ slow, v + speed, a + 2 * slow[2] / t[-1] ** 2)


def _noise(f: Array, kinds: tuple[_Sensor | None, ...], weights: tuple[Array, Array, Array], band: Band) -> Array:
    """Spectrum (f, 6) of the fused displacement's noise."""
    omega = 2 * np.pi * f[:, None]
    power = np.zeros((len(f), 6))
    for order, (kind, weight) in enumerate(zip(kinds, weights, strict=True)):
        if kind is not None:
            over = np.divide(weight, omega**order, out=np.zeros_like(weight), where=omega > 0) if order else weight
            power += over**2 * kind.spectrum
    return power * band.gain(f)[:, None] ** 2


def _deviation(f: Array, power: Array) -> Array:
    """Standard deviation (6,) of noise with a spectrum (f, 6)."""
    return np.asarray(np.sqrt(np.trapezoid(power, f, axis=0)))
