"""Adaptive inverse control: the stable, band-limited inverse of a measured table, as a filter.

A table with the transfer function T follows a reference r if its drive is T⁻¹ r. Here T⁻¹ is a finite impulse
response, which is always stable; it anticipates the delay of the table, so it is centred and applied to a whole record.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arrays import Array
from ..core.errors import RecordError
from ..core.files import write_whole
from ..core.names import AXES
from ..data.records import open_record
from ..data.transfer import Transfer, delay_of
from ..machine.parameters import LARGEST

__all__ = ["InverseFilter", "apply_inverse", "load_inverse", "make_inverse", "save_inverse"]

DOUBTFUL, TRUSTED = 0.4, 0.8  # coherence up to which an axis counts as not measured, and from which as measured
TAPER = 2 ** (1 / 3)  # a third of an octave: from full inverse to nothing above the band
SHORT = 2 ** (1 / 8)  # an eighth of an octave: from full correction to nothing, within the band


@dataclass(frozen=True)
class InverseFilter:
    """Impulse response from reference to drive; tap `len(taps) // 2` is that of zero lag, earlier ones anticipate."""

    taps: Array  # (odd, n, n) [drive / reference] per sample, rows drives, columns references
    rate: float  # [Hz]
    band: tuple[float, float]  # [Hz] where it inverts; unit gain below, nothing above
    axes: tuple[str, ...]  # (n,) names of the axes it acts on
    made_with: Mapping[str, str] = field(default_factory=dict)  # machine, controller and so on (`drives`)


def make_inverse(
    transfer: Transfer,
    rate: float,
    low: float,
    high: float,
    length: float = 4.0,
    floor: float = 0.2,
    corrects: bool = False,
) -> InverseFilter:
    """Inverse of a square transfer function between `low` and `high` [Hz].

    First the delay tau_k of each output k is removed. From `low` / 2 to `low` its row of T is blended from unity on the
    same axis to the measured one; it is blended back where the coherence falls from 0.8 to 0.4. Thus, without
    information, the drive is the reference advanced by tau_k, and the gain at 0 Hz is exactly one. Singular values of
    that matrix below `floor` are raised to it, which bounds the gain at 1 / `floor` and leaves the inverse exact
    elsewhere. From `high` to a third of an octave above, the drive is reduced to zero.

    An inverse that `corrects` a drive for an error must be zero without information, since repeated corrections would
    build up oscillations: the error of an axis is faded out where its coherence falls from 0.8 to 0.4, and that of all
    axes over the eighth of an octave below `high`.

    Parameters: `rate` [Hz] of the filter, `length` [s] of the impulse response; features narrower than about
    2 / `length` [Hz] are smoothed. Raises `ValueError` for a transfer function that is not square or does not extend
    from `low` / 2 to a third of an octave above `high`, and for too low a rate.
    """
    from scipy import fft

    f, n = transfer.frequency, len(transfer.axes)
    if transfer.response.shape[1:] != (n, n):
        raise ValueError(f"only a square transfer function has an inverse, not {transfer.response.shape[1:]}")
    if not (0 < f[0] <= low / 2 * (1 + 1e-9) and low < high and high * TAPER <= min(f[-1], rate / 2)):
        raise ValueError(
            f"an inverse from {low:g} to {high:g} Hz at {rate:g} Hz needs the transfer function from {low / 2:g} to "
            f"{high * TAPER:g} Hz, it reaches from {f[0]:g} to {f[-1]:g} Hz: change the band or estimate with a "
            "longer segment"
        )
    half = round(length * rate / 2)
    grid = fft.rfftfreq(4 * half, 1 / rate)  # twice as long as the filter, against aliasing in time
    level, delays = _level(transfer, low, high, grid)
    U, s, Vh = np.linalg.svd(level)
    inverse = (Vh.conj().swapaxes(1, 2) / np.maximum(s, floor)[:, None, :]) @ U.conj().swapaxes(1, 2)
    inverse *= np.exp(2j * np.pi * np.multiply.outer(grid, delays))[:, None, :]
    stop, fade = (high / SHORT, SHORT) if corrects else (high, TAPER)
    inverse *= 1 - _rise(np.log2(np.maximum(grid, low) / stop), 0, np.log2(fade))[:, None, None]
    if corrects:
        known = np.array([np.interp(grid, transfer.frequency, c) for c in transfer.coherence.T]).T
        known[grid < low] = 1.0  # unit gain, uncoupled
        inverse *= _rise(known, DOUBTFUL, TRUSTED)[:, None, :]
    taps = np.roll(fft.irfft(inverse, 4 * half, axis=0), half, axis=0)[: 2 * half + 1]
    return InverseFilter(_windowed(taps), float(rate), (float(low), float(high)), transfer.axes)


def _level(transfer: Transfer, low: float, high: float, grid: Array) -> tuple[NDArray[Any], Array]:
    """Transfer function without its delays on a grid, unity where it is unknown; and the delays [s]."""
    from scipy.interpolate import CubicSpline

    f, n = transfer.frequency, len(transfer.axes)
    trust = _rise(transfer.coherence, DOUBTFUL, TRUSTED) * _rise(np.log2(f / low), -1, 0)[:, None]  # (m, n)
    trusted = replace(transfer, coherence=trust)
    delays = np.nan_to_num([delay_of(trusted, k, k, low, high) for k in range(n)])
    advance = np.exp(2j * np.pi * np.multiply.outer(f, delays))
    level = np.eye(n) + trust[:, :, None] * (advance[:, :, None] * transfer.response - np.eye(n))
    fine = np.tile(np.eye(n, dtype=complex), (len(grid), 1, 1))
    known = (grid >= f[0]) & (grid <= min(f[-1], high * TAPER))
    fine[known] = CubicSpline(f, level)(grid[known])
    return fine, delays


def _windowed(taps: Array) -> Array:
    """Taps tapered to zero over the outer quarter at each end, then corrected to unit gain at 0 Hz."""
    from scipy.signal.windows import tukey

    window = tukey(len(taps), 0.5)[:, None, None]
    taps = taps * window
    return taps + window / window.sum() * (np.eye(taps.shape[1]) - taps.sum(axis=0))


def _rise(x: ArrayLike, start: float, stop: float) -> Array:
    """Half a cosine from 0 at `start` to 1 at `stop`."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip((np.asarray(x) - start) / (stop - start), 0, 1))


