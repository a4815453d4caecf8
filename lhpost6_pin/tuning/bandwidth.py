"""Bandwidth limitation of an axis: the cause that ends the band in which it follows its reference."""

import numpy as np

from ..data.transfer import Transfer
from ..mechanics.linearize import oil_column_modes
from ..mechanics.plant import Plant

__all__ = ["bandwidth_limitation"]


def bandwidth_limitation(
    plant: Plant, transfer: Transfer, band: tuple[float, float], tolerance: float, coherence: float, high: float
) -> str:
    """Bandwidth limitation of an axis, as text, from the response just above its band."""
    end = band[1]
    if end >= high:
        return f"follows to {high:g} Hz and beyond"
    f = transfer.frequency
    at = int(np.searchsorted(f, end, side="right")) if np.isfinite(end) else int(np.argmin(np.abs(f - 1.0)))
    gain, coherent = 20.0 * np.log10(np.abs(transfer.response[at, 0, 0])), transfer.coherence[at, 0]
    words = []
    if coherent < coherence:
        words.append(
            f"coherence {coherent:.2f} at {f[at]:.3g} Hz: too little of the motion is coherent with the reference"
        )
    if abs(gain) > tolerance:
        words.append(f"gain {gain:+.1f} dB at {f[at]:.3g} Hz: beyond the correction of three feed-forward gains")
    modes = oil_column_modes(plant.machine, loaded=True)
    near = min(modes, key=lambda mode: abs(np.log(mode.frequency / f[at])))
    if abs(np.log2(near.frequency / f[at])) < 0.5:
        words.append(f"near the oil column at {near.frequency:.3g} Hz ({near.axis})")
    words.append(f"with {360.0 * f[at] * float(plant.delays.max()):.0f} deg of valve delay")
    return ", ".join(words)
