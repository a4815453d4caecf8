"""Noise of sensors from rests of the records: density, low-pass, offset and resolution of every column, pooled.

A level is the median over frequency of an averaged periodogram, so that lines of hum leave it as it is, and drift and
settling below its lowest frequency do so as well. The part that the digital resolution makes, which `sensors.spectrum`
adds for each record, is taken off. Without a rest the least level at which the spectrum of the quietest windows is flat
stands in, an upper bound; where it is flat nowhere, or only at the level of the resolution, the noise is hidden. A
record whose sampling rate leaves no band above that lowest frequency shows none.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..machine.parameters import Parameters
from .accelerometers import WEIGHTS
from .channels import LAYOUT, columns_of
from .conditioning import resolutions
from .records import sample_interval
from .rests import find_rests, rest_numbers, seconds_of
from .signals import Band

__all__ = ["CORNER", "ChannelNoise", "NoiseLevels", "noise_levels"]

LEAST_OWN = 0.05  # of the resolution's variance: noise below it cannot be told from none, and is taken as this
CORNER = 0.25  # of the power of the plateau: gain one half
ROUND_OFF = 1e-20  # of the noisiest column's density: what varies by 1e-10 of that is computed, and no sensor's
SINGLE = float(np.finfo(np.float32).eps)  # of a channel's largest range: no sensor resolves as little
FIT = (0.05, 1e-3)  # relative power down to which the low-pass is fitted; least, for its logarithm


class ChannelNoise(NamedTuple):
    """Noise of one channel, by column; a column that is constant throughout has none."""

    channel: str
    density: Array  # (k,) one-sided [unit2/Hz], below the low-pass, without that of the resolution
    error: Array  # (k,) relative standard error of its root
    offset: Array  # (k,) mean at rest [unit]; nan where there is no rest
    offset_spread: Array  # (k,) largest difference of the means of two rests [unit]
    quantum: Array  # (k,) density of the digital resolution [unit2/Hz], mean over records
    step: float  # digital resolution, the least of any record [unit]
    bits: float  # of its largest range over that resolution
    corner: float  # of its low-pass [Hz]; infinite where none shows
    low: float  # band that was read [Hz]
    high: float

    def sd(self, rate: float) -> Array:
        """Standard deviation (k,) of white noise of that density at a rate [Hz], before the low-pass."""
        return np.sqrt(self.density * rate / 2)

    def pooled(self) -> float:
        """Density of all columns that vary [unit2/Hz]."""
        return float(self.density[self.density > 0].mean())


class NoiseLevels(NamedTuple):
    """Noise of a campaign's channels."""

    rate: float  # of most of the records [Hz]
    band: Band | None  # low-pass that its channels share; None where none shows
    seconds: float  # of rest; 0: levels are upper bounds, from tests in motion
    tests: tuple[str, ...]  # with a rest, or all
    channels: Mapping[str, ChannelNoise]
    hidden: tuple[str, ...]  # channels whose noise a filter or motion hides, without a rest

    @property
    def source(self) -> str:
        """Where the levels come from, for a file."""
        if self.seconds:
            return f"{self.seconds:.1f} s of rest in {', '.join(self.tests)}"
        return f"upper bound, least flat part of the spectrum of {', '.join(self.tests)}, without a rest long enough"


class _Pool:
    """Periodograms of one channel, summed over windows."""

    def __init__(self) -> None:
        self.power: list[Array] = []  # (windows, bins, k) each
        self.means: list[Array] = []
        self.step, self.range = np.inf, 0.0
        self.quantum: list[Array] = []  # (k,) density of the resolution, of every window


