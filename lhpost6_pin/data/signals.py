"""Comparing and conditioning sampled signals: errors, delays, shifts, interpolation, filters, derivatives.

Time runs along the first axis; every column is treated by itself. `x` is (n,) or (n, k), what is returned per
column is () or (k,). `dt` is the sample interval [s]. A delay is positive where the signal is late.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arrays import Array

__all__ = [
    "Band",
    "align",
    "correlation",
    "delay",
    "delay_within",
    "differentiate",
    "drift_rate",
    "fast_length",
    "lag",
    "local_wiener",
    "lowpass_zero_phase",
    "peak_ratio",
    "resample_band_limited",
    "rrmse",
]


FADE = 32
"""Samples over which at least a reflection fades out that is made longer for a fast transform."""


def rrmse(reference: ArrayLike, signal: ArrayLike) -> Array:
    """Relative root-mean-square error per column [1], sqrt(sum (signal - reference)² / sum reference²).

    Where the reference is zero throughout it is 0 for an equally silent signal and infinite otherwise.
    """
    ref, sig = _pair(reference, signal)
    return _ratio(np.sqrt(np.sum((sig - ref) ** 2, axis=0)), np.sqrt(np.sum(ref**2, axis=0)))


def peak_ratio(reference: ArrayLike, signal: ArrayLike) -> Array:
    """Largest magnitude of the signal over that of the reference, per column [1]."""
    ref, sig = _pair(reference, signal)
    return _ratio(np.abs(sig).max(axis=0), np.abs(ref).max(axis=0))


def correlation(reference: ArrayLike, signal: ArrayLike) -> Array:
    """Pearson's correlation coefficient per column [1]; 0 where either does not vary."""
    ref, sig = (x - x.mean(axis=0) for x in _pair(reference, signal))
    scale = np.sqrt(np.sum(ref**2, axis=0) * np.sum(sig**2, axis=0))
    return np.divide(np.sum(ref * sig, axis=0), scale, out=np.zeros_like(scale), where=scale > 0)


def drift_rate(error: ArrayLike, dt: float) -> Array:
    """Least-squares slope of an error per column [unit of the error / s]."""
    x = np.asarray(error, dtype=float)
    t = dt * (np.arange(len(x)) - (len(x) - 1) / 2)
    return np.tensordot(t, x, axes=(0, 0)) / np.sum(t**2)


def delay(reference: ArrayLike, signal: ArrayLike, dt: float, max_delay: float = 0.1) -> Array:
    """Delay of the signal behind the reference per column [s], at most ±`max_delay`; NaN if one is silent.

    It maximises Pearson's correlation of r(t) with s(t + τ) under a Hann window that stays `max_delay` clear
    of both ends, so that every delay is judged on the same stretch of the reference, whatever the gain and
    offset. The best whole sample is refined by Newton steps on Fourier sums, exact for band-limited signals.
    Raises `ValueError` if the record is shorter than four times `max_delay`.
    """
    ref, sig = _pair(reference, signal)
    margin = int(np.ceil(max_delay / dt)) + 1
    if len(ref) < 4 * margin:
        raise ValueError(f"max_delay {max_delay} s needs a record of at least {4 * margin * dt:g} s")
    columns = [_delay_samples(r, s, margin) for r, s in zip(_columns(ref).T, _columns(sig).T, strict=True)]
    return np.clip(dt * np.reshape(columns, ref.shape[1:]), -max_delay, max_delay)


def delay_within(reference: ArrayLike, signal: ArrayLike, dt: float, max_delay: float) -> Array:
    """As `delay`, and not-a-number where the best is at an end of the range: it may lie anywhere beyond."""
    found = delay(reference, signal, dt, max_delay)
    return np.where(np.abs(found) < max_delay, found, np.nan)  # the search goes a sample beyond