def apply_inverse(inverse: InverseFilter, signal: ArrayLike) -> Array:
    """Drive for a reference of all six axes, (n, 6) to (n, 6), sampled at the filter's rate, without its delay.

    Axes without a filter pass unchanged. The signal is zero outside the record, so it should start and end at rest near
    zero. Raises `ValueError` for a wrong shape or a sample that is not finite.
    """
    from scipy import fft

    x = np.asarray(signal, dtype=float)
    if x.ndim != 2 or x.shape[1] != len(AXES) or not np.isfinite(x).all():
        raise ValueError(f"the signal must have {len(AXES)} columns of finite samples, it has shape {x.shape}")
    columns = [AXES.index(name) for name in inverse.axes]
    half = len(inverse.taps) // 2
    size = fft.next_fast_len(len(x) + 2 * half, real=True)
    spectrum = fft.rfft(inverse.taps, size, axis=0) @ fft.rfft(x[:, columns], size, axis=0)[:, :, None]
    drive = x.copy()
    drive[:, columns] = fft.irfft(spectrum[:, :, 0], size, axis=0)[half : half + len(x)]
    return drive


# ---------------------------------------------------------------------------------------------- disk
def save_inverse(inverse: InverseFilter, path: Path | str) -> None:
    """Write an inverse as netCDF-4, whole or not at all."""
    import xarray as xr

    data = xr.Dataset(
        {"inverse_taps": (("tap", "drive_axis", "reference_axis"), inverse.taps)},
        {"drive_axis": list(inverse.axes), "reference_axis": list(inverse.axes)},
        {"kind": "inverse", "sample_rate_hz": inverse.rate, "band_hz": list(inverse.band), **inverse.made_with},
    )
    with write_whole(path) as beside, memoryview(data.to_netcdf(engine="h5netcdf")) as content:
        beside.write_bytes(content)


def load_inverse(path: Path | str) -> InverseFilter:
    """Read an inverse written by `save_inverse`; raises `RecordError`, naming the file, for any other content."""
    data = open_record(path)
    if str(data.attrs.get("kind")) != "inverse":
        raise RecordError(f"{path}: is not a saved inverse; make one with `lhpost6 iterate`")
    try:
        stored = data["inverse_taps"].transpose("tap", "drive_axis", "reference_axis")
        taps = stored.values.astype(float, casting="safe")
        axes, references = (tuple(map(str, data[dim].values)) for dim in stored.dims[1:])
        low, high = map(float, data.attrs["band_hz"])
        rate = float(data.attrs["sample_rate_hz"])
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{path}: is damaged or incomplete: {error}; make it again with `lhpost6 iterate`") from error
    fits = axes == references and len(taps) % 2 and set(axes) <= set(AXES) and len(set(axes)) == len(axes) > 0
    if not (fits and (np.abs(taps) <= LARGEST).all() and 0 < rate < np.inf and 0 < low < high < np.inf):
        raise RecordError(f"{path}: holds an inverse of shape {taps.shape} for {' '.join(axes)}; make it again")
    made_with = {key: str(value) for key, value in data.attrs.items() if isinstance(value, str) and key != "kind"}
    return InverseFilter(taps, rate, (low, high), axes, made_with)