def noise_levels(records: Sequence[xr.Dataset], numbers: Parameters | None = None) -> NoiseLevels:
    """Noise of every measured channel of a campaign, and of valve commands, which are recorded as voltages.

    A platen acceleration that was computed from accelerometers is none. Channels that carry no
    noise at all are omitted; so are records too slow to show any.
    """
    numbers = numbers or rest_numbers()
    rests = find_rests(records, numbers)
    seconds = seconds_of(records, rests)
    at_rest = seconds >= numbers.number("rest.least")
    if not at_rest:
        rests, seconds = [(slice(0, r.sizes["time"]),) for r in records], 0.0
    pools: dict[str, _Pool] = {}
    for record, slices in zip(records, rests, strict=True):
        if not _resolved(record, numbers):
            continue
        for name, pool in _channels(record, pools):
            _add(pool, record, name, slices, numbers)
    rates = [float(f"{1 / sample_interval(record):.6g}") for record in records]
    rate = max(rates, key=rates.count)
    bins = min((p.shape[1] for pool in pools.values() for p in pool.power), default=0)
    f = np.arange(bins) / numbers.number("spectrum.window")
    nyquist = min([rate / 2, *([f[-1]] if bins else [])])
    share = 1.0 if at_rest else numbers.number("spectrum.quietest")
    spectra = {name: _averaged(pool, bins, share) for name, pool in pools.items() if pool.power}
    flat: dict[str, tuple[float, float]] = {}
    for name, (mean, _) in spectra.items():
        plateau = (numbers.number("spectrum.lowest"), numbers.number("spectrum.plateau"))
        found = plateau if at_rest else _flat_band(f, mean, np.mean(pools[name].quantum, axis=0), numbers, nyquist)
        if found is not None:
            flat[name] = found
    most = numbers.number("spectrum.highest") * nyquist
    corners = {name: _corner(f, spectra[name][0], band, nyquist, most) for name, band in flat.items()}
    band = _shared(f, {name: spectra[name][0] for name in flat}, pools, corners, flat, numbers, nyquist)
    channels = {}
    for name, (low, high) in flat.items():
        if at_rest:
            high = min(most, 0.7 * min(corners[name], band.high if band else np.inf))
            low = min(low, 0.5 * high)
        one = _channel(name, pools[name], (f, *spectra[name]), (low, high), corners[name], at_rest)
        if one.density.any():
            channels[name] = one
    each = zip(records, rests, strict=True)
    tests = tuple(str(r.attrs.get("test", f"record {k + 1}")) for k, (r, slices) in enumerate(each) if slices)
    return NoiseLevels(rate, band, seconds, tests, channels, tuple(n for n in spectra if n not in flat))


def _resolved(record: xr.Dataset, numbers: Parameters) -> bool:
    """Whether a record's rate leaves a band in which noise is read: above drift, below the end of its spectrum."""
    return numbers.number("spectrum.highest") * 0.5 / sample_interval(record) > numbers.number("spectrum.lowest")


def _channels(record: xr.Dataset, pools: dict[str, _Pool]) -> Iterator[tuple[str, _Pool]]:
    for name, channel in LAYOUT.items():
        computed = name in record and WEIGHTS in record[name].attrs  # from other channels
        if name in record and not computed and (channel.role != "command" or name == "valve_command"):
            yield name, pools.setdefault(name, _Pool())


