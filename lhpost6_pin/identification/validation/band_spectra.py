"""Spectra of what is compared, and the model's amplitude over the measured one in bands.

Signals are not low-passed at the band of the comparison, since half of the oil columns lie above it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...core.arrays import Array
from .metrics import Numbers

__all__ = ["Spectrum", "estimate_spectrum"]


@dataclass(frozen=True)
class Spectrum:
    """Power spectral densities [unit2/Hz] of one quantity over `frequency` (f,) [Hz], k columns."""

    quantity: str
    columns: tuple[str, ...]
    frequency: Array
    measured: Array  # (f, k)
    model: Array  # (f, k)
    ratio: Array  # (bands, k) amplitude of the model over the measurement; nan where noise prevails


def estimate_spectrum(
    quantity: str, columns: Sequence[str], measured: Array, model: Array, noise: Array, dt: float, numbers: Numbers
) -> Spectrum:
    """Welch's estimate for both sides (n, k); noise (n, k) is a draw of the sensors' noise."""
    from scipy.signal import welch

    length = min(round(numbers.number("spectra.segment") / dt), len(measured))
    f, ours = welch(measured, 1 / dt, nperseg=length, axis=0)
    theirs, noisy = (welch(x, 1 / dt, nperseg=length, axis=0)[1] for x in (model, noise))
    return Spectrum(quantity, tuple(columns), f, ours, theirs, _band_ratios(f, ours, theirs, noisy, numbers))


def _band_ratios(f: Array, measured: Array, model: Array, noise: Array, numbers: Numbers) -> Array:
    """Amplitude of the model over that of the measurement (bands, k) from powers (f, k); nan where noise prevails."""
    edges = numbers.bands
    out = np.full((len(edges) - 1, measured.shape[1]), np.nan)
    for b, (low, high) in enumerate(pairwise(edges)):
        inside = (f >= low) & (f < high)
        if inside.any():
            ours, theirs, noisy = (x[inside].mean(axis=0) for x in (measured, model, noise))
            clear = ours > numbers.number("spectra.noise") ** 2 * noisy
            out[b] = np.sqrt(np.divide(theirs, ours, out=np.full(len(ours), np.nan), where=clear))
    return out
