"""Bandwidth limitation of an axis: the cause that ends the band in which it follows its reference."""

from typing import NamedTuple

import numpy as np

from ..core.names import AXES
from ..data.transfer import Transfer
from ..mechanics.linearize import oil_column_modes
from ..mechanics.plant import Plant
from ..mechanics.specimen_modes import specimen_modes

__all__ = ["BandwidthLimitation", "bandwidth_limitation"]

# Judgement, not physics: which modes are near a frequency, and which modes of a specimen the platen feels.
OIL_COLUMN_OCTAVES, SPECIMEN_OCTAVES = 0.5, 0.25
MOVED_SHARE = 0.01  # effective mass or inertia of the mode over that of the platen


class BandwidthLimitation(NamedTuple):
    """What limits the band of an axis."""

    summary: str
    by_specimen: bool  # whether a natural frequency of the specimen is near


def bandwidth_limitation(
    plant: Plant, transfer: Transfer, band: tuple[float, float], tolerance: float, coherence: float, high: float
) -> BandwidthLimitation:
    """Bandwidth limitation of an axis from the response just above its band [Hz], up to `high` [Hz].

    `transfer` is that of the axis alone; `tolerance` [dB] and least `coherence` are those of the band. The delay of the
    valves is stated unless a mode of the specimen that moves the axis is near: its notch is none of the control loop's.
    """
    end = band[1]
    if end >= high:
        return BandwidthLimitation(f"follows to {high:g} Hz and beyond", False)
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
    specimen = _specimen_mode(plant, transfer.axes[0], float(f[at]))
    if specimen:
        words.append(specimen)
    axis = transfer.axes[0]
    modes = [mode for mode in oil_column_modes(plant.machine, loaded=True) if axis in mode.axes]
    if modes:  # of columns as near as each other its own is named
        near = min(modes, key=lambda mode: (round(_octaves(mode.frequency, f[at]), 2), mode.axis != axis))
        if _octaves(near.frequency, f[at]) < OIL_COLUMN_OCTAVES:
            words.append(f"near the oil column at {near.frequency:.3g} Hz ({near.axis})")
    if not specimen:
        words.append(f"with {360.0 * f[at] * float(plant.delays.max()):.0f} deg of valve delay")
    return BandwidthLimitation(", ".join(words), bool(specimen))


def _specimen_mode(plant: Plant, axis: str, frequency: float) -> str:
    """The mode of the specimen next to a frequency [Hz] that moves an axis, as a phrase; empty if none is near."""
    k, platen = AXES.index(axis), plant.machine.platen
    own = (*platen.mass, *platen.inertia)[k]
    near = [
        (_octaves(mode.frequency, frequency), f"near the specimen's mode {n} at {mode.frequency:.3g} Hz")
        for n, mode in enumerate(specimen_modes(plant), 1)
        if mode.mass[k] > MOVED_SHARE * own
    ]
    distance, phrase = min(near, default=(np.inf, ""))
    return phrase if distance < SPECIMEN_OCTAVES else ""


def _octaves(one: float, other: float) -> float:
    """Distance of two frequencies [octaves]."""
    return float(abs(np.log2(one / other)))