def _delay_samples(ref: Array, sig: Array, margin: int) -> float:
    """Delay of one signal in samples, at most `margin` either way."""
    n = len(ref)
    w = np.zeros(n)
    w[margin : n - margin] = np.hanning(n - 2 * margin + 2)[1:-1]
    w /= w.sum()
    ref, sig = ref - w @ ref, sig - w @ sig
    if not (np.any(w * ref) and np.any(w * sig)):
        return float("nan")
    size = fast_length(n + 2 * margin)
    omega = 2 * np.pi * np.arange(size // 2 + 1) / size
    # spectra over lag τ of the windowed covariance, mean square and mean: sums of w r s, w s², w s at t + τ
    spectra = np.conj(np.fft.rfft([w * ref, w], size))[[0, 1, 1]] * np.fft.rfft([sig, sig**2, sig], size) / size
    cov, square, mean = size * np.roll(np.fft.irfft(spectra, size), margin, axis=1)[:, : 2 * margin + 1]
    variance = square - mean**2
    if not variance.max() > 0:
        return float("nan")
    tau = whole = float(np.argmax(cov / np.sqrt(np.maximum(variance, 1e-12 * variance.max())))) - margin
    spectra[:, 1 : (size + 1) // 2] *= 2.0  # for the negative frequencies
    for _ in range(20):
        turn = np.exp(1j * omega * tau)
        sums = spectra @ np.stack([turn, 1j * omega * turn, -(omega**2) * turn], axis=1)  # with derivatives by tau
        (c, s, m), (c1, s1, m1), (c2, s2, m2) = sums.real.T
        v, v1, v2 = s - m**2, s1 - 2 * m * m1, s2 - 2 * (m1**2 + m * m2)
        if not (c > 0 and v > 0):  # nothing but rounding varies
            break
        slope = c1 / c - v1 / (2 * v)  # of the logarithm of cov / sqrt(variance)
        curvature = c2 / c - (c1 / c) ** 2 - (v2 / v - (v1 / v) ** 2) / 2
        if not curvature < 0:
            break
        step = float(np.clip(-slope / curvature, -0.5, 0.5))
        tau = float(np.clip(tau + step, whole - 1, whole + 1))
        if abs(step) < 1e-9:
            break
    return tau


def align(signal: ArrayLike, delay: ArrayLike, dt: float) -> Array:
    """Signal advanced by its `delay` [s], one or one per column: y(t) = x(t + delay).

    A phase shift in the Fourier domain, exact for band-limited signals but for about ten samples at an end
    where the signal is curved. Samples from outside the record hold its end value: nothing wraps around.
    """
    x = np.asarray(signal, dtype=float)
    tau = np.broadcast_to(np.asarray(delay, dtype=float), x.shape[1:])
    ends = np.stack([x[0], x[-1]])
    rise = (ends[1] - ends[0]) / ((len(x) - 1) * dt)
    alike = tau.ravel()[:1].reshape([1] * tau.ndim) if len(np.unique(tau)) == 1 else tau  # one phase for all columns
    shifted = _filtered(x, dt, lambda f: np.exp(2j * np.pi * np.multiply.outer(f, alike)))
    shifted += rise * tau
    most = min(len(x), int(np.abs(tau).max(initial=0.0) / dt) + 2)  # samples at an end that may be outside
    first, last = (np.add.outer(dt * np.arange(a, a + most), tau) for a in (0, len(x) - most))
    shifted[:most] = np.where(first < 0, ends[0], shifted[:most])
    shifted[-most:] = np.where(last > (len(x) - 1) * dt, ends[1], shifted[-most:])
    return shifted


def lag(signal: ArrayLike, time: ArrayLike, dt: float) -> Array:
    """First-order answer to a signal, T dy/dt + y = x with its time constant T [s], one or one per column.

    In the Fourier domain, as `align`: exact for band-limited signals, and at rest in their slope at the start.
    """
    x = np.asarray(signal, dtype=float)
    constant = np.broadcast_to(np.asarray(time, dtype=float), x.shape[1:])
    late = _filtered(x, dt, lambda f: 1.0 / (1.0 + 2j * np.pi * np.multiply.outer(f, constant)))
    return late - (x[-1] - x[0]) / ((len(x) - 1) * dt) * constant


def lowpass_zero_phase(x: ArrayLike, dt: float, cutoff: float, order: int = 8) -> Array:
    """Butterworth low-pass run forwards and backwards: gain 1 / (1 + (f / cutoff)^order), no phase.

    `cutoff` [Hz] is where the gain is one half. `order` (even) is that of both passes together.
    """
    from scipy import signal

    x = np.asarray(x, dtype=float)
    sos = signal.butter(order // 2, cutoff, fs=1 / dt, output="sos")
    return signal.sosfiltfilt(sos, x, axis=0, padlen=min(len(x) - 1, int(np.ceil(order / (cutoff * dt)))))


@dataclass(frozen=True)
class Band:
    """Zero-phase band from `low` to `high` [Hz]: one value to filter everything alike that is compared.

    The gain is 1 / (1 + (f / high)^order), one half at `high`, as of a Butterworth low-pass run both ways; `low`
    above 0 takes off the same low-pass at `low`. Two filters of one band commute with differentiation and with
    each other, so what was equal before is equal after.
    """

    low: float = 0.0
    high: float = np.inf
    order: int = 8

    def __post_init__(self) -> None:
        """Refuse an empty band."""
        if not (0.0 <= self.low < self.high and self.order >= 2):
            raise ValueError(f"no band from {self.low} to {self.high} Hz of order {self.order}")

    def gain(self, f: ArrayLike) -> Array:
        """Gain at frequencies [Hz], between 0 and 1."""
        size = np.abs(np.asarray(f, dtype=float))
        gain = 1 / (1 + np.minimum(size / self.high, 1e6) ** self.order)
        return gain - (1 / (1 + np.minimum(size / self.low, 1e6) ** self.order) if self.low else 0.0)

    def apply(self, x: ArrayLike, dt: float) -> Array:
        """Signal within the band, without phase, by the Fourier transform as `differentiate`.

        With `low` above 0 the straight line from the first to the last value is taken off as well.
        """
        x = np.asarray(x, dtype=float)
        return _filtered(x, dt, lambda f: self.gain(f).reshape(-1, *[1] * (x.ndim - 1)), keep_chord=not self.low)


def local_wiener(x: ArrayLike, noise: ArrayLike, samples: int) -> Array:
    """Local Wiener filter m + max(0, 1 - noise² / s²) (x - m), m and s² the mean and variance of `samples` about each.

    What varies by no more than its noise, of standard deviation `noise` (), (1,) or (k,), becomes its local mean; what
    varies by far more is left as it was.
    """
    from scipy.ndimage import uniform_filter1d

    x = np.asarray(x, dtype=float)
    wide = 2 * (max(samples, 1) // 2) + 1
    mean = uniform_filter1d(x, wide, axis=0, mode="nearest")
    variance = uniform_filter1d(np.square(x), wide, axis=0, mode="nearest") - np.square(mean)
    power = np.broadcast_to(np.square(noise), x.shape)
    return np.asarray(
        mean + np.where(variance > power, 1.0 - power / np.maximum(variance, power + 1e-300), 0.0) * (x - mean)
    )


def differentiate(x: ArrayLike, dt: float, cutoff: float | None = None, order: int = 8) -> Array:
    """Time derivative [unit of x / s] by the Fourier transform, low-passed without phase at `cutoff` [Hz].

    Exact for band-limited signals but near an end where the signal is curved. It amplifies noise: white noise
    of standard deviation sigma becomes 2 pi fc sigma sqrt(2 fc dt / 3) with a sharp cutoff at fc; without
    `cutoff` fc is 1 / (2 dt). The low-pass used, 1 / (1 + (f / cutoff)^order), leaves 0.89 of it at order 8.
    """
    x = np.asarray(x, dtype=float)

    def response(f: Array) -> NDArray[Any]:
        low_pass = 1.0 if cutoff is None else 1 / (1 + (f / cutoff) ** order)
        return (2j * np.pi * f * low_pass).reshape(-1, *[1] * (x.ndim - 1))

    return _filtered(x, dt, response, keep_chord=False) + (x[-1] - x[0]) / (max(len(x) - 1, 1) * dt)


def resample_band_limited(x: ArrayLike, t_old: ArrayLike, t_new: ArrayLike, half_width: int = 24) -> Array:
    """Values of a uniformly sampled band-limited signal at other times, by a Kaiser-windowed sinc.

    Good to 1e-7 of the amplitude for content below 0.8 of the old Nyquist frequency, `half_width` samples
    away from the ends; nearer, the signal is continued by odd reflection, less accurate where it is curved.
    Times outside the record get its end values. Going to a lower rate it does not guard against aliasing.

    Parameters: `x` (n, ...), `t_old` (n,) uniform [s], `t_new` (m,) [s]. Returns (m, ...).
    """
    from scipy.special import i0

    beta = 14.5  # 140 dB: what 2 x 24 taps give with a transition from 0.8 to 1.2 of the Nyquist frequency
    x, t_old = np.asarray(x, dtype=float), np.asarray(t_old, dtype=float)
    dt = (t_old[-1] - t_old[0]) / (len(t_old) - 1)
    if len(t_old) != len(x) or np.abs(np.diff(t_old) - dt).max() > 0.01 * dt:
        raise ValueError("t_old must be uniform, one time per sample")
    place = np.clip((np.asarray(t_new, dtype=float) - t_old[0]) / dt, 0, len(x) - 1)
    first = np.minimum(place.astype(int), len(x) - 2)
    extended = np.pad(x, [(half_width, half_width)] + [(0, 0)] * (x.ndim - 1), "reflect", reflect_type="odd")
    # rates in a whole ratio need few sets of weights; 1e-10 of a sample is 1e-10 of the amplitude
    share, which = np.unique(np.round(place - first, 10), return_inverse=True)
    u = share[:, None] - np.arange(1 - half_width, half_width + 1)
    weight = np.sinc(u) * i0(beta * np.sqrt(np.maximum(1 - (u / half_width) ** 2, 0)))
    weight /= weight.sum(axis=1, keepdims=True)
    result = np.zeros((len(place), *x.shape[1:]))
    for k in range(2 * half_width):
        result += weight[which, k].reshape(-1, *[1] * (x.ndim - 1)) * extended[first + k + 1]
    return result


def fast_length(n: int) -> int:
    """Least length of at least `n` without prime factors beyond 5, at which Fourier transforms are fast.

    As `scipy.fft.next_fast_len`, whose import takes longer than all transforms of a report.
    """
    best, fives = 1 << (n - 1).bit_length(), 1
    while fives < best:
        odd = fives
        while odd < best:
            best = min(best, odd << (-(-n // odd) - 1).bit_length())
            odd *= 3
        fives *= 5
    return best


# ---------------------------------------------------------------------------------------------- helpers
def _filtered(x: Array, dt: float, response: Callable[[Array], NDArray[Any]], keep_chord: bool = True) -> Array:
    """Apply a frequency response to x less its chord, continued by odd reflection; put the chord back.

    The chord joins the first and last value. What is left vanishes at both ends, so its odd reflection is
    periodic, continuous and with continuous slope: no wrap-around jump. Where twice the length has large prime
    factors, some more of the reflection, fading out, goes in between.
    """
    n = len(x)
    chord = np.linspace(x[0], x[-1], n)
    rest = x - chord
    more = fast_length(n - 1) - (n - 1)
    if more:
        more = fast_length(n - 1 + FADE) - (n - 1)
    if 0 < more < n:
        fade = np.cos(0.5 * np.pi * np.arange(1, more + 1) / more) ** 2
        rest = np.concatenate([rest, -rest[-2 : -2 - more : -1] * fade.reshape(-1, *[1] * (x.ndim - 1))])
    odd = np.concatenate([rest, -rest[-2:0:-1]])
    spectrum = np.fft.rfft(odd, axis=0) * response(np.asarray(np.fft.rfftfreq(len(odd), dt), np.float64))
    return np.fft.irfft(spectrum, len(odd), axis=0)[:n] + chord * keep_chord


def _pair(reference: ArrayLike, signal: ArrayLike) -> tuple[Array, Array]:
    ref, sig = np.asarray(reference, dtype=float), np.asarray(signal, dtype=float)
    if ref.shape != sig.shape:
        raise ValueError(f"reference {ref.shape} and signal {sig.shape} differ in shape")
    return ref, sig


def _columns(x: Array) -> Array:
    return x.reshape(len(x), -1)


def _ratio(above: Array, below: Array) -> Array:
    unlike = np.where(above > 0, np.inf, 0.0)
    return np.divide(above, below, out=unlike, where=below > 0)