def _add(pool: _Pool, record: xr.Dataset, name: str, slices: Sequence[slice], numbers: Parameters) -> None:
    """Add a record's windows in `slices` to a channel's pool."""
    from scipy.signal import detrend
    from scipy.signal.windows import hann

    dt = sample_interval(record)
    values = columns_of(record[name])
    steps = resolutions(record[name])
    pool.step = min(pool.step, steps.max() or np.inf)
    pool.range = max(pool.range, float(np.ptp(values, axis=0).max()))
    n = round(numbers.number("spectrum.window") / dt)
    taper = hann(n, sym=False)
    for part in slices:
        x = values[part]
        if len(x) < n:
            continue
        pool.means.append(x.mean(axis=0))
        for start in range(0, len(x) - n + 1, n // 2):
            piece = detrend(x[start : start + n], axis=0) * taper[:, None]
            pool.power.append(2 * dt / np.sum(taper**2) * np.abs(np.fft.rfft(piece, axis=0))[None] ** 2)
            pool.quantum.append(steps**2 / 6 * dt)


def _averaged(pool: _Pool, bins: int, share: float) -> tuple[Array, float]:
    """Mean periodogram (bins, k) of a share of the windows, those of least power in any column that varies.

    With it the number of independent windows in it: half overlapping ones share a sixth.
    """
    power = np.concatenate([p[:, :bins] for p in pool.power])
    total = power.sum(axis=1)
    size = np.max(total / np.maximum(np.median(total, axis=0), 1e-300), axis=1)
    kept = np.argsort(size)[: max(4, round(share * len(power)))]
    return power[kept].mean(axis=0), max(1.0, 0.52 * len(kept) + 0.45)


def _level(mean: Array, count: float) -> Array:
    """Level (k,) of a mean periodogram (bins, k): its median, and what that is below the mean at so many windows."""
    from scipy.stats import chi2

    return np.asarray(np.median(mean, axis=0) / (chi2.ppf(0.5, 2 * count) / (2 * count)))


def _relative(f: Array, mean: Array, flat: tuple[float, float]) -> Array:
    """Spectrum (bins,) over its level in a flat band, the median of all columns that vary."""
    varying = mean[:, (mean > 0).any(axis=0)]
    inside = (f >= flat[0]) & (f <= flat[1])
    if not varying.size or not inside.any():
        return np.ones(len(f))
    scale = np.median(varying[inside], axis=0)
    return np.asarray(np.median(varying / np.where(scale > 0, scale, np.inf), axis=1))


def _corner(f: Array, mean: Array, flat: tuple[float, float], nyquist: float, most: float) -> float:
    """Frequency from which the noise stays below a quarter of its plateau [Hz]; infinite where it does not."""
    from scipy.ndimage import median_filter

    smooth = median_filter(_relative(f, mean, flat), 5)
    above = np.flatnonzero(smooth[f <= nyquist] > CORNER)
    top = f[above[-1]] if above.size else np.inf
    return float(top) if top < most else np.inf


def _shared(
    f: Array,
    spectra: Mapping[str, Array],
    pools: Mapping[str, _Pool],
    corners: Mapping[str, float],
    flat: Mapping[str, tuple[float, float]],
    numbers: Parameters,
    nyquist: float,
) -> Band | None:
    """Low-pass of most sensors, fitted to their spectra without that of the resolution."""
    from scipy.optimize import least_squares

    sensors = {name: corner for name, corner in corners.items() if LAYOUT[name].role != "command"}
    shown = [name for name, corner in sensors.items() if np.isfinite(corner)]
    if 2 * len(shown) <= len(sensors):
        return None
    own = {name: np.maximum(spectra[name] - np.mean(pools[name].quantum, axis=0), 0.0) for name in shown}
    shape = np.median([_relative(f, own[name], flat[name]) for name in shown], axis=0)
    used = (f >= np.median([flat[name][0] for name in shown])) & (f <= nyquist) & (shape > FIT[0])
    start = float(np.median([corners[name] for name in shown]))

    def misfit(x: Array) -> Array:
        gain = 1 / (1 + np.minimum(f[used] / x[0], 1e6) ** x[1])
        return np.asarray(np.log(np.maximum(gain**2, FIT[1])) - np.log(shape[used]))

    fit = least_squares(misfit, [start, numbers.number("assumed.order")], bounds=([0.5 * start, 2], [2 * start, 64]))
    return Band(high=float(fit.x[0]), order=2 * max(1, round(float(fit.x[1]) / 2)))


def _flat_band(
    f: Array, mean: Array, quantum: Array, numbers: Parameters, nyquist: float
) -> tuple[float, float] | None:
    """Band [Hz] of least power in which the spectrum is flat and above the digital resolution; None: nowhere."""
    width, most = numbers.number("spectrum.flat_width") * nyquist, numbers.number("spectrum.falling")
    varies = (mean > 0).any(axis=0)
    varying, quantum = mean[:, varies], quantum[varies]
    if not varying.size:
        return numbers.number("spectrum.lowest"), nyquist
    found = []
    for low in np.arange(numbers.number("spectrum.plateau"), nyquist - width, 0.25 * width):
        parts = [varying[(f >= low + k * width / 3) & (f <= low + (k + 1) * width / 3)] for k in range(3)]
        if not all(len(part) for part in parts):
            continue  # thirds of such a band are narrower than a window resolves
        levels = np.array([np.median(part, axis=0) for part in parts])
        if (levels.max(axis=0) <= most * levels.min(axis=0)).all() and (levels > 2 * quantum).all():
            found.append((float(np.mean(np.log(levels))), float(low)))
    low = min(found)[1] if found else 0.0
    return (low, low + width) if found else None


def _channel(
    name: str,
    pool: _Pool,
    spectrum: tuple[Array, Array, float],
    band: tuple[float, float],
    corner: float,
    at_rest: bool,
) -> ChannelNoise:
    f, mean, count = spectrum
    used = (f >= band[0]) & (f <= band[1])
    density = _level(mean[used], count)
    least = max(ROUND_OFF * density.max(), (SINGLE * pool.range) ** 2 / f[-1])
    density = np.where(density > least, density, 0.0)
    quantum = np.mean(pool.quantum, axis=0)
    own = np.where(density > 0, np.maximum(density - quantum, LEAST_OWN * quantum), 0.0)
    # a mean of chi-squares, whose median has 1.25 times its deviation; half of that is of the root
    whole = np.divide(density, own, out=np.zeros_like(own), where=own > 0)
    error = 0.5 * 1.25 / np.sqrt(count * max(int(used.sum()), 1)) * whole
    means = np.array(pool.means if at_rest else [np.full(mean.shape[1], np.nan)])
    step = pool.step if np.isfinite(pool.step) else 0.0
    bits = float(np.log2(pool.range / step + 1)) if step > 0 else np.inf
    return ChannelNoise(name, own, error, means.mean(axis=0), np.ptp(means, axis=0), quantum, step, bits, corner, *band)
