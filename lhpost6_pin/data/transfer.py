"""Transfer functions between sampled signals, with their coherence.

The response of q outputs to p inputs is T(f) = Syx Sxx⁻¹ (the H1 estimate: noise on the outputs averages out),
with cross spectra averaged over Hann-windowed segments that overlap by half (Welch 1967; Bendat and Piersol,
Random Data, chapters 7 and 9).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arrays import Array
from ..core.errors import UnknownNameError
from ..core.names import AXES

__all__ = ["Transfer", "band", "band_within", "delay_of", "estimate_transfer"]


QUIET = 1e-8  # of an input's largest power density: below that the input counts as silent at a frequency


@dataclass(frozen=True)
class Transfer:
    """Frequency responses from p inputs to q outputs over m frequencies."""

    frequency: Array  # (m,) [Hz], uniform, without 0
    response: NDArray[np.complex128]  # (m, q, p) [output / input]
    coherence: Array  # (m, q) multiple coherence of each output with all inputs together, 0 to 1
    axes: tuple[str, ...] = AXES  # (p,) names of the inputs; a square transfer has the same outputs


def estimate_transfer(
    inputs: ArrayLike, outputs: ArrayLike, rate: float, segment: float = 8.0, axes: Sequence[str] = AXES
) -> Transfer:
    """Transfer function from records of white noise, at the frequencies 1 / segment, 2 / segment, ... [Hz].

    All inputs may move at once if they are independent of each other. A delay of the outputs biases the gain by
    (2 pi²/3) (delay / segment)², 1e-4 for 30 ms in 8 s. At frequencies where an input is 80 dB below its own
    peak or lower its response is shrunk towards zero instead of blowing up.

    The coherence is the share of an output's power that this response, shrunk or not, explains. It is corrected
    for the p coefficients fitted to K segments, which would make unrelated signals seem to share p / K.

    Parameters: `inputs` (n, p), `outputs` (n, q), `rate` [Hz], `segment` [s], `axes` names of the inputs.
    Raises `ValueError` for a silent input, a sample that is not finite, columns that do not fit the axes, or a
    record too short for p inputs; `UnknownNameError` for an axis that does not exist.
    """
    x, y = np.asarray(inputs, dtype=float), np.asarray(outputs, dtype=float)
    axes, length = tuple(axes), round(segment * rate)
    _check(x, y, axes)
    count = max((len(x) - length) // (length // 2) + 1, 0) if length >= 2 else 0
    if count <= len(axes):
        raise ValueError(
            f"{len(x) / rate:g} s hold {count} segments of {segment:g} s; {len(axes)} inputs need at least "
            f"{len(axes) + 1}: take a longer record or a shorter segment"
        )
    X, Y = _segment_spectra(x, length), _segment_spectra(y, length)  # (m, p, K), (m, q, K)
    Xh = X.conj().swapaxes(1, 2)
    Sxx, Syx, Syy = X @ Xh, Y @ Xh, np.sum(np.abs(Y) ** 2, axis=2)
    floor = QUIET * np.einsum("mpp->mp", Sxx).real.max(axis=0)
    T = np.linalg.solve((Sxx + np.diag(floor)).swapaxes(1, 2), Syx.swapaxes(1, 2)).swapaxes(1, 2)
    left = np.sum(np.abs(Y - T @ X) ** 2, axis=2)
    unexplained = np.divide(left, Syy, out=np.ones_like(left), where=Syy > 0)
    freedom = 1 - len(axes) / count
    frequency = np.arange(1, len(T) + 1) * rate / length
    return Transfer(frequency, T, np.clip(1 - unexplained / freedom, 0, 1), axes)


def _check(x: Array, y: Array, axes: tuple[str, ...]) -> None:
    if unknown := [name for name in axes if name not in AXES]:
        raise UnknownNameError("axis", unknown[0], AXES)
    if x.ndim != 2 or y.ndim != 2 or len(x) != len(y):
        raise ValueError(f"inputs {x.shape} and outputs {y.shape} must be tables with as many rows")
    if x.shape[1] != len(axes) or len(set(axes)) < len(axes):
        raise ValueError(f"{x.shape[1]} inputs need as many different axes, not {' '.join(axes)}")
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError("inputs and outputs must be finite")
    if silent := [name for name, column in zip(axes, x.T, strict=True) if len(x) and not np.ptp(column)]:
        raise ValueError(f"input {', '.join(silent)} is silent: pass only the inputs that move, and their axes")


def _segment_spectra(x: Array, length: int) -> NDArray[Any]:
    """Spectra of overlapping segments less their mean, without frequency 0: (n, k) to (m, k, segments)."""
    from scipy import fft

    segments = np.lib.stride_tricks.sliding_window_view(x, length, axis=0)[:: length // 2]  # (segments, k, length)
    window = np.hanning(length + 1)[:-1]
    return fft.rfft((segments - segments.mean(axis=2, keepdims=True)) * window, axis=2).T[1:]


def band(transfer: Transfer, low: float, high: float) -> Transfer:
    """Part of a transfer function from `low` to `high` [Hz]. Raises `ValueError` if no frequency is left."""
    inside = (transfer.frequency >= low) & (transfer.frequency <= high)
    if not inside.any():
        raise ValueError(f"the transfer function has no frequency from {low:g} to {high:g} Hz")
    parts = {name: getattr(transfer, name)[inside] for name in ("frequency", "response", "coherence")}
    return replace(transfer, **parts)


def delay_of(transfer: Transfer, output: int, source: int, low: float, high: float) -> float:
    """Delay of output `output` behind input `source` [s], of columns counted from 0; NaN where nothing coheres.

    Least-squares slope of the phase through the origin from `low` to `high` [Hz], weighted by the coherence:
    minimises sum w (arg T + 2 pi f delay)². The first guess is the mean phase step from one frequency to the next,
    so the phase may turn many times. Raises `ValueError` for fewer than two frequencies in the band.
    """
    part = band(transfer, low, high)
    if len(part.frequency) < 2:
        raise ValueError(f"a phase slope from {low:g} to {high:g} Hz needs at least two frequencies")
    T, omega = part.response[:, output, source], 2 * np.pi * part.frequency
    weight = part.coherence[:, output] * (T != 0)
    if not weight.any():
        return float("nan")
    turn = np.sqrt(weight[1:] * weight[:-1]) * np.exp(1j * np.diff(np.angle(T)))
    delay = -np.angle(turn.sum()) / (omega[1] - omega[0])
    for _ in range(10):  # once would do if no residual phase were beyond half a turn
        residual = np.angle(T * np.exp(1j * omega * delay))
        delay -= np.sum(weight * omega * residual) / np.sum(weight * omega**2)
    return float(delay)


def band_within(
    transfer: Transfer, axis: int, decibels: float, coherence: float, around: float = 1.0
) -> tuple[float, float]:
    """Widest unbroken band [Hz] around a frequency where an axis follows its own reference; (nan, nan) if none.

    Inside it |20 log10 |T_kk|| <= `decibels` and the coherence is at least `coherence`, at every frequency.
    """
    T, f = np.abs(transfer.response[:, axis, axis]), transfer.frequency
    good = (T >= 10 ** (-decibels / 20)) & (T <= 10 ** (decibels / 20)) & (transfer.coherence[:, axis] >= coherence)
    start = int(np.argmin(np.abs(f - around)))
    if not good[start]:
        return float("nan"), float("nan")
    bad = np.flatnonzero(~good)
    first, last = bad[bad < start].max(initial=-1) + 1, bad[bad > start].min(initial=len(f)) - 1
    return float(f[first]), float(f[last])
